"""`arena debug SCENE --robot N`: a debugger on one robot of a trial; the whole world stands with it."""

from __future__ import annotations

import argparse
import socket
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Final

from arena.campaign.campaign import Plan, claimed, open_folder, trial_path
from arena.commands.arguments import count_or_none, port
from arena.commands.run import add_plan, kept, planned
from arena.debug.controlled_robot import GivenUpError
from arena.debug.session import Remote, Session
from arena.trial.manifest import note_host_time
from arena.trial.record import RecordError
from emu.dap.wire import Wire, wire_over
from emu.host.exit_status import DONE
from emu.prompt.reader import Prompt

DESCRIPTION: Final = """\
debug one robot of a trial, the whole world stands with it

A server of the Debug Adapter Protocol on standard input and output, or on a TCP port of this machine (see `emu debug
--help`). Where the robot stops all stand; it steps, goes on and goes back with all others (/world shows them): from
moments that are kept, or by running the trial again up to there. Launch arguments: stopOnEntry, sourceRoots. With
--tui, a prompt here instead (see the same).

With --out the trial is recorded, to the byte as `arena run --trials 1` does it, and cannot be changed by the debugger;
a client that disconnects lets it go on to its end, one that terminates ends it without a record."""
EXAMPLE: Final = "example: arena debug clustering --robot 2 --port 4711    or    arena debug clustering --robot 2 --tui"


def parser() -> argparse.ArgumentParser:
    """Options of the command."""
    made = argparse.ArgumentParser(description=DESCRIPTION, epilog=EXAMPLE)
    add_plan(made)
    made.add_argument("--robot", type=count_or_none, required=True, metavar="N", help="which one, from 0")
    made.add_argument("--port", type=port, metavar="N", help="serve one client on 127.0.0.1:N (0: a free one)")
    made.add_argument("--tui", action="store_true", help="debug in the terminal, or by a script on standard input")
    made.add_argument("--out", type=Path, metavar="FOLDER", help="record the trial there")
    return made


def run(options: argparse.Namespace) -> int:
    """Exit status 0, 1 if something happened to a robot. Raises SceneError, RecordError, LoadError, ValueError."""
    if options.tui and options.port is not None:
        raise ValueError("--port is for editors, --tui is not")
    plan = planned(options, 1)
    if not 0 <= options.robot < plan.scene.robots.count:
        raise ValueError(f"--robot {options.robot}: the scene has robots 0 to {plan.scene.robots.count - 1}")
    if options.out is None:
        with tempfile.TemporaryDirectory() as folder:
            return debugged(plan, Path(folder), options)
    with claimed(options.out):
        if not open_folder(plan, options.out, sys.argv[1:]):
            raise RecordError(f"{options.out}: the trial is there already; choose another --out")
        return debugged(kept(plan, options.out), options.out, options)


def debugged(plan: Plan, folder: Path, options: argparse.Namespace) -> int:
    """Run the trial with a debugger on its robot."""
    session = Session(plan, options.robot, folder, is_recorded=options.out is not None)
    status = DONE
    try:
        if session.is_over:
            print(f"arena debug: robot {options.robot} got no power before the trial was over", file=sys.stderr)
        elif options.tui:
            status = Prompt("arena debug", partial(Remote, session)).serve({}, sys.stdin)
        else:
            served(session, options.port)
        session.finish()
    except GivenUpError:
        told = "nothing is recorded"
        if options.out is not None and session.done is not None:
            recorded(session, folder)
            told = "it was recorded before it went back"
        print(f"arena debug: the trial was ended, {told}", file=sys.stderr)
        return status
    finally:
        session.close()
    if options.out is not None:
        recorded(session, folder)
    return max(status, 1 if session.has_fault else DONE)


def recorded(session: Session, folder: Path) -> None:
    """Tell where, and keep the time it took."""
    assert session.done is not None
    note_host_time(folder, session.done.trial, session.done.host_s, session.done.faults)
    print(f"arena debug: {trial_path(folder, 1)}", file=sys.stderr)


def served(session: Session, port: int | None) -> None:
    """Serve one client."""
    if port is None:
        out, sys.stdout = sys.stdout.buffer, sys.stderr  # nothing else may reach the client
        wire = Wire(sys.stdin.fileno(), out)
        try:
            attend(session, wire)
        finally:
            wire.close()
        return
    with socket.create_server(("127.0.0.1", port)) as listening:
        print(f"arena debug: listening on 127.0.0.1:{listening.getsockname()[1]}", file=sys.stderr, flush=True)
        connection, _ = listening.accept()
    with wire_over(connection) as wire:
        attend(session, wire)


def attend(session: Session, wire: Wire) -> None:
    """Until the client has left; what was wrong with what it sent is told."""
    session.attend(wire)
    if wire.problem:
        print(f"arena debug: the client sent what is no message: {wire.problem}", file=sys.stderr, flush=True)
