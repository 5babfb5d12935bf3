"""Command input, from a terminal with history and completion, or from a script with one command per line."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, Final, TextIO

from emu.host.exit_status import BAD_INPUT, DONE, FAULT
from emu.host.paths import history
from emu.prompt import breakpoint_commands, run_commands, state_commands  # noqa: F401  they fill the table
from emu.prompt.appearance import Style, coloured
from emu.prompt.client import Client, CommandRefusedError, DebugServer, Row
from emu.prompt.command_table import TABLE, Command, find_command
from emu.prompt.session import DebugSession
from emu.prompt.state_commands import TOPICS

if TYPE_CHECKING:
    from prompt_toolkit import PromptSession
    from prompt_toolkit.completion import CompleteEvent, Completion
    from prompt_toolkit.document import Document

    from emu.dap.wire import Channel

LOCATION_COMMANDS: Final = ("break", "tbreak", "until", "list", "log", "disassemble")
"""Commands that take a location as argument."""


class Prompt:
    """Prompt for the server created by `make_server`. `program` is the command's name in error messages."""

    def __init__(self, program: str, make_server: Callable[[Channel], DebugServer], colours: bool = False) -> None:
        self._program: Final = program
        self._column = 0
        self._has_colours: Final = colours
        self.client: Final = Client(make_server, self._print_output)
        self.session: Final = DebugSession(self.client, self._write)

    def serve(self, launch: Row, source: TextIO) -> int:
        """Execute commands until the input ends or the user quits. Return the exit status.

        The status is DONE. For a script it is FAULT if the script ends at a fault, and BAD_INPUT if a command fails.
        """
        at_terminal = source.isatty()
        try:
            self.session.start(launch)
            return self._run_terminal() if at_terminal else self._run_script(source)
        except CommandRefusedError as error:
            print(f"{self._program}: {error}", file=sys.stderr)
            return BAD_INPUT
        finally:
            if not self.client.server.is_over:
                self.session.disconnect(terminate_debuggee=True)
            self.client.server.release()

    def _run_script(self, lines: Iterable[str]) -> int:
        for number, line in enumerate(lines, 1):
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            try:
                execute(self.session, line)
            except CommandRefusedError as error:
                sys.stdout.flush()
                raise CommandRefusedError(f"line {number}, {line.strip()}: {error}") from None
            if self.client.server.is_over:
                return DONE
        return FAULT if self.session.at_fault else DONE

    def _run_terminal(self) -> int:
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
                last = line if execute(self.session, line).repeats else ""
            except CommandRefusedError as error:
                self.session.write(str(error), "fault")
        return DONE

    def _print_output(self, text: str) -> None:
        """Print the firmware's output unchanged."""
        sys.stdout.write(text)
        sys.stdout.flush()
        self._column = 0 if text.endswith("\n") else 1

    def _write(self, text: str, style: Style) -> None:
        shown = coloured(text, style) if self._has_colours else text
        sys.stdout.write("\n" * self._column + shown + "\n")
        sys.stdout.flush()
        self._column = 0


def execute(session: DebugSession, line: str) -> Command:
    """Execute one line and return its command. Raises CommandRefusedError."""
    word, rest = split(line)
    found = find_command(word)
    found.handler(session, rest)
    return found


def split(line: str) -> tuple[str, str]:
    """Split a line into command and arguments. The form `x/8xb buffer` is accepted too."""
    words = line.strip().split(maxsplit=1)
    word, rest = words[0], words[1] if len(words) > 1 else ""
    name, slash, form = word.partition("/")
    return (name, f"/{form} {rest}".strip()) if slash and name else (word, rest)


def candidates(session: DebugSession, text: str) -> Iterator[tuple[str, int, str]]:
    """Yield completions of a line: name, number of trailing characters that it replaces, and kind."""
    word, space, rest = text.lstrip().partition(" ")
    if not space:
        yield from ((one.name, len(word), "command") for one in TABLE if one.name.startswith(word))
        return
    try:
        name = find_command(word.partition("/")[0]).name
    except CommandRefusedError:
        return
    if name == "help":
        yield from ((one.name, len(rest), "command") for one in TABLE if one.name.startswith(rest))
    elif name == "info" and " " not in rest:
        yield from ((topic, len(rest), "topic") for topic in TOPICS if topic.startswith(rest))
    else:
        if name in LOCATION_COMMANDS and " " not in rest:
            names = [one["name"] for one in session.client.ask("loadedSources")["sources"]]
            yield from ((f"{one}:", len(rest), "file") for one in names if one.startswith(rest))
        frame: dict[str, Any] = {"frameId": session.frame["id"]} if session.frame is not None else {}
        for row in session.client.ask("completions", text=rest, column=len(rest) + 1, **frame)["targets"]:
            if name not in LOCATION_COMMANDS or row["type"] == "function":
                yield row["label"], row["length"], row["type"]


def _editor(session: DebugSession) -> PromptSession[str]:
    """Return a line editor with Tab completion. It keeps its history in a file if that file can be written."""
    from prompt_toolkit import PromptSession
    from prompt_toolkit.completion import Completer, Completion
    from prompt_toolkit.history import FileHistory, InMemoryHistory

    class Names(Completer):
        """Completer that queries the session."""

        def get_completions(self, document: Document, complete_event: CompleteEvent) -> Iterator[Completion]:
            for name, replaced, kind in candidates(session, document.text_before_cursor):
                yield Completion(name, -replaced, display_meta=kind)

    path = history()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.open("a").close()
        past_commands: Any = FileHistory(str(path))
    except OSError:
        past_commands = InMemoryHistory()
    return PromptSession(history=past_commands, completer=Names(), complete_while_typing=False)
