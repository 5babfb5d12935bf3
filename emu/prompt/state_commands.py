"""Commands that show or change the paused machine's state."""

from __future__ import annotations

import re
from typing import Final

from emu.prompt import formatting
from emu.prompt.client import CommandRefusedError
from emu.prompt.command_table import TABLE, command, find_command
from emu.prompt.session import LISTING_LINES, DebugSession

FORMAT: Final = re.compile(r"/(\d*)([a-z]*)(?:\s+|$)(.*)", re.DOTALL)
SIZES: Final = {"b": 1, "h": 2, "w": 4}
STRING_BYTES: Final = 256
TOPICS: Final = {
    "breakpoints": "all breakpoints by number",
    "frame": "location of the selected frame",
    "locals": "parameters and locals of the selected frame",
    "registers": "working registers, PC and flags of the selected frame",
    "sfr": "[PATTERN]: registers by name or peripheral, with fields",
    "statics": "static variables of the file",
    "threads": "threads of OpenSwarm with stack use",
}


def _formatted(text: str) -> tuple[int, str, str]:
    """Split `/COUNTLETTERS REST` and return count, letters and rest."""
    match = FORMAT.fullmatch(text)
    return (int(match[1] or 1), match[2], match[3].strip()) if match is not None else (1, "", text)


@command("backtrace", "show the call stack, through interrupts", "bt", "where")
def backtrace_(session: DebugSession, _text: str) -> None:
    session.write(formatting.backtrace(session.frames, session.at))


@command("frame [N]", "select the Nth frame of the call stack", "f")
def frame_(session: DebugSession, text: str) -> None:
    if text:
        if not text.isdecimal() or int(text) >= len(session.frames):
            raise CommandRefusedError(f"the frames are 0 to {len(session.frames) - 1}, not {text}")
        session.at = int(text)
    session.show_location()


@command("up", "select the caller", repeats=True)
def up_(session: DebugSession, _text: str) -> None:
    frame_(session, str(session.at + 1))


@command("down", "select the called function", repeats=True)
def down_(session: DebugSession, _text: str) -> None:
    if not session.at:
        raise CommandRefusedError("this is the innermost frame")
    frame_(session, str(session.at - 1))


@command("threads", "show the threads of OpenSwarm with stack use")
def threads_(session: DebugSession, _text: str) -> None:
    session.run_console_command("/threads")


@command("thread PID", "select another thread and show its call stack")
def thread_(session: DebugSession, text: str) -> None:
    threads = {one["name"].partition(" ")[0]: one["id"] for one in session.client.ask("threads")["threads"]}
    if text not in threads:
        raise CommandRefusedError(f"there is no thread {text or 'without a PID'}: {', '.join(threads)}")
    session.select(threads[text])
    backtrace_(session, "")


@command("print[/x|d|u|t|c] EXPRESSION", "show the value of a C expression", "p")
def print_(session: DebugSession, text: str) -> None:
    _, form, expression = _formatted(text)
    if form and (len(form) > 1 or form not in formatting.FORMATS):
        raise CommandRefusedError(f"the formats are /{' /'.join(formatting.FORMATS)}, not /{form}")
    found = session.evaluate(expression)["result"]
    session.write(f"{expression} = {formatting.number(found, form) if form else found}")


@command("set PLACE = EXPRESSION", "assign to a variable, a register, an SFR or its field")
def set_(session: DebugSession, text: str) -> None:
    text = text.removeprefix("var ")
    if not re.search(r"[^=!<>]=[^=]", text):
        raise CommandRefusedError("expected PLACE = EXPRESSION")
    frame = {"frameId": session.frame["id"]} if session.frame is not None else {}
    found = session.client.ask("evaluate", expression=text, context="repl", **frame)
    session.write(f"{text.partition('=')[0].strip()} = {found['result']}")


@command("x[/COUNT FORMAT SIZE] ADDRESS", "show memory: x/8xb &buffer; sizes b h w, formats x d u t c a s, i for code",
         repeats=True)  # fmt: skip
def x_(session: DebugSession, text: str) -> None:
    count, letters, expression = _formatted(text)
    forms, sizes = letters.strip("bhw"), [one for one in letters if one in SIZES]
    if len(forms) > 1 or (forms and forms not in f"{formatting.FORMATS}si") or len(sizes) > 1:
        raise CommandRefusedError(f"/{letters} is no format: one of {formatting.FORMATS}si and one of bhw")
    if forms == "i":
        _instructions(session, session.number(expression), count)
        return
    size = SIZES[sizes[0]] if sizes else 1 if forms in ("c", "s") and forms else 2
    address = session.number(expression)
    requested = STRING_BYTES if forms == "s" else count * size
    found = session.client.ask("readMemory", memoryReference=f"{address:#06x}", count=requested)
    session.write(formatting.memory(found, size, forms or "x"))


def _instructions(session: DebugSession, address: int, count: int) -> None:
    rows = session.client.ask(
        "disassemble", memoryReference=f"{address:#08x}", instructionCount=count, resolveSymbols=True
    )["instructions"]
    session.write_code(formatting.disassembly(rows, session.number("PC")))


@command("disassemble [FUNCTION|ADDRESS [COUNT]]", "show instructions with their source lines", "dis")
def disassemble_(session: DebugSession, text: str) -> None:
    words = text.rsplit(maxsplit=1)
    count = int(words.pop()) if len(words) == 2 and words[1].isdecimal() else LISTING_LINES
    _instructions(session, session.number(words[0].removeprefix("*") if words else "PC"), count)


@command("info TOPIC", "show one of " + ", ".join(TOPICS), "i")
def info_(session: DebugSession, text: str) -> None:
    word, _, rest = text.partition(" ")
    found = [one for one in TOPICS if word and one.startswith(word)]
    if len(found) != 1:
        raise CommandRefusedError("info " + "; ".join(f"{name}: {text}" for name, text in TOPICS.items()))
    match found[0]:
        case "breakpoints":
            session.write("\n".join(str(one) for one in session.breakpoints.all) or "no breakpoints")
        case "frame":
            session.show_location()
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


@command("list [LOCATION]", "show source around LOCATION, or continue the last listing", "l", repeats=True)
def list_(session: DebugSession, text: str) -> None:
    path, first = session.list_position
    if text:
        path, line = session.source_location(text)
        first = max(line - LISTING_LINES // 2, 1)
    elif not path:
        raise CommandRefusedError("there is no source here")
    frame = session.frames[0] if session.frames else {}
    here = frame.get("line", 0) if frame.get("source", {}).get("path") == path else 0
    session.write_code(formatting.source(path, first, first + LISTING_LINES - 1, here))
    session.list_position = path, first + LISTING_LINES


@command("time", "show cycle, seconds, and the distance to the present")
def time_(session: DebugSession, _text: str) -> None:
    session.write(session.time())


@command("world", "show the state of the trial around the robot")
def world_(session: DebugSession, _text: str) -> None:
    session.run_console_command("/world")


@command("help [COMMAND]", "show commands", "h", "?")
def help_(session: DebugSession, text: str) -> None:
    requested = [find_command(text)] if text else sorted(TABLE, key=lambda one: one.name)
    width = max(len(one.usage) for one in TABLE)
    for one in requested:
        also = f" ({', '.join(one.aliases)})" if one.aliases else ""
        session.write(f"{one.usage:<{width}}  {one.help}{also}", indent=width + 2)
    if not text:
        session.write("Names may be abbreviated. An empty line repeats a step. Ctrl-C pauses a running machine.")
