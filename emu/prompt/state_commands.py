"""Commands that show what there is, or change it, while the machine stands."""

from __future__ import annotations

import re
from typing import Final

from emu.prompt import formatting
from emu.prompt.client import RefusedError
from emu.prompt.session import LISTED, Session
from emu.prompt.table import TABLE, called, command

FORMAT: Final = re.compile(r"/(\d*)([a-z]*)(?:\s+|$)(.*)", re.DOTALL)
SIZES: Final = {"b": 1, "h": 2, "w": 4}
STRING_BYTES: Final = 256
TOPICS: Final = {
    "breakpoints": "all of them, by number",
    "frame": "where the selected frame stands",
    "locals": "parameters and locals of the selected frame",
    "registers": "W0 to W15, PC, SR as the selected frame has them",
    "sfr": "[PATTERN]: registers by their name or their peripheral's, with fields",
    "statics": "the file's own variables",
    "threads": "OpenSwarm's threads with stack use",
}


def _formatted(text: str) -> tuple[int, str, str]:
    """Count, letters and the rest of `/COUNTLETTERS REST`."""
    match = FORMAT.fullmatch(text)
    return (int(match[1] or 1), match[2], match[3].strip()) if match is not None else (1, "", text)


@command("backtrace", "the call stack, through interrupts", "bt", "where")
def backtrace_(session: Session, _text: str) -> None:
    session.write(formatting.backtrace(session.frames, session.at))


@command("frame [N]", "look at the Nth frame of the call stack", "f")
def frame_(session: Session, text: str) -> None:
    if text:
        if not text.isdecimal() or int(text) >= len(session.frames):
            raise RefusedError(f"the frames are 0 to {len(session.frames) - 1}, not {text}")
        session.at = int(text)
    session.where()


@command("up", "look at the caller", repeats=True)
def up_(session: Session, _text: str) -> None:
    frame_(session, str(session.at + 1))


@command("down", "look at the function that was called", repeats=True)
def down_(session: Session, _text: str) -> None:
    if not session.at:
        raise RefusedError("this is the innermost frame")
    frame_(session, str(session.at - 1))


@command("threads", "OpenSwarm's threads with stack use")
def threads_(session: Session, _text: str) -> None:
    session.console("/threads")


@command("thread PID", "look at the call stack of another thread")
def thread_(session: Session, text: str) -> None:
    threads = {one["name"].partition(" ")[0]: one["id"] for one in session.client.ask("threads")["threads"]}
    if text not in threads:
        raise RefusedError(f"there is no thread {text or 'without a PID'}: {', '.join(threads)}")
    session.select(threads[text])
    backtrace_(session, "")


@command("print[/x|d|u|t|c] EXPRESSION", "its value, in C's words", "p")
def print_(session: Session, text: str) -> None:
    _, form, expression = _formatted(text)
    if form and (len(form) > 1 or form not in formatting.FORMATS):
        raise RefusedError(f"the formats are /{' /'.join(formatting.FORMATS)}, not /{form}")
    found = session.evaluated(expression)["result"]
    session.write(f"{expression} = {formatting.number(found, form) if form else found}")


@command("set PLACE = EXPRESSION", "change a variable, a register, an SFR or a field of one")
def set_(session: Session, text: str) -> None:
    text = text.removeprefix("var ")
    if not re.search(r"[^=!<>]=[^=]", text):
        raise RefusedError("expected PLACE = EXPRESSION")
    frame = {"frameId": session.frame["id"]} if session.frame is not None else {}
    found = session.client.ask("evaluate", expression=text, context="repl", **frame)
    session.write(f"{text.partition('=')[0].strip()} = {found['result']}")


@command("x[/COUNT FORMAT SIZE] ADDRESS", "memory: x/8xb &buffer; sizes b h w, formats x d u t c a s, i for code",
         repeats=True)  # fmt: skip
def x_(session: Session, text: str) -> None:
    count, letters, expression = _formatted(text)
    forms, sizes = letters.strip("bhw"), [one for one in letters if one in SIZES]
    if len(forms) > 1 or (forms and forms not in f"{formatting.FORMATS}si") or len(sizes) > 1:
        raise RefusedError(f"/{letters} is no format: one of {formatting.FORMATS}si and one of bhw")
    if forms == "i":
        _instructions(session, session.number(expression), count)
        return
    size = SIZES[sizes[0]] if sizes else 1 if forms in ("c", "s") and forms else 2
    address = session.number(expression)
    wanted = STRING_BYTES if forms == "s" else count * size
    found = session.client.ask("readMemory", memoryReference=f"{address:#06x}", count=wanted)
    session.write(formatting.memory(found, size, forms or "x"))


def _instructions(session: Session, address: int, count: int) -> None:
    rows = session.client.ask(
        "disassemble", memoryReference=f"{address:#08x}", instructionCount=count, resolveSymbols=True
    )["instructions"]
    session.write(formatting.disassembly(rows, session.number("PC")))


@command("disassemble [FUNCTION|ADDRESS [COUNT]]", "instructions with the lines they come from", "dis")
def disassemble_(session: Session, text: str) -> None:
    words = text.rsplit(maxsplit=1)
    count = int(words.pop()) if len(words) == 2 and words[1].isdecimal() else LISTED
    _instructions(session, session.number(words[0].removeprefix("*") if words else "PC"), count)


@command("info TOPIC", "one of " + ", ".join(TOPICS), "i")
def info_(session: Session, text: str) -> None:
    word, _, rest = text.partition(" ")
    found = [one for one in TOPICS if word and one.startswith(word)]
    if len(found) != 1:
        raise RefusedError("info " + "; ".join(f"{name}: {told}" for name, told in TOPICS.items()))
    match found[0]:
        case "breakpoints":
            session.write("\n".join(str(one) for one in session.points.all) or "no breakpoints")
        case "frame":
            session.where()
        case "locals":
            session.write(formatting.variables(session.scope("Locals")) or "no locals")
        case "statics":
            session.write(formatting.variables(session.scope("Statics")) or "no statics")
        case "registers":
            session.write(formatting.registers(session.scope("Registers")))
        case "sfr":
            session.write(formatting.sfrs(session.client.ask("sfrs")["groups"], rest.strip()))
        case "threads":
            threads_(session, "")


@command("list [LOCATION]", "source around it; without one, on from the last", "l", repeats=True)
def list_(session: Session, text: str) -> None:
    path, first = session.listed
    if text:
        path, line = session.source_of(text)
        first = max(line - LISTED // 2, 1)
    elif not path:
        raise RefusedError("there is no source here")
    frame = session.frames[0] if session.frames else {}
    here = frame.get("line", 0) if frame.get("source", {}).get("path") == path else 0
    session.write(formatting.source(path, first, first + LISTED - 1, here))
    session.listed = path, first + LISTED


@command("time", "cycle, seconds, how far in the past")
def time_(session: Session, _text: str) -> None:
    session.write(session.time())


@command("world", "what is around the machine: the other robots of a trial, at this very time")
def world_(session: Session, _text: str) -> None:
    session.console("/world")


@command("help [COMMAND]", "this", "h", "?")
def help_(session: Session, text: str) -> None:
    wanted = [called(text)] if text else sorted(TABLE, key=lambda one: one.name)
    width = max(len(one.usage) for one in TABLE)
    for one in wanted:
        also = f" ({', '.join(one.aliases)})" if one.aliases else ""
        session.write(f"{one.usage:<{width}}  {one.help}{also}")
    if not text:
        session.write("The beginning of a name is enough; an empty line repeats a step; Ctrl-C stops what runs.")
