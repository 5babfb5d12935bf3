"""`emu debug`: a Debug Adapter Protocol server for editors, or a prompt in the terminal."""

from __future__ import annotations

import argparse
import sys
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

from emu.boards import BOARDS
from emu.commands import kilobot_board
from emu.commands.board_options import add_board_options, board_of, set_up
from emu.host.command import CommandError, Parser, port, seconds
from emu.host.exit_status import BAD_INPUT, DONE
from emu.host.local_server import accept, address_of, listener
from emu.prompt.appearance import COLOUR_CHOICES, has_colours

if TYPE_CHECKING:
    from emu.dap.wire import Wire
    from emu.debug.history import History
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

SCRIPT_SECONDS: Final = Fraction(60)
"""Simulated time after which a script ends."""
DESCRIPTION: Final = """\
Debug firmware from an editor: a server of the Debug Adapter Protocol on standard input and output, on a TCP port of
this machine, or on a Unix socket. Clients of other users are refused (on a port, Linux only). With --tui, debug it in
the terminal: a prompt with completion and history; its command `help` lists
all commands. Without a terminal, standard input is a script with one command per line; the first error ends it. So
does the time limit of 60 simulated seconds, or of --seconds:

    printf 'break add if a == 3\\nrun\\nbacktrace\\n' | emu debug --tui firmware.elf

With --board kilobot, images of avr-gcc with DWARF (-gdwarf-2) on an emulated Kilobot:

    printf 'break set_color\\nrun\\nbacktrace\\n' | emu debug --tui firmware.elf --board kilobot

Launch arguments: program (the ELF file; required), board, selector, camera (a picture), engine, strict, stopOnEntry,
sourceRoots (folders that file names of the program are relative to).

Breakpoints in sources, functions, instructions and data, with conditions, hit counts and log messages; stepping by
line and instruction, forward and back; OpenSwarm's threads; locals, statics, registers, SFRs by bit field; memory;
disassembly. In the console: expressions of C, assignments, and /help.

Exit status: 0 the client, the user or the script has ended the session; 1 the script ended at a firmware fault; 2 bad
input."""


class TimeLimitReached(BaseException):
    """The session has reached its time limit. It is no `Exception`: the server answers those as failed requests."""


def parser() -> Parser:
    made = Parser("debug", DESCRIPTION, "emu debug --port 4711    or    emu debug --tui firmware.elf --selector 3")
    made.add_argument("--port", metavar="N", type=port, help="serve clients one by one on 127.0.0.1:N (0: a free one)")
    made.add_argument(
        "--socket", metavar="PATH", type=Path, help="serve clients one by one on a new Unix socket with mode 0600"
    )
    made.add_argument("--once", action="store_true", help="with --port or --socket: end after the first client")
    made.add_argument("--tui", metavar="IMAGE", help="debug this ELF file in the terminal, with the options below")
    made.add_argument(
        "--seconds", metavar="S", type=seconds, help="with --tui: limit of the simulated time (for a script 60)"
    )
    made.add_argument(
        "--color",
        default="auto",
        choices=COLOUR_CHOICES,
        help="with --tui: colours; auto: at a terminal, unless NO_COLOR is set (default auto)",
    )
    made.add_argument("--engine", default="auto", help="auto, jit or plain (default auto)")
    made.add_argument(
        "--strict",
        action="store_true",
        help="strict mode as for `emu run`: null pointers and uninitialised reads are faults",
    )
    add_board_options(made, (*BOARDS, kilobot_board.BOARD))
    kilobot_board.add_options(made)
    return made


def run(options: argparse.Namespace) -> int:
    """Run the command. Return the exit status as listed in DESCRIPTION."""
    if options.tui is not None:
        return _run_prompt(options)
    from emu.dap.wire import Wire, wire_over

    _refuse_options_of_the_prompt(options)
    if options.port is not None and options.socket is not None:
        raise CommandError("--port and --socket exclude each other")
    place = options.socket if options.port is None else options.port
    if place is None:
        out, sys.stdout = sys.stdout.buffer, sys.stderr  # only protocol messages may reach the client
        wire = Wire(sys.stdin.fileno(), out)
        try:
            return _serve(wire)
        finally:
            wire.close()
    with listener(place) as server:
        print(f"emu debug: listening on {address_of(server)}", file=sys.stderr, flush=True)
        while True:
            with wire_over(accept(server, "emu debug")) as wire:
                status = _serve(wire)
            if options.once:
                return status


