"""Exact cycle counts of a Kilobot's firmware by instruction, function and source line.

The robot runs instruction by instruction (emu/avr/core/observed.c), with the same result as a run that skips waiting
loops. An interrupt's entry and the jump at its vector count for the handler, sleep and waking up count as idle.
"""

from __future__ import annotations

import struct
from collections import Counter
from typing import TYPE_CHECKING, Final

from emu.avr.isa.codec import decode
from emu.avr.isa.text import target
from emu.avr.machine import VECTORS
from emu.avr.observation import Observation
from emu.boards.kilobot.swarm import KilobotFaultError
from emu.debug.avr.fault import fault_stop
from emu.profile.cycle_shares import CodeLocations, Profile

if TYPE_CHECKING:
    from emu.avr.image import AvrImage
    from emu.boards.kilobot.single import SingleKilobot
    from emu.machine.stops import Stop

VECTOR_BYTES: Final = 4
"""Bytes of flash for each interrupt's vector."""


def profile_kilobot(robot: SingleKilobot, until: int, skip: int = 0) -> Profile:
    """Run a robot to cycle `until` and count from cycle `skip` on. A fault ends the run early."""
    machine, observation = robot.machine, Observation()
    entry: Final = machine.pc
    stop = _advance(robot, skip)
    profile = Profile(entry, machine.cycle)
    observation.counting = 1
    robot.swarm.observe(0, observation)
    profile.stop = stop or _advance(robot, until)
    robot.swarm.observe(0, None)
    profile.end = machine.cycle
    locations = CodeLocations(machine.image)
    rows: Counter[int] = Counter()
    for word, cycles in enumerate(observation.cycles):
        if cycles:
            rows[locations.row_of(_handler(machine.image, 2 * word))] += cycles
    profile.addresses = dict(rows)
    for row, cycles in rows.items():
        profile.locations[locations.at(row)] += cycles
    profile.idle = profile.end - profile.start - profile.busy
    return profile


def _handler(image: AvrImage, pc: int) -> int:
    """Return the target of the jump at an interrupt's vector, for other addresses the address itself."""
    if pc >= VECTOR_BYTES * len(VECTORS):
        return pc
    first, second = struct.unpack_from("<2H", image.flash, pc)
    jump = decode(first, second)
    if jump is None or jump.row.mnemonic not in ("jmp", "rjmp"):
        return pc
    return target(first, second, pc) or pc


def _advance(robot: SingleKilobot, until: int) -> Stop | None:
    """Run to a cycle. Return the stop at a fault, None if there was none."""
    try:
        robot.run_until(until)
    except KilobotFaultError:
        return fault_stop(robot.machine)
    return None
