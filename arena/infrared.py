"""The infrared ring in the world: own reflections, room light, a lamp, and the emitters of other robots (epuck.md §5).

Nothing is computed before the firmware converts one of the eight channels, and then once per quantum. Light of other
robots arrives one quantum late, so that no robot depends on which of them has lived first.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Final

from arena import bodies
from arena.ether import Ether
from arena.optics import Optics, Signal
from arena.scene import FCY, Scene
from arena.world import STREAM_INFRARED, Poses, generator
from emu.boards.epuck.analog import PULSE_PINS, SENSORS, reflection_at
from emu.boards.epuck.board import Epuck
from emu.boards.noise import gaussian, uniform

LAMP_CM: Final = 100.0
"""Distance at which `light.lamp_counts` holds."""
LOST_TCY: Final = (round(0.014 * FCY), round(0.030 * FCY))
"""Of a transmission that is lost: 7 bits begin a frame, then words last 11 ms (firmware/openswarm/io/infrared), of
which the second is within this."""
_RIPPLE: Final = math.tau * 100 / FCY
"""Of lamps on the mains, rad per Tcy."""


class Ring:
    """The eight sensors of one robot, put between its board and the world. Cycles of the board are `on_at` behind."""

    def __init__(self, scene: Scene, seed: int, board: Epuck, ether: Ether, robot: int, on_at: int) -> None:
        self._scene = scene
        self._board = board
        self._ether = ether
        self._robot = robot
        self._on_at = on_at
        self._poses = Poses([], [])
        self._is_stale = True
        self._unfelt = 0
        """Bit n: nobody has asked for sensor n since the poses changed."""
        self.is_read = False
        """Whether the firmware has ever converted one of the sensors."""
        self.look: Callable[[], Poses] | None = None
        """Where poses come from before that; later `move` tells them."""
        self._optics: Optics | None = None
        self._heard: list[Signal] = []
        self._missed: dict[int, tuple[int, bool]] = {}
        """By robot its last transmission's begin, and whether it is lost here."""
        rng = generator(seed, STREAM_INFRARED, robot)
        self._seed = int(rng.integers(1 << 62))
        self._offsets = rng.normal(0.0, scene.light.ambient_sd_counts, SENSORS).tolist()
        board.ir.tau_seconds = scene.infrared.tau_us * 1e-6
        board.ir.shine(self._light)
        for line, pin in enumerate(PULSE_PINS):
            board.chip.pins.watch(pin, partial(self._switched, line))

    def move(self, poses: Poses) -> None:
        """A quantum begins. What was sampled before it is made final first."""
        if self.is_read:
            self._board.chip.adc.catch_up(self._board.chip.adc.now)
        self._poses = poses
        self._is_stale = True

    @property
    def readings(self) -> list[int] | None:
        """Counts by which the own emitters lower the sensors when lit; None if none was ever converted."""
        if not self.is_read:
            return None
        for sensor in range(SENSORS):
            self._feel(sensor)
        return list(self._board.ir.reflection)

    def _switched(self, line: int, cycle: int, changed: int, levels: int) -> None:
        if not self._board.ir.events.quiet:  # others have seen what is run again
            self._ether.switch(self._robot, self._on_at + cycle, line, bool(levels & changed))

    def _light(self, sensor: int, cycle: int) -> float:
        """Counts taken off by other robots' light, noise and lamps on the mains; the rest is brought up to date."""
        if self._is_stale:
            self._sense(cycle)
        if self._unfelt >> sensor & 1:
            self._feel(sensor)
        setting, now, light = self._scene.infrared, self._on_at + cycle, 0.0
        for other, counts, shares in self._heard:
            if shares[sensor] and not (setting.lost_share and self._misses(other, now)):
                lit = self._ether.shares(other, now)
                light += shares[sensor] * sum([one * share for one, share in zip(counts, lit, strict=True)])
        if setting.ripple_counts:
            light += setting.ripple_counts * math.sin(_RIPPLE * now)
        if setting.noise_counts:
            light += setting.noise_counts * gaussian(self._seed, sensor, now)
        return light

    def _misses(self, other: int, now: int) -> bool:
        """Whether another robot's light is lost here now: in so many of its transmissions, as the scene says, for the
        time of a word, so that it is seen that somebody sends, but not what."""
        begun = self._ether.begun(other, now)
        if not LOST_TCY[0] <= now - begun < LOST_TCY[1]:
            return False
        known, missed = self._missed.get(other, (-1, False))
        if known != begun:
            missed = uniform(self._seed + other, SENSORS, begun) < self._scene.infrared.lost_share
            self._missed[other] = begun, missed
        return missed

    def _sense(self, cycle: int) -> None:
        if self.look is not None and not self.is_read:
            self._poses = self.look()
        self._is_stale, self.is_read, self._unfelt = False, True, (1 << SENSORS) - 1
        if self._optics is None:
            self._optics = Optics(self._scene)
        ir = self._board.ir
        counts = ambient(self._scene, self._poses.robots[self._robot])
        for sensor, (one, offset) in enumerate(zip(counts, self._offsets, strict=True)):
            ir.ambient[sensor] = min(max(round(one + offset), 0), 4095)
        now, others = self._on_at + cycle, range(len(self._poses.robots))
        lit = [other for other in others if other != self._robot
               and not self._ether.is_dark(other, now, now + self._ether.quantum)]  # fmt: skip
        self._heard = self._optics.signals(self._poses, self._robot, lit) if lit else []

    def _feel(self, sensor: int) -> None:
        """What a sensor sees of its own light, when it is first asked for."""
        if self._optics is not None and self._unfelt >> sensor & 1:
            self._unfelt &= ~(1 << sensor)
            distance, share = self._optics.surface(self._poses, self._robot, sensor)
            self._board.ir.reflection[sensor] = round(reflection_at(distance) * share)


def _axes(heading: float) -> list[tuple[float, float]]:
    """Unit vectors along which the sensors of a robot look."""
    angles = [heading - math.radians(bearing) for bearing in bodies.IR_BEARINGS_DEG]
    return [(math.cos(angle), math.sin(angle)) for angle in angles]


def ambient(scene: Scene, pose: tuple[float, float, float]) -> list[int]:
    """Raw counts of the sensors with all emitters off: the room's, lowered by the lamp (high above the arena, without
    shadows) as 1 / d^2 and by the cosine of the angle to it."""
    light = scene.light
    lamps = [(one.x_cm, one.y_cm, one.counts) for one in scene.lamps]
    if light.lamp_counts:
        lamps.append((light.lamp_x_cm, light.lamp_y_cm, light.lamp_counts))
    if not lamps:
        return [light.ambient_counts] * SENSORS
    taken = [0.0] * SENSORS
    for x, y, counts in lamps:
        dx, dy = x - pose[0], y - pose[1]
        distance = max(math.hypot(dx, dy), bodies.ROBOT_RADIUS)
        full = counts * (LAMP_CM / distance) ** 2
        for sensor, (east, north) in enumerate(_axes(pose[2])):
            taken[sensor] += full * max((dx * east + dy * north) / distance, 0.0)
    return [round(max(light.ambient_counts - one, 0.0)) for one in taken]
