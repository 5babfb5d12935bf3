"""Faults of an ATmega328P's firmware as stops and reports."""

from __future__ import annotations

from typing import TYPE_CHECKING

from emu.machine.fault import FaultReport
from emu.machine.stops import Stop

if TYPE_CHECKING:
    from emu.avr.machine import Atmega328p


def fault_stop(machine: Atmega328p) -> Stop:
    """Return the stop of a machine at a fault, with function and line. Raises ValueError if there is no fault."""
    fault, image = machine.fault, machine.image
    if fault is None:
        raise ValueError("the machine is not at a fault")
    symbol = image.symbols.text(fault.pc) if image.symbols.code(fault.pc) else None
    line = image.lines.find(fault.pc)
    report = FaultReport(
        fault.message, fault.pc, fault.cycle, image.place(fault.pc), symbol, str(line) if line else None
    )
    return Stop("fault", fault.pc, fault.cycle, fault.message, report)
