"""Run of one Kilobot for `emu run --board kilobot`: image, overhead controller, reports, and the end of the run."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Final

from emu.avr.image import AvrImage, load_avr_image
from emu.avr.machine import HZ, Atmega328p, AvrFault
from emu.boards.kilobot.observer import WATCHED, KilobotObserver, Report
from emu.boards.kilobot.single import SingleKilobot
from emu.boards.kilobot.swarm import KilobotFaultError

CHUNK: Final = HZ // 10
"""Ticks after which outputs are reported."""


@dataclass
class KilobotRun:
    """Result of a run. `reason`: limit, halt, fault or interrupted. Addresses are byte addresses of flash."""

    image: AvrImage
    reason: str
    pc: int
    cycles: int
    host_seconds: float
    fault: AvrFault | None = None
    notes: list[str] = field(default_factory=list)
    reports: list[Report] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        """Return the simulated time in seconds."""
        return self.cycles / HZ

    def facts(self) -> dict[str, Any]:
        """Return the result as data."""
        symbols = self.image.symbols
        line = self.image.lines.find(self.pc)
        facts: dict[str, Any] = {
            "reason": self.reason, "pc": self.pc, "symbol": symbols.text(self.pc) if symbols.code(self.pc) else None,
            "line": str(line) if line else None, "cycles": self.cycles, "seconds": self.seconds,
            "host_seconds": self.host_seconds,
            "speed": self.seconds / self.host_seconds if self.host_seconds else None, "engine": "avr",
        }  # fmt: skip
        if self.fault is not None:
            facts["fault"] = {"message": self.fault.message, "pc": self.fault.pc, "cycle": self.fault.cycle}
        kinds: dict[str, list[dict[str, Any]]] = {"led": [], "motors": [], "message": [], "uart": [], "reset": []}
        for report in self.reports:
            kinds[report.kind].append({"seconds": report.seconds, **report.content})
        return facts | kinds


def run_kilobot(
    path: str, *, seconds: float | None, cycles: int | None, command: str, uid: int, show: bool
) -> KilobotRun:
    """Run an image on one Kilobot until it halts, faults or reaches a limit; Ctrl-C ends it, too.

    `seconds`, `cycles`: limit of simulated time, None: none. `command`: what the overhead controller sends, "none" or a
    key of TYPES. `uid`: 0 to 65535. `show`: print reports as they come. Raises LoadError.
    """
    limit = cycles if seconds is None else max(1, int(seconds * HZ))
    image = load_avr_image(path)
    robot, observer = SingleKilobot(image, uid=uid, command=command), KilobotObserver()
    swarm, machine = robot.swarm, robot.machine
    machine.watch(WATCHED)
    run = KilobotRun(image, "limit", 0, 0, 0.0)
    start = time.perf_counter()
    try:
        while limit is None or swarm.now < limit:
            robot.run_until(swarm.now + CHUNK if limit is None else min(swarm.now + CHUNK, limit))
            _report(run, observer.reports_of(machine.changes), show)
            machine.changes.clear()
            _report(run, observer.settled_states(machine.cycle), show)
            if machine.state.halted and robot.next_command is None:
                run.reason = "halt"
                break
    except KilobotFaultError:
        run.reason, run.fault = "fault", machine.fault
        _report(run, observer.reports_of(machine.changes), show)
    except KeyboardInterrupt:
        run.reason = "interrupted"
    _report(run, observer.final_reports(), show)
    run.notes += _notes(machine)
    run.host_seconds = time.perf_counter() - start
    run.pc = machine.pc if run.fault is None else run.fault.pc
    run.cycles = machine.state.halted_at if run.reason == "halt" else machine.cycle
    return run


def _notes(machine: Atmega328p) -> list[str]:
    """Return notes for the user about a run: registers without a model, a stack overflow, the call before a fault."""
    notes = []
    if machine.state.unmodelled:
        notes.append(f"register {machine.state.unmodelled:#04x} has no model; it behaves as plain memory")
    if machine.stack_overflow is not None:
        pc, cycle = machine.stack_overflow
        notes.append(f"stack overflow: at {machine.image.place(pc)}, cycle {cycle}, the stack grew into the program's"
                     f" variables, which end at {machine.state.data_end:#06x}")  # fmt: skip
    caller = machine.caller() if machine.fault is not None else None
    if caller is not None:
        notes.append(f"the stack's uppermost return address belongs to the call at {machine.image.place(caller)}")
    return notes


def _report(run: KilobotRun, reports: Iterable[Report], show: bool) -> None:
    """Add reports to the result; with `show`, also print them."""
    for report in reports:
        run.reports.append(report)
        if show:
            print(report, flush=True)
