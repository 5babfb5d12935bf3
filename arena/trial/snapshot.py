"""State view and digest of a paused trial. Reading them changes nothing.

Two runs of a trial that are paused at the same instant show the same state, to the bit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

from arena.robots.controller import Controller
from arena.world.physics import World


def state_digest(world: World, controllers: Sequence[Controller]) -> str:
    """Return the SHA-256 of the whole state: bodies with their speeds, and every machine."""
    found = hashlib.sha256(world.poses.values.tobytes())
    for body in (*world.robots, *world.objects):
        moves = tuple(body.position), body.angle, tuple(body.velocity), body.angular_velocity
        found.update(repr(moves).encode())
    for controller in controllers:
        found.update(controller.state())
    return found.hexdigest()


def state_view(world: World, controllers: Sequence[Controller], robot: int) -> list[tuple[str, str]]:
    """Return names and values for the debugger of `robot`; cm, rad, s.

    A robot that waits for poses is shown at the instruction that reads them.
    """
    poses = world.poses
    rows = [("world", f"t = {world.seconds:.4f} s, {world.ticks} quanta are over")]
    for number, ((x, y, heading), controller) in enumerate(zip(poses.robots, controllers, strict=True)):
        mine = " (this one)" if number == robot else ""
        rows.append((f"robot {number}", f"x {x:.2f}, y {y:.2f}, heading {heading:.3f}; {controller.place()}{mine}"))
    rows += [(f"object {number}", f"x {x:.2f}, y {y:.2f}") for number, (x, y) in enumerate(poses.objects)]
    own = hashlib.sha256(controllers[robot].state()).hexdigest()
    return [*rows, (f"state of robot {robot}", own), ("state", state_digest(world, controllers))]
