"""`arena debug SCENE --robot N`: debug one robot of a trial; the whole world pauses with it."""

from __future__ import annotations

import argparse
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Final

from arena.campaign.campaign import Plan, locked_folder, open_folder, trial_path
from arena.commands.options.arguments import count_or_none, port
from arena.commands.options.plan import add_plan, copy_inputs, plan_from
from arena.debug.controlled_robot import TrialAbortedError
from arena.debug.trial_client import DebugSession, RemoteServer
from arena.trial.manifest import note_host_time
from arena.trial.record import RecordError
from emu.dap.wire import Wire, wire_over
from emu.host.errors import CommandParser
from emu.host.exit_status import DONE
from emu.host.local_server import accept, address_of, listener
from emu.prompt.appearance import has_colours
from emu.prompt.reader import Prompt

DESCRIPTION: Final = """\
debug one robot of a trial; the whole world pauses with it

Serves the Debug Adapter Protocol on standard input and output, or on a TCP port or a Unix socket of this machine
(see `emu debug --help`). When the robot stops, the whole world pauses. All robots step, continue and rewind
together; /world shows their state. A rewind resumes a checkpoint, or runs the trial again from its seed. Launch
arguments: stopOnEntry, sourceRoots. With --tui, the debugger has a prompt in the terminal instead.

With --out the trial is recorded, equal to the byte to `arena run --trials 1`, and the debugger cannot change it. After
`disconnect` the trial continues to its end; `terminate` ends it without a record."""
EXAMPLE: Final = "example: arena debug clustering --robot 2 --port 4711    or    arena debug clustering --robot 2 --tui"


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = CommandParser(description=DESCRIPTION, epilog=EXAMPLE)
    add_plan(command)
    command.add_argument("--robot", type=count_or_none, required=True, metavar="N", help="number of the robot, from 0")
    command.add_argument("--port", type=port, metavar="N", help="serve one client on 127.0.0.1:N (0: any free port)")
    command.add_argument("--socket", type=Path, metavar="PATH", help="serve one client on a new Unix socket, mode 0600")
    command.add_argument("--tui", action="store_true", help="debug at a prompt, or with a script on standard input")
    command.add_argument("--out", type=Path, metavar="FOLDER", help="record the trial in this folder")
    return command


def run(options: argparse.Namespace) -> int:
    """Run the trial with the debugger; exit status 1 if a robot had a fault.

    Raises SceneError, RecordError, LoadError, ValueError."""
    if sum([options.tui, options.port is not None, options.socket is not None]) > 1:
        raise ValueError("--port, --socket and --tui exclude each other")
    plan = plan_from(options, 1)
    if not 0 <= options.robot < plan.scene.robots.count:
        raise ValueError(f"--robot {options.robot}: the scene has robots 0 to {plan.scene.robots.count - 1}")
    if options.out is None:
        with tempfile.TemporaryDirectory() as folder:
            return debug_trial(plan, Path(folder), options)
    with locked_folder(options.out):
        if not open_folder(plan, options.out, sys.argv[1:]):
            raise RecordError(f"{options.out}: already contains the trial; choose another --out")
        return debug_trial(copy_inputs(plan, options.out), options.out, options)


def debug_trial(plan: Plan, folder: Path, options: argparse.Namespace) -> int:
    """Run the trial with a debugger on one robot; return the exit status."""
    session = DebugSession(plan, options.robot, folder, is_recorded=options.out is not None)
    status = DONE
    try:
        if session.is_over:
            print(
                f"arena debug: robot {options.robot} was not switched on before the end of the trial", file=sys.stderr
            )
        elif options.tui:
            prompt = Prompt("arena debug", partial(RemoteServer, session), has_colours("auto"))
            status = prompt.serve({}, sys.stdin)
        else:
            serve_client(session, options.socket if options.port is None else options.port)
        session.finish()
    except TrialAbortedError:
        outcome = "no record was written"
        if options.out is not None and session.finished is not None:
            report_record(session, folder)
            outcome = "it had been recorded before the last rewind"
        print(f"arena debug: the trial was ended; {outcome}", file=sys.stderr)
        return status
    finally:
        session.close()
    if options.out is not None:
        report_record(session, folder)
    return max(status, 1 if session.has_fault else DONE)


def report_record(session: DebugSession, folder: Path) -> None:
    """Print the path of the record, and store the host time in the manifest."""
    assert session.finished is not None
    note_host_time(folder, session.finished.trial, session.finished.host_s, session.finished.faults)
    print(f"arena debug: {trial_path(folder, 1)}", file=sys.stderr)


def serve_client(session: DebugSession, place: int | Path | None) -> None:
    """Serve one client on a port or a Unix socket, or on standard input and output if `place` is None."""
    if place is None:
        out, sys.stdout = sys.stdout.buffer, sys.stderr  # only protocol messages may reach the client
        wire = Wire(sys.stdin.fileno(), out)
        try:
            relay(session, wire)
        finally:
            wire.close()
        return
    with listener(place) as server:
        print(f"arena debug: listening on {address_of(server)}", file=sys.stderr, flush=True)
        connection = accept(server, "arena debug")
    with wire_over(connection) as wire:
        relay(session, wire)


def relay(session: DebugSession, wire: Wire) -> None:
    """Relay messages until the client disconnects; report a malformed message."""
    session.relay(wire)
    if wire.problem:
        print(f"arena debug: malformed message from the client: {wire.problem}", file=sys.stderr, flush=True)
