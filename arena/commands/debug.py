"""`arena debug SCENE --robot N`: a debugger on one robot of a trial; the whole world stands with it."""

from __future__ import annotations

import argparse
import socket
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any, Final

from arena.campaign import Plan, claimed, open_folder, run_one, trial_path
from arena.commands.arguments import count_or_none, port
from arena.commands.run import add_plan, kept, planned
from arena.debugged import AnewError, Debugged, GivenUpError
from arena.manifest import note_host_time
from arena.record import RecordError
from emu.dap.server import Server
from emu.dap.wire import Wire, wire_over
from emu.machine import Machine
from emu.prompt.reader import Prompt
from emu.status import DONE

OF_ONE_ROBOT: Final = ("board", "selector", "camera", "engine", "strict")
"""Launch arguments that `emu debug` has and a trial has not."""
DESCRIPTION: Final = """\
debug one robot of a trial, the whole world stands with it

A server of the Debug Adapter Protocol on standard input and output, or on a TCP port of this machine (see `emu debug
--help`). Where the robot stops all stand; it steps and goes on with all others, and back by itself: the others follow
when they are looked at (/world) or something is changed, by running the trial again up to there. Launch arguments:
stopOnEntry, sourceRoots. With --tui, a prompt here instead (see the same).

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
    ended: list[int] = []
    debugger = partial(prompted, ended=ended) if options.tui else partial(served, port=options.port)
    robot = Debugged(options.robot, debugger, keeps=options.out is not None)
    is_recorded = False
    while True:
        try:
            done = run_one(plan, 1, folder, meet=robot.meet)
            if options.out is not None and not is_recorded:
                note_host_time(folder, done.trial, done.host_s, done.faults)
                print(f"arena debug: {trial_path(folder, 1)}", file=sys.stderr)
                is_recorded = True
            if not robot.over():
                print(f"arena debug: robot {options.robot} got no power before the trial was over", file=sys.stderr)
        except AnewError:
            continue
        except GivenUpError:
            told = "it was recorded before it went back" if is_recorded else "nothing is recorded"
            print(f"arena debug: the trial was ended, {told}", file=sys.stderr)
            return max(ended, default=DONE)
        return max([1 if done.faults else DONE, *ended])


def prompted(debugged: Debugged, ended: list[int]) -> bool:
    """Debug at a prompt, or by a script; true if the trial is to go on without it. Its exit status goes to `ended`."""
    prompt = Prompt("arena debug", lambda _launch: debugged.machine, debugged.record)
    ended.append(prompt.serve({}, sys.stdin))
    return debugged.keeps and not prompt.ends_all


def served(debugged: Debugged, port: int | None) -> bool:
    """Serve one client; true if the trial is to go on without it."""
    if port is None:
        out, sys.stdout = sys.stdout.buffer, sys.stderr  # nothing else may reach the client
        wire = Wire(sys.stdin.fileno(), out)
        try:
            return _served(debugged, wire)
        finally:
            wire.close()
    with socket.create_server(("127.0.0.1", port)) as listening:
        print(f"arena debug: listening on 127.0.0.1:{listening.getsockname()[1]}", file=sys.stderr, flush=True)
        connection, _ = listening.accept()
    with wire_over(connection) as wire:
        return _served(debugged, wire)


def _served(debugged: Debugged, wire: Wire) -> bool:
    def machine_of(arguments: dict[str, Any]) -> Machine:
        for name in OF_ONE_ROBOT:
            if name in arguments:
                raise ValueError(f"`{name}` is for a robot alone; in a swarm the scene says it: --set KEY=VALUE")
        return debugged.machine

    server = Server(wire, machine_of, debugged.record)
    server.serve()
    if wire.problem:
        print(f"arena debug: the client sent what is no message: {wire.problem}", file=sys.stderr, flush=True)
    return debugged.keeps and not server.ends_all
