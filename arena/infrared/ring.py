"""The ring of infrared sensors in the world: own reflections, room light, lamps and other robots' light (epuck.md §5).

The computation starts when the firmware first converts one of the eight channels. From then on, light.c computes all
channels once per quantum. Light of other robots arrives one quantum late, so the order in which the robots run has no
effect.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import Structure, addressof, c_double, c_int64, c_uint64, c_void_p
from functools import partial
from typing import Final

from arena.infrared.channel import Emission, OpticalChannel, Receivers, light_code
from arena.infrared.propagation import Optics
from arena.scene import dimensions
from arena.scene.loader import FCY, Scene
from arena.world.physics import STREAM_INFRARED, generator
from arena.world.poses import Poses
from emu.boards.epuck.analog import PULSE_PINS, SENSORS
from emu.boards.epuck.board import Epuck
from emu.native_library import address_of

LAMP_CM: Final = 100.0
"""Distance in cm to which `light.lamp_counts` refers."""
LOST_TCY: Final = (round(0.0008 * FCY), round(0.0024 * FCY))
"""(visible, period) in Tcy: a lost transmission is visible only in the first 0.8 ms of every 2.4 ms.

A proximity flash of 0.73 ms stays visible. A frame begins with at least 2.4 ms of light
(firmware/openswarm/io/infrared), so its start is never detected."""
_RIPPLE: Final = math.tau * 100 / FCY
"""Angular frequency of the 100 Hz ripple of lamps on the mains, rad per Tcy."""


class _Source(Structure):
    """`struct source` of light.c."""

    _fields_ = [("counts", c_double * len(PULSE_PINS)), ("shares", c_double * SENSORS), ("robot", c_int64),
                ("history", c_void_p)]  # fmt: skip


class _SourceList(Structure):
    """`struct source_list` of light.c."""

    _fields_ = [("count", c_int64), ("sources", c_void_p)]


class _Light(Structure):
    """`struct light` of light.c."""

    _fields_ = [
        ("receivers", Receivers), ("on_at", c_int64), ("delay", c_int64), ("begin", c_int64),
        ("now", _SourceList), ("past", _SourceList),
        *((name, c_double) for name in ("lost_share", "ripple_counts", "ripple", "noise_counts")),
        ("lost_seen", c_int64), ("lost_period", c_int64), ("seed", c_uint64),
    ]  # fmt: skip


class _Sensing(Structure):
    """`struct sensing` of light.c, which explains the fields."""

    _fields_ = [
        *((name, c_void_p) for name in ("signal", "surfaces", "start_segment", "reflect", "record", "ring", "adc_state",
                                        "adc_mark", "adc_frozen", "optics", "poses", "light", "histories")),
        ("banks", c_void_p * 2),
        *((name, c_int64) for name in ("robot", "quantum", "is_stale", "has_lamps", "begin")),
    ]  # fmt: skip
    begin: int
    is_stale: int


class InfraredRing:
    """The eight sensors of one robot, between its board and the world. The board is powered on at cycle `on_at`.

    A conversion is computed later than it samples. So every change comes with the cycle from which it holds, and the
    values before a quantum are kept for conversions in progress.
    """

    def __init__(self, scene: Scene, seed: int, board: Epuck, channel: OpticalChannel, robot: int, on_at: int) -> None:
        self._scene = scene
        self._board = board
        self._adc = board.chip.adc
        self._channel = channel
        self._robot = robot
        self._on_at = on_at
        self._poses = Poses([], [])
        self.is_read = False
        """Whether the firmware has ever converted one of the sensors."""
        self.poses_source: Callable[[], Poses] | None = None
        """Source of the poses at the first conversion of a quantum, if native code may have begun the quantum."""
        self._optics: Optics | None = None
        rng = generator(seed, STREAM_INFRARED, robot)
        setting, code = scene.infrared, light_code()
        self._light = _Light(
            channel.receivers, on_at, channel.delay, 0, _SourceList(), _SourceList(), setting.lost_share,
            setting.ripple_counts, _RIPPLE, setting.noise_counts, *LOST_TCY, int(rng.integers(1 << 62)),
        )  # fmt: skip
        self._banks = [(_Source * (channel.robots or 1))() for _ in range(2)]
        self._histories = channel.emitter_addresses()
        has_lamps = bool(scene.lamps or scene.light.lamp_counts)
        self._sensing = _Sensing(
            light=addressof(self._light), histories=addressof(self._histories), robot=robot, quantum=channel.quantum,
            banks=(c_void_p * 2)(*map(addressof, self._banks)), is_stale=True, has_lamps=has_lamps,
        )  # fmt: skip
        self.sensing: Final = addressof(self._sensing)
        """Host address of `struct sensing` of light.c."""
        self.begin_natively: Final = address_of(code["begin_quantum"])
        """Host address of the function `begin_quantum` of light.c. It may be called once a sensor has been read."""
        self._offsets = rng.normal(0.0, scene.light.ambient_sd_counts, SENSORS).tolist()
        board.ir.tau_seconds = setting.tau_us * 1e-6
        board.ir.set_external_light(self._on_conversion, address_of(code["light"]), addressof(self._light))
        watchers = [partial(self._on_pulse_line, line) for line in range(len(PULSE_PINS))]
        for pin, watcher in zip(PULSE_PINS, watchers, strict=True):
            board.chip.pins.watch(pin, watcher)
        self._emission = Emission(channel.emitter(robot).address, addressof(channel.receivers), on_at)
        board.ir.emit_natively(watchers, address_of(code["emit"]), addressof(self._emission))

    def begin_quantum(self, poses: Poses, before: Poses) -> None:
        """Begin a quantum with `poses`. Conversions that sampled before it use the values before it.

        `before` are the poses of the finished quantum.
        """
        if not self.is_read:
            self._poses = poses
            return
        begin, since, sensing = self._adc.now + 1, self._adc.samples_from, self._sensing
        if since is not None and sensing.is_stale:  # it may have sampled in the finished quantum
            self._poses = before
            self._sense(sensing.begin)
        self._poses = poses
        if since is not None and since < sensing.begin:
            self._adc.catch_up(begin - 1)
            since = self._adc.samples_from
        sensing.begin = begin
        if since is not None:  # a conversion is under way
            self._sense(begin)
        elif not sensing.is_stale:
            sensing.is_stale = True
            self._board.ir.set_native_ready(False)

    @property
    def readings(self) -> list[int] | None:
        """Counts by which the own lit emitters lower the sensors; None if no sensor was ever converted."""
        return list(self._board.ir.reflection) if self.is_read else None

    def _on_pulse_line(self, line: int, cycle: int, changed: int, levels: int) -> None:
        """Pass a change of a pulse line to the channel."""
        if not self._board.ir.events.quiet:  # a replay of the past adds nothing
            self._channel.switch(self._robot, self._on_at + cycle, line, bool(levels & changed))

    def _on_conversion(self, cycle: int) -> None:
        """Update the sensors for a conversion that samples at a cycle; only the first one in a quantum does so."""
        if self._sensing.is_stale:
            if self.poses_source is not None:
                self._poses = self.poses_source()
            self._sense(cycle)

    def _sense(self, begin: int) -> None:
        """Set the reflections, the room light and the sources for this quantum, from a cycle on."""
        ir = self._board.ir
        if self._optics is None:
            self._optics = Optics(self._scene)
            self._connect(self._optics)
        ir.start_segment(begin)
        if self._sensing.has_lamps or not self.is_read:
            counts = ambient(self._scene, self._poses.robots[self._robot])
            for sensor, (one, offset) in enumerate(zip(counts, self._offsets, strict=True)):
                ir.ambient[sensor] = min(max(round(one + offset), 0), 4095)
        if self._poses.counts[0] > self._channel.robots:
            raise ValueError(f"{self._poses.counts[0]} robots are more than the channel has")
        self._optics.set_poses(self._poses)
        light_code()["sense"](self.sensing, begin)
        self.is_read = True
        ir.set_native_ready(True)

    def _connect(self, optics: Optics) -> None:
        """Set the native functions, and the host addresses that they use."""
        sensing, record = self._sensing, self._board.ir.record
        sensing.signal, sensing.surfaces, sensing.optics, sensing.poses = optics.native_handle()
        sensing.start_segment, sensing.reflect, sensing.record, sensing.ring = self._board.ir.native_handle()
        sensing.adc_state, sensing.adc_mark, sensing.adc_frozen = (
            record.address + record.fields[f"adc.{name}"].offset for name in ("state", "mark", "frozen")
        )


def _axes(heading: float) -> list[tuple[float, float]]:
    """Return the unit vectors of the sensor axes."""
    angles = [heading - math.radians(bearing) for bearing in dimensions.IR_BEARINGS_DEG]
    return [(math.cos(angle), math.sin(angle)) for angle in angles]


def ambient(scene: Scene, pose: tuple[float, float, float]) -> list[int]:
    """Return the raw counts of the sensors with all emitters off.

    Lamps lower the counts of the room as 1 / d^2 and by the cosine of the angle to them. They hang high above the arena
    and cast no shadows.
    """
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
