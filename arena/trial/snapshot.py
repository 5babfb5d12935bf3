"""What there is to see in a trial that stands: where everything is, what each robot is at, a digest of all that lives.

Nothing is changed by looking. Two passes of a trial that stand at the same moment show the same, to the bit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

from arena.robots.controller import Controller
from arena.robots.firmware_controller import FirmwareController
from arena.world.physics import World
from emu.machine.machine import Machine


def digest(world: World, controllers: Sequence[Controller]) -> str:
    """SHA-256 of everything that lives: bodies with their speeds, and every machine's whole state."""
    found = hashlib.sha256(world.poses.values.tobytes())
    for body in (*world.robots, *world.objects):
        moves = tuple(body.position), body.angle, tuple(body.velocity), body.angular_velocity
        found.update(repr(moves).encode())
    for controller in controllers:
        if isinstance(controller, FirmwareController):
            found.update(controller.machine.snapshot())
    return found.hexdigest()


def place_of(machine: Machine) -> str:
    """The function a robot is in."""
    return machine.image.symbols.text(machine.pc) if machine.image else ""


def seen(world: World, controllers: Sequence[Controller], robot: int) -> list[tuple[str, str]]:
    """Names and values for whoever debugs `robot`; cm, rad, s. A robot that has looked at the world waits there for
    those that have not lived as long."""
    poses = world.poses
    rows = [("world", f"t = {world.seconds:.4f} s, {world.ticks} quanta are over")]
    for number, ((x, y, heading), controller) in enumerate(zip(poses.robots, controllers, strict=True)):
        at = "a script"
        if isinstance(controller, FirmwareController):
            machine = controller.machine
            sleeps = ", asleep" if machine.is_asleep else ""
            at = f"{place_of(machine) or f'{machine.pc:#08x}'}, cycle {machine.cycle:,}{sleeps}"
        mine = " (this one)" if number == robot else ""
        rows.append((f"robot {number}", f"x {x:.2f}, y {y:.2f}, heading {heading:.3f}; {at}{mine}"))
    rows += [(f"object {number}", f"x {x:.2f}, y {y:.2f}") for number, (x, y) in enumerate(poses.objects)]
    return [*rows, ("state", digest(world, controllers))]
