"""The infrared ring in the world: own reflections, room light, a lamp, and the emitters of other robots (epuck.md §5).

Nothing is computed before the firmware converts one of the eight channels, and then once per quantum. Light of other
robots arrives one quantum late, so that no robot depends on which of them has lived first.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import Structure, addressof, c_double, c_int64, c_uint64, c_void_p
from functools import partial
from typing import Final

from arena.infrared.channel import Ether, Receivers, light_code
from arena.infrared.propagation import Optics
from arena.scene import dimensions
from arena.scene.loader import FCY, Scene
from arena.world.physics import STREAM_INFRARED, Poses, generator
from emu.boards.epuck.analog import PULSE_PINS, SENSORS, reflection_at
from emu.boards.epuck.board import Epuck
from emu.native_library import address_of

LAMP_CM: Final = 100.0
"""Distance at which `light.lamp_counts` holds."""
LOST_TCY: Final = (round(0.0008 * FCY), round(0.0024 * FCY))
"""Of a transmission that is lost: so much is seen, in each so much of it. A flash for proximity lasts 0.73 ms and is
seen; a frame begins with at least 2.4 ms of light (firmware/openswarm/io/infrared), and nobody sees that begin."""
_RIPPLE: Final = math.tau * 100 / FCY
"""Of lamps on the mains, rad per Tcy."""


class _Heard(Structure):
    _fields_ = [("counts", c_double * len(PULSE_PINS)), ("shares", c_double * SENSORS), ("robot", c_int64),
                ("track", c_void_p)]  # fmt: skip


class _Moment(Structure):
    _fields_ = [("count", c_int64), ("heard", c_void_p)]


class _Light(Structure):
    """`struct light` of light.c."""

    _fields_ = [
        ("receivers", Receivers), ("on_at", c_int64), ("late", c_int64), ("begin", c_int64),
        ("now", _Moment), ("past", _Moment),
        *((name, c_double) for name in ("lost_share", "ripple_counts", "ripple", "noise_counts")),
        ("lost_seen", c_int64), ("lost_period", c_int64), ("seed", c_uint64),
    ]  # fmt: skip


class Ring:
    """The eight sensors of one robot, put between its board and the world. Cycles of the board are `on_at` behind.

    Conversions are made later than they sample, so what holds is told with the cycle from which it does: what was
    before a quantum is kept for those under way.
    """

    def __init__(self, scene: Scene, seed: int, board: Epuck, ether: Ether, robot: int, on_at: int) -> None:
        self._scene = scene
        self._board = board
        self._adc = board.chip.adc
        self._ether = ether
        self._robot = robot
        self._on_at = on_at
        self._poses = Poses([], [])
        self._is_stale = True
        self._begin = 0
        self.is_read = False
        """Whether the firmware has ever converted one of the sensors."""
        self.look: Callable[[], Poses] | None = None
        """Where poses come from before that; later `move` tells them."""
        self._optics: Optics | None = None
        rng = generator(seed, STREAM_INFRARED, robot)
        setting = scene.infrared
        self._light = _Light(
            ether.receivers, on_at, ether.late, 0, _Moment(), _Moment(), setting.lost_share, setting.ripple_counts,
            _RIPPLE, setting.noise_counts, *LOST_TCY, int(rng.integers(1 << 62)),
        )  # fmt: skip
        self._banks = [(_Heard * (ether.robots or 1))() for _ in range(2)]
        self._offsets = rng.normal(0.0, scene.light.ambient_sd_counts, SENSORS).tolist()
        self._is_lit_alike = not (scene.lamps or scene.light.lamp_counts)
        board.ir.tau_seconds = setting.tau_us * 1e-6
        board.ir.shine(self._prepare, address_of(light_code()["light"]), addressof(self._light))
        for line, pin in enumerate(PULSE_PINS):
            board.chip.pins.watch(pin, partial(self._switched, line))

    def move(self, poses: Poses) -> None:
        """A quantum begins. What was sampled before it saw what was before it."""
        self._poses, begin = poses, self._adc.now + 1
        if not self.is_read:
            return
        since = self._adc.samples_from
        if since is not None and since < self._begin:
            self._adc.catch_up(begin - 1)
            since = self._adc.samples_from
        self._begin = begin
        if since is not None:  # a conversion is under way
            self._sense(begin)
        elif not self._is_stale:
            self._is_stale = True
            self._board.ir.answer(False)

    @property
    def readings(self) -> list[int] | None:
        """Counts by which the own emitters lower the sensors when lit; None if none was ever converted."""
        return list(self._board.ir.reflection) if self.is_read else None

    def _switched(self, line: int, cycle: int, changed: int, levels: int) -> None:
        if not self._board.ir.events.quiet:  # others have seen what is run again
            self._ether.switch(self._robot, self._on_at + cycle, line, bool(levels & changed))

    def _prepare(self, cycle: int) -> None:
        """A conversion samples in a cycle, the first one of a quantum unless one was under way."""
        if self._is_stale:
            if self.look is not None and not self.is_read:
                self._poses = self.look()
            self._sense(cycle)

    def _sense(self, begin: int) -> None:
        """What the sensors see from a cycle on, which is this quantum's."""
        ir = self._board.ir
        if self._optics is None:
            self._optics = Optics(self._scene)
        ir.part_from(begin)
        if not self._is_lit_alike or not self.is_read:
            counts = ambient(self._scene, self._poses.robots[self._robot])
            for sensor, (one, offset) in enumerate(zip(counts, self._offsets, strict=True)):
                ir.ambient[sensor] = min(max(round(one + offset), 0), 4095)
        for sensor, (distance, share) in enumerate(self._optics.surfaces(self._poses, self._robot)):
            ir.reflection[sensor] = round(reflection_at(distance) * share)
        self._hear(begin)
        self._is_stale, self.is_read = False, True
        ir.answer(True)

    def _hear(self, begin: int) -> None:
        """Of whom light may arrive in this quantum."""
        ether, light = self._ether, self._light
        now, robots = self._on_at + begin, range(self._poses.counts[0])
        lit = [other for other in robots
               if other != self._robot and not ether.is_dark(other, now, now + ether.quantum)]  # fmt: skip
        self._banks.reverse()
        bank, count = self._banks[0], 0
        if lit:
            assert self._optics is not None
            for other, counts, shares in self._optics.signals(self._poses, self._robot, lit):
                bank[count] = _Heard(counts, shares, other, ether.pulses(other).address)
                count += 1
        light.begin, light.past.count, light.past.heard = begin, light.now.count, light.now.heard
        light.now.count, light.now.heard = count, addressof(bank)


def _axes(heading: float) -> list[tuple[float, float]]:
    """Unit vectors along which the sensors of a robot look."""
    angles = [heading - math.radians(bearing) for bearing in dimensions.IR_BEARINGS_DEG]
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
        distance = max(math.hypot(dx, dy), dimensions.ROBOT_RADIUS)
        full = counts * (LAMP_CM / distance) ** 2
        for sensor, (east, north) in enumerate(_axes(pose[2])):
            taken[sensor] += full * max((dx * east + dy * north) / distance, 0.0)
    return [round(max(light.ambient_counts - one, 0.0)) for one in taken]
