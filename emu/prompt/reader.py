"""Where commands come from: a terminal with history and completion, or a script, one command a line."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, Final, TextIO

from emu.host.exit_status import BAD_INPUT, DONE, FAULT
from emu.host.paths import history
from emu.prompt import breakpoint_commands, run_commands, state_commands  # noqa: F401  they fill the table
from emu.prompt.client import Answering, Client, RefusedError, Row
from emu.prompt.session import Session
from emu.prompt.state_commands import TOPICS
from emu.prompt.table import TABLE, Command, called

if TYPE_CHECKING:
    from prompt_toolkit import PromptSession
    from prompt_toolkit.completion import CompleteEvent, Completion
    from prompt_toolkit.document import Document

    from emu.dap.wire import Channel

PLACES: Final = ("break", "tbreak", "until", "list", "log", "disassemble")
"""Commands that take a location."""


class Prompt:
    """Debugs by what `serving` makes to the end. `program` is how the command line is called."""

    def __init__(self, program: str, serving: Callable[[Channel], Answering]) -> None:
        self._program: Final = program
        self._column = 0
        self.client: Final = Client(serving, self._said)
        self.session: Final = Session(self.client, self._write)

    def serve(self, launch: Row, source: TextIO) -> int:
        """Exit status: DONE; of a script also FAULT if it ends at a fault, BAD_INPUT if a command failed."""
        at_terminal = source.isatty()
        try:
            self.session.start(launch)
            return self._by_hand() if at_terminal else self._by_script(source)
        except RefusedError as error:
            print(f"{self._program}: {error}", file=sys.stderr)
            return BAD_INPUT
        finally:
            if not self.client.server.is_over:
                self.session.leave(ends_all=True)
            self.client.server.leave()

    def _by_script(self, lines: Iterable[str]) -> int:
        for number, line in enumerate(lines, 1):
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            try:
                carry_out(self.session, line)
            except RefusedError as error:
                sys.stdout.flush()
                raise RefusedError(f"line {number}, {line.strip()}: {error}") from None
            if self.client.server.is_over:
                return DONE
        return FAULT if self.session.at_fault else DONE

    def _by_hand(self) -> int:
        editor = _editor(self.session)
        last = ""
        while not self.client.server.is_over:
            try:
                line = editor.prompt("(emu) ").strip() or last
            except KeyboardInterrupt:
                continue
            except EOFError:
                return DONE
            last = ""
            if not line:
                continue
            try:
                last = line if carry_out(self.session, line).repeats else ""
            except RefusedError as error:
                self._write(str(error))
        return DONE

    def _said(self, text: str) -> None:
        """What the firmware says comes as it is."""
        sys.stdout.write(text)
        sys.stdout.flush()
        self._column = 0 if text.endswith("\n") else 1

    def _write(self, text: str) -> None:
        sys.stdout.write("\n" * self._column + text + "\n")
        sys.stdout.flush()
        self._column = 0


def carry_out(session: Session, line: str) -> Command:
    """Do what one line says. Raises RefusedError."""
    word, rest = split(line)
    found = called(word)
    found.do(session, rest)
    return found


def split(line: str) -> tuple[str, str]:
    """A command and what follows, also in `x/8xb buffer`."""
    words = line.strip().split(maxsplit=1)
    word, rest = words[0], words[1] if len(words) > 1 else ""
    name, slash, form = word.partition("/")
    return (name, f"/{form} {rest}".strip()) if slash and name else (word, rest)


def candidates(session: Session, text: str) -> Iterator[tuple[str, int, str]]:
    """What a line may go on with: a name, how many of the last letters it replaces, its kind."""
    word, space, rest = text.lstrip().partition(" ")
    if not space:
        yield from ((one.name, len(word), "command") for one in TABLE if one.name.startswith(word))
        return
    try:
        name = called(word.partition("/")[0]).name
    except RefusedError:
        return
    if name == "help":
        yield from ((one.name, len(rest), "command") for one in TABLE if one.name.startswith(rest))
    elif name == "info" and " " not in rest:
        yield from ((topic, len(rest), "topic") for topic in TOPICS if topic.startswith(rest))
    else:
        if name in PLACES and " " not in rest:
            names = [one["name"] for one in session.client.ask("loadedSources")["sources"]]
            yield from ((f"{one}:", len(rest), "file") for one in names if one.startswith(rest))
        frame: dict[str, Any] = {"frameId": session.frame["id"]} if session.frame is not None else {}
        for row in session.client.ask("completions", text=rest, column=len(rest) + 1, **frame)["targets"]:
            if name not in PLACES or row["type"] == "function":
                yield row["label"], row["length"], row["type"]


def _editor(session: Session) -> PromptSession[str]:
    """A line editor with completion by Tab and the history of earlier sessions, if there is a place for it."""
    from prompt_toolkit import PromptSession
    from prompt_toolkit.completion import Completer, Completion
    from prompt_toolkit.history import FileHistory, InMemoryHistory

    class Names(Completer):
        """Asks the session."""

        def get_completions(self, document: Document, complete_event: CompleteEvent) -> Iterator[Completion]:
            for name, replaced, kind in candidates(session, document.text_before_cursor):
                yield Completion(name, -replaced, display_meta=kind)

    path = history()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.open("a").close()
        kept: Any = FileHistory(str(path))
    except OSError:
        kept = InMemoryHistory()
    return PromptSession(history=kept, completer=Names(), complete_while_typing=False)