def _run_prompt(options: argparse.Namespace) -> int:
    import emu
    from emu.dap.server import Server
    from emu.prompt.reader import Prompt

    if options.port is not None or options.socket is not None or options.once:
        raise CommandError("--port, --socket and --once cannot be used with --tui")
    if options.board == kilobot_board.BOARD:
        machine = cast("Machine", kilobot_board.debugged(options, parser()))
    else:
        kilobot_board.refuse_options(options)
        machine = emu.load(options.tui, board=board_of(options), engine=options.engine, strict=options.strict)
        set_up(machine, options)
    limit = options.seconds or (None if sys.stdin.isatty() else SCRIPT_SECONDS)
    if limit is not None:
        _limit_time(machine, limit)
    try:
        colours = has_colours(options.color)
        prompt = Prompt("emu debug", lambda client: Server(client, lambda _launch: machine, _record), colours)
        return prompt.serve({}, sys.stdin)
    except TimeLimitReached as error:
        sys.stdout.flush()
        raise CommandError(str(error)) from None


def _limit_time(machine: Machine, limit: Fraction) -> None:
    """Make every run and step that reaches a simulated time raise TimeLimitReached."""
    last = machine.cycles_in(limit)
    advance, step = machine.advance, machine.step

    def check() -> None:
        if machine.cycle >= last:
            raise TimeLimitReached(f"the limit of {float(limit):g} simulated seconds is reached (--seconds)")

    def limited_advance(cycle: int) -> Stop | None:
        check()
        stop = advance(min(cycle, last))
        if stop is None:
            check()
        return stop

    def limited_step(cycle: int | None = None) -> Stop | None:
        check()
        return step(cycle)

    vars(machine).update(advance=limited_advance, step=limited_step)


def _refuse_options_of_the_prompt(options: argparse.Namespace) -> None:
    """Raise CommandError for a command-line option that an editor sets in its launch configuration."""
    made = parser()
    for name in ("color", "engine", "strict", "seconds", "board", "crystal", "selector", "camera", "sensor", "stimulus",
                 *kilobot_board.OWN):  # fmt: skip
        if getattr(options, name) != made.get_default(name):
            raise CommandError(f"--{name} needs --tui; for an editor, set `{name}` in the launch configuration")


def _serve(wire: Wire) -> int:
    """Serve one debugger client. Return the exit status."""
    from emu.dap.server import Server

    Server(wire, machine_of, _record).serve()
    if wire.problem:
        print(f"emu debug: invalid message from the client: {wire.problem}", file=sys.stderr, flush=True)
    return BAD_INPUT if wire.problem else DONE


def _record(machine: Machine) -> History:
    """Return a new recording of a machine."""
    from emu.debug.avr.history import KilobotHistory
    from emu.debug.avr.machine import DebuggedKilobot
    from emu.debug.history import History

    return KilobotHistory(machine) if isinstance(machine, DebuggedKilobot) else History(machine)


def machine_of(arguments: dict[str, Any]) -> Machine:
    """Return a machine for the launch arguments. Raises ValueError."""
    import emu

    program = arguments.get("program")
    if not program:
        raise ValueError("launch needs `program`, the path of an ELF file")
    board: Any = arguments.get("board", BOARDS[0])
    if board == kilobot_board.BOARD:
        other = [name for name in ("selector", "camera", "engine", "strict") if arguments.get(name)]
        if other:
            raise ValueError(f"`{other[0]}` does not apply to the board {board}")
        return cast("Machine", kilobot_board.debugged_image(program))
    if board == BOARDS[0]:
        from emu.boards.epuck.board import Epuck

        board = partial(Epuck, selector=arguments.get("selector", 0))
    elif alone := [name for name in ("selector", "camera") if name in arguments]:
        raise ValueError(f"`{alone[0]}` needs the board {BOARDS[0]}, not {board}")
    machine = emu.load(
        program, board=board, engine=arguments.get("engine", "auto"), strict=arguments.get("strict", False)
    )
    if arguments.get("camera"):
        from emu.boards.picture import read_picture

        machine.board.camera.show(read_picture(arguments["camera"]))
    return machine
