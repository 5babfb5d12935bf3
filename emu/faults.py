"""Why a run ended badly, in words: resets the core asked for, and traps or interrupts nobody handles.

What enters: a machine that stopped, its image. What leaves: a `Fault`, or None when the firmware simply ended. A trap
that is handled is none, unless the firmware never comes back from it but goes to sleep inside; a kernel that stops
itself is one. An unhandled exception is seen as its vector's handler being a debugger word: both XC16's linker and ours
put one into vectors without a function (abi-elf.md §3.3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from emu.chips.chip import Vector
from emu.dspic30f.state import IPL3, STACK_POINTER
from emu.image import Image

if TYPE_CHECKING:
    from emu.machine import Machine, Stop

TRAP_FLAGS: Final = {
    "OSCFAIL": "oscillator failure trap",
    "ADDRERR": "address error trap (odd address, nothing there, or wild jump)",
    "STKERR": "stack error trap (W15 above SPLIM or below RAM)",
    "MATHERR": "math error trap (division by zero, accumulator overflow, bad shift)",
}
"""Flags of INTCON1 by falling priority (isa.md §14.4) and what to call them."""
VECNUM: Final = 0x3F
"""Field of INTTREG: slot of the exception entered last (isa.md §14.4)."""
RETURN_BYTES: Final = 4
"""What an exception pushes (isa.md §14.2)."""
STOP_FUNCTION: Final = "_hal_stop"
"""Where OpenSwarm goes to sleep after a failed assertion or a fatal trap (firmware/openswarm/hal/hal_cpu.h)."""


@dataclass(frozen=True, slots=True)
class Fault:
    """What went wrong and where. `pc` is the culprit, as well as the hardware lets one know."""

    cause: str
    pc: int
    cycle: int


def fault_of(machine: Machine, image: Image, stop: Stop) -> Fault | None:
    """The fault behind `stop`, None if it is none."""
    if stop.reason == "fault":
        return Fault(stop.detail, stop.pc, stop.cycle)
    if machine.is_asleep and machine.peek("CORCON") & IPL3:
        name = machine.chip.vectors[machine.peek("INTTREG") & VECNUM].name
        return Fault(f"{name} trap, in whose handler the firmware went to sleep,", stop.pc, stop.cycle)
    if stop.reason == "halt":
        inside = image.symbols.code(stop.pc)
        if inside is not None and inside[0].name == STOP_FUNCTION:
            return Fault("the kernel stopped the system; UART1 said why", stop.pc, stop.cycle)
    if stop.reason != "breakpoint":
        return None
    vectors = [vector for vector in image.chip.vectors if stop.pc in (image.word(vector.ivt), image.word(vector.aivt))]
    if not vectors:
        return None
    return _unhandled(machine, vectors, stop)


def _unhandled(machine: Machine, vectors: list[Vector], stop: Stop) -> Fault | None:
    """The exception that led to the shared default handler, told by flags; None if the code was merely called."""
    back = _return_address(machine) or stop.pc
    if machine.peek("CORCON") & IPL3:
        words = _trap(machine)
        # Only a division stacks its own address; the others stack what follows (isa.md §14.4).
        culprit = back if words == TRAP_FLAGS["MATHERR"] or back == stop.pc else back - 2
        return Fault(f"{words or 'trap'}, no handler,", culprit, stop.cycle)
    for vector in vectors:
        if vector.irq in machine.chip.interrupts and _is_pending(machine, vector.irq):
            return Fault(f"{vector.name}, no handler,", back, stop.cycle)
    return None


def _trap(machine: Machine) -> str:
    """What the flags of INTCON1 say, empty if none is set."""
    intcon1 = machine.peek("INTCON1")
    fields = machine.chip.sfrs["INTCON1"].fields
    return next((words for flag, words in TRAP_FLAGS.items() if intcon1 >> fields[flag][0] & 1), "")


def _return_address(machine: Machine) -> int:
    """What the exception pushed last, 0 if the stack pointer was not in RAM."""
    ram = machine.chip.data["ram"]
    place = machine.w[STACK_POINTER] - RETURN_BYTES
    if place not in ram or place + RETURN_BYTES > ram.end:
        return 0
    return (machine.peek(place + 2) & 0x7F) << 16 | machine.peek(place) & 0xFFFE


def _is_pending(machine: Machine, irq: int | None) -> bool:
    """Whether flag and enable of an interrupt are set."""
    assert irq is not None
    source = machine.chip.interrupts[irq]
    return all(machine.peek(register) >> bit & 1 for register, bit in (source.flag, source.enable))
