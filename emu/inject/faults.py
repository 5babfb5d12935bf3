"""Faults: random choice of kind, time and location; injection at an instruction boundary.

ram       a bit of RAM flips                          register  a bit of W0 to W15 flips
flash     a bit of an instruction flips permanently     skip      an instruction is not executed
uart      the next byte queued for UART1 or 2 is lost
sensor    an infrared sensor of the robot is stuck at one distance
brownout  reset by BOR, with some bits of RAM flipped
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from emu.debug.inspector import Inspector
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.state.state import NOT_REPEATING

if TYPE_CHECKING:
    from emu.image.model import Image
    from emu.machine.machine import Machine

KINDS: Final = ("ram", "register", "flash", "skip", "uart", "sensor", "brownout")
REGISTERS: Final = 16
WORD_BITS, BYTE_BITS, CODE_BITS, SENSORS = 16, 8, 24, 8
NEAREST_MM, FURTHEST_MM = 5.0, 100.0
MOST_LOST: Final = 32
"""Maximum number of RAM bits that a brown-out changes."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault, injected at the first instruction boundary at or after `cycle`."""

    number: int
    kind: str
    cycle: int
    place: int
    """Location: data address, register, program address, UART, sensor; number of bits for a brown-out; 0 for a skip."""
    value: int
    """Detail: bit number, distance in tenths of a mm, or the seed that selects a brown-out's bits."""


def choose_fault(number: int, seed: int, shares: Mapping[str, int], image: Image, first: int, last: int) -> Fault:
    """Choose fault `number` of a campaign in cycles `first` to `last`. It depends only on the seed and the number."""
    rng = random.Random(f"{seed}:{number}")
    kind = rng.choices(KINDS, [shares[kind] for kind in KINDS])[0]
    cycle = rng.randrange(first, last)
    ram = image.chip.data["ram"]
    if kind == "ram":
        return Fault(number, kind, cycle, rng.randrange(ram.start, ram.end), rng.randrange(BYTE_BITS))
    if kind == "register":
        return Fault(number, kind, cycle, rng.randrange(REGISTERS), rng.randrange(WORD_BITS))
    if kind == "flash":
        blocks = [block for block in image.blocks if block.is_code]
        block = rng.choices(blocks, [block.end - block.base for block in blocks])[0]
        return Fault(number, kind, cycle, rng.randrange(block.base, block.end, 2), rng.randrange(CODE_BITS))
    if kind == "uart":
        return Fault(number, kind, cycle, rng.choice((1, 2)), 0)
    if kind == "sensor":
        return Fault(number, kind, cycle, rng.randrange(SENSORS), rng.randrange(int(10 * FURTHEST_MM)))
    if kind == "brownout":
        return Fault(number, kind, cycle, rng.randrange(MOST_LOST + 1), rng.getrandbits(32))
    return Fault(number, kind, cycle, 0, 0)


def inject_fault(fault: Fault, machine: Machine) -> str:
    """Inject a fault into `machine` and return a description."""
    if fault.kind == "ram":
        machine.poke(fault.place, machine.peek(fault.place, 1) ^ 1 << fault.value, 1)
        return f"bit {fault.value} at {fault.place:#06x}{_variable(machine, fault.place)}"
    if fault.kind == "register":
        machine.w[fault.place] ^= 1 << fault.value
        return f"bit {fault.value} of W{fault.place}"
    if fault.kind == "flash":
        machine.program.put(fault.place, machine.program.word(fault.place) ^ 1 << fault.value)
        return f"bit {fault.value} of the instruction at {Inspector(machine).where(fault.place)}"
    if fault.kind == "skip":
        return _skip(machine)
    if fault.kind == "uart":
        dropped = machine.uart[fault.place].drop_next_frame()
        return f"a byte for UART{fault.place}" if dropped else f"no byte for UART{fault.place} was queued"
    if fault.kind == "sensor":
        distance = NEAREST_MM + fault.value / 10
        machine.board.ir.set_distances([(fault.place, distance, 1.0)])
        return f"sensor {fault.place} at {distance:g} mm"
    ram, rng = machine.chip.data["ram"], random.Random(fault.value)
    machine.reset("BOR")
    for _ in range(fault.place):
        at = rng.randrange(ram.start, ram.end)
        machine.poke(at, machine.peek(at, 1) ^ 1 << rng.randrange(BYTE_BITS), 1)
    return f"{fault.place} bits of RAM lost"


def _skip(machine: Machine) -> str:
    """Skip the next instruction. In a sleeping CPU, skip the second one after the wake-up."""
    while machine.is_asleep or machine.state.repeat != NOT_REPEATING:
        if machine.step() is not None:
            return "no instruction to skip"
    pc = machine.pc
    insn = decode_for_execution(machine.program.word(pc), machine.program.word(pc + 2))
    if insn is None:
        return "no instruction to skip"
    machine.pc = pc + 2 * insn.words
    return f"the instruction at {Inspector(machine).where(pc)}"


def _variable(machine: Machine, address: int) -> str:
    symbol = Inspector(machine).image.symbols.variable_at(address)
    return f" ({symbol[0].name.removeprefix('_')}+{symbol[1]})" if symbol is not None else ""
