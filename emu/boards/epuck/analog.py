"""Infrared ring, accelerometer and microphones on the ADC (epuck.md §5, §6). Levels are in counts of the 12-bit ADC."""

from __future__ import annotations

import math
import struct
from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from ctypes import Structure, addressof, c_double, c_int64, c_uint16, c_void_p
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import Final

from emu.boards.noise import Noise
from emu.boards.part import BoardPart
from emu.native_library import ADDRESS, DOUBLE, INT, address_of, functions
from emu.peripherals import Peripherals
from emu.peripherals.pins import Watcher, parse_pin

SENSORS: Final = 8
_FIRST_CHANNEL: Final = 8
PULSE_PINS: Final = ("RF7", "RF8", "RG0", "RG1")
"""Pins of the infrared pulse lines. Line n lights the emitters of sensors n and n + 4 (epuck.md §2)."""
TAU_SECONDS: Final = 60e-6
"""Time constant of an infrared receiver's response to its emitter, in s (epuck.md §10)."""
_SETTLED: Final = 9.2
"""Settling time, in time constants: the largest reflection is then within half a count of its final value."""
_DECAYED: Final = 45.0
"""Time constants after which a switch of the emitter no longer affects a level: 4095 e^-45 is 1e-16."""
_EDGES: Final = 128
"""Capacity of the queue of edges from native code; equals EDGES in ring.c."""
_FASTEST_HZ: Final = 30e6
"""Frequency in Hz of the fastest instruction clock (chip §3)."""
AMBIENT: Final = 3800  # UNVERIFIED: 3500 to 4000 indoors (epuck.md §5)

NOISE_COUNTS, NOISE_SHARE = 5.0, 0.03
"""Standard deviation of sensor noise, in counts and as a share of the reflection; the larger applies (epuck.md §5)."""

RESPONSE: Final = (  # distance in mm, reflection in counts: OpenSwarm's table (epuck.md §5)
    (0.0, 3788.0), (10.0, 3548.0), (20.0, 857.0), (30.0, 474.0), (40.0, 296.0), (50.0, 205.0),
    (60.0, 153.0), (70.0, 113.0), (80.0, 84.0), (90.0, 65.0), (100.0, 53.0),
)  # fmt: skip


_NEAR: Final = tuple(distance for distance, _ in RESPONSE)
SLOPES: Final = tuple(math.log(low / high) / (far - near) for (near, high), (far, low) in pairwise(RESPONSE))
"""Slope of the logarithm of the reflection per mm, after each point of the table."""


def reflection_at(distance_mm: float) -> float:
    """Return the reflection of a white surface in counts, interpolated on a log scale; 0 beyond the table."""
    if distance_mm <= _NEAR[0]:
        return RESPONSE[0][1]
    if not distance_mm <= _NEAR[-1]:
        return 0.0
    index = bisect_left(_NEAR, distance_mm) - 1
    return RESPONSE[index][1] * math.exp(SLOPES[index] * (distance_mm - _NEAR[index]))


class _Ring(Structure):
    """Mirror of `struct ring` in ring.c."""

    _fields_ = [
        *((name, c_int64) for name in ("ambient", "reflection", "lit", "since", "from", "tau", "seed", "strength",
                                       "edges", "edge_count")),
        *((name, c_int64 * len(PULSE_PINS)) for name in ("native", "port", "pin")),
        *((name, c_double) for name in ("decayed", "noise_counts", "noise_share")), ("begin", c_int64),
        ("past_ambient", c_uint16 * SENSORS), ("past_reflection", c_uint16 * SENSORS),
        *((name, c_void_p) for name in ("outside", "light", "emit", "emission")),
        *((name, c_double * len(RESPONSE)) for name in ("near", "counts", "slope")),
    ]  # fmt: skip


@cache
def _code() -> dict[str, Callable[..., int]]:
    return functions(Path(__file__).with_name("ring.c"), {
        "level": (INT, (ADDRESS, ADDRESS, INT, INT)),
        "settled": (DOUBLE, (ADDRESS, ADDRESS, INT, INT)),
        "apply_edges": (None, (ADDRESS, ADDRESS, INT)),
        "start_segment": (None, (ADDRESS, ADDRESS, INT)),
        "reflect": (None, (ADDRESS, ADDRESS, INT, DOUBLE, DOUBLE)),
        "edge": (INT, (ADDRESS, ADDRESS, INT, INT, INT, INT)),
    })  # fmt: skip


class Infrared(BoardPart):
    """Eight reflective sensors: raw = ambient - reflection x settled share - external light (ring.c)."""

    def __init__(self, chip: Peripherals, noise: Noise) -> None:
        super().__init__("ir", chip)
        self._noise: Final = noise
        self._tau_seconds = TAU_SECONDS
        self._prepare: Callable[[int], None] | None = None
        self._is_ready = False
        self.ambient: Final = self.array("ambient", "H", SENSORS)
        """Raw counts with the emitter off, per sensor; more light gives fewer counts."""
        self.reflection: Final = self.array("reflection", "H", SENSORS)
        """Reflection per sensor: counts by which its own lit emitter lowers the level once settled."""
        self._lit: Final = self.array("lit", "B", len(PULSE_PINS))
        self._since: Final = self.array("since", "Q", len(PULSE_PINS))
        self._from: Final = self.array("from", "H", len(PULSE_PINS))
        """Settled share of each line at its last switch, in 1/65535."""
        self._tau: Final = self.cell("tau", "Q")
        """`tau_seconds` in Tcy, stored as the bits of a double."""
        self.array("edges", "Q", _EDGES)
        self._edge_count: Final = self.cell("edge_count", "Q")
        """Number of edges from native code that no conversion has seen yet."""
        own = ("ir.ambient", "ir.reflection", "ir.lit", "ir.since", "ir.from", "ir.tau")
        names = (*own, "noise.seed", "noise.strength", "ir.edges", "ir.edge_count")
        places = [self.record.fields[name].offset for name in names]
        self._lines: Final = [parse_pin(pin) for pin in PULSE_PINS]
        """Port and mask of each pulse line."""
        native = [self.pins.native_cell(port).offset for port, _ in self._lines]
        lines = [(c_int64 * len(PULSE_PINS))(*row) for row in (native, *zip(*self._lines, strict=True))]
        decayed = _DECAYED * self._tau_seconds * _FASTEST_HZ
        self._ring: Final = _Ring(*places, *lines, decayed, NOISE_COUNTS, NOISE_SHARE)
        self._ring.near[:], self._ring.counts[:] = zip(*RESPONSE, strict=True)
        self._ring.slope[: len(SLOPES)] = SLOPES
        self._ring_at: Final = addressof(self._ring)
        self._update_tau()
        chip.oscillator.on_change.append(self._update_tau)
        self._sources: Final = [partial(self._level, sensor) for sensor in range(SENSORS)]
        for sensor in range(SENSORS):
            self.ambient[sensor] = AMBIENT
            chip.adc.source[_FIRST_CHANNEL + sensor] = self._sources[sensor]
        self._watchers: Final = [partial(self._switched, line) for line in range(len(PULSE_PINS))]
        for line, pin in enumerate(PULSE_PINS):
            self.pins.watch(pin, self._watchers[line])
            self._predict(line)
        noise.on_change.append(self._predict_all)

    @property
    def tau_seconds(self) -> float:
        """Time constant of all receivers; set it before the robot runs."""
        return self._tau_seconds

    @tau_seconds.setter
    def tau_seconds(self, seconds: float) -> None:
        self._tau_seconds = seconds
        self._ring.decayed = _DECAYED * seconds * _FASTEST_HZ
        self._update_tau()

    def _update_tau(self) -> None:
        self._apply_edges()
        (self._tau.value,) = struct.unpack("<Q", struct.pack("<d", self._tau_seconds * self.chip.fcy))

    def set_external_light(self, prepare: Callable[[int], None], light: int, data: int) -> None:
        """Subtract external light from the sensors' levels.

        The native function double light(data, sensor, cycle) returns the counts to subtract. Before each conversion,
        `prepare(cycle)` is called and may set `ambient` and `reflection`, unless native code may compute the levels
        (`set_native_ready`).
        """
        self._prepare = prepare
        self._ring.outside, self._ring.light = light, data
        self.set_native_ready(False)
        self._predict_all()

    def emit_natively(self, watchers: Sequence[Watcher], emit: int, emission: int) -> None:
        """Let native code handle edges of the pulse lines without Python. Needs external light.

        The native function int64 emit(emission, line, lit, cycle) replaces `watchers` of the pulse lines. It returns
        0 if Python must handle the next edge.
        """
        self._ring.emit, self._ring.emission = emit, emission
        replaced: list[Watcher] = [*self._watchers, *watchers]
        for port in {port for port, _ in self._lines}:
            mask = sum(pin for other, pin in self._lines if other == port)
            self.pins.handle_natively(port, mask, replaced, address_of(_code()["edge"]), self._ring_at)

    def emit_in_python(self) -> None:
        """Let Python handle all edges of the pulse lines again. First apply the edges that wait in the record."""
        self._apply_edges()
        for port in {port for port, _ in self._lines}:
            self.pins.handle_natively(port, 0, (), 0, 0)

    def set_native_ready(self, is_ready: bool) -> None:
        """Set whether native code may compute levels without calling `prepare`; holds until the next call."""
        if is_ready == self._is_ready:
            return
        self._is_ready = is_ready
        for sensor, source in enumerate(self._sources):
            code = address_of(_code()["level"]) if is_ready else 0
            self.chip.adc.source.set_native(_FIRST_CHANNEL + sensor, source, code, self._ring_at)

    def start_segment(self, cycle: int) -> None:
        """Start a new segment at `cycle`: values set from now on apply to later conversions only.

        Earlier conversions use the values that were current before the call.

        All conversions before the previous segment's start must be complete.
        """
        _code()["start_segment"](self.record.address, self._ring_at, cycle)

    def native_handle(self) -> tuple[int, int, int, int]:
        """Return the host addresses of `start_segment`, `reflect`, and their first two arguments (ring.c)."""
        code = _code()
        functions = address_of(code["start_segment"]), address_of(code["reflect"])
        return *functions, self.record.address, self._ring_at

    def set_distance(self, sensor: int, millimetres: float, share: float = 1.0) -> None:
        """Place a surface in front of a sensor (0..7).

        `share` scales the reflection for colour and angle (0..1, black about 0.2).
        """
        self.set_distances([(sensor, millimetres, share)])

    def set_distances(self, surfaces: Iterable[tuple[int, float, float]]) -> None:
        """Place several surfaces, each given as (sensor, millimetres, share); see `set_distance`."""
        self.chip.adc.catch_up(self.now)
        for sensor, millimetres, share in surfaces:
            self.reflection[sensor] = round(reflection_at(millimetres) * share)
        self._predict_all()

    def set_ambient(self, sensor: int, counts: int) -> None:
        """Set the ambient light at a sensor as raw counts 0..4095 (dark is high)."""
        self.chip.adc.catch_up(self.now)
        self.ambient[sensor] = counts
        self._predict(sensor % len(PULSE_PINS))

    def lines_lit(self) -> list[bool]:
        """Return, for each pulse line, whether its two emitters are on."""
        self._apply_edges()
        return [bool(lit) for lit in self._lit]

    def _apply_edges(self) -> None:
        """Complete the conversions so far, then apply all edges from native code."""
        if self._edge_count.value:
            self.chip.adc.catch_up(self.now)
            _code()["apply_edges"](self.record.address, self._ring_at, self.now + 1)

    def _switched(self, line: int, cycle: int, changed: int, levels: int) -> None:
        self.chip.adc.catch_up(self.now)
        self._apply_edges()
        share = _code()["settled"](self.record.address, self._ring_at, line, cycle)
        self._from[line] = round(share * 0xFFFF)
        self._since[line] = cycle
        self._lit[line] = bool(levels & changed)
        self._predict(line)
        if self._ring.emit:
            self.pins.resume_native(self._lines[line][0])

    def _predict_all(self) -> None:
        self.chip.adc.catch_up(self.now)
        for line in range(len(PULSE_PINS)):
            self._predict(line)

    def _predict(self, line: int) -> None:
        """Predict the settled levels of a line's receivers, which are constant without noise."""
        self._apply_edges()
        for sensor in (line, line + len(PULSE_PINS)):
            raw = self.ambient[sensor] - self.reflection[sensor] * bool(self._lit[line])
            level = None if self._noise.strength or self._prepare else min(max(raw, 0), 4095) << 4
            settled = self._since[line] + round(_SETTLED * self._tau_seconds * _FASTEST_HZ)
            self.chip.adc.source.predict(_FIRST_CHANNEL + sensor, self._sources[sensor], level, settled)

    def _level(self, sensor: int, cycle: int) -> int:
        if self._prepare is not None:
            self._prepare(cycle)
        elif not self._is_ready:  # the first conversion: a run without any starts faster
            self.set_native_ready(True)
        return _code()["level"](self.record.address, self._ring_at, _FIRST_CHANNEL + sensor, cycle)


class Accelerometer(BoardPart):
    """Analog accelerometer of hardware up to 1.2, on AN5..AN7: 2048 at 0 g, 800 counts per g (epuck.md §6)."""

    ZERO: Final = 2048
    PER_G: Final = 800
    _FIRST: Final = 5

    def __init__(self, chip: Peripherals) -> None:
        super().__init__("accelerometer", chip)
        self.set_g(0.0, 0.0, 1.0)

    def set_g(self, x: float, y: float, z: float) -> None:
        """Set the acceleration in g: x to the right, y backward, z up (1 at rest). UNVERIFIED signs of x and y."""
        for axis, value in enumerate((x, y, z)):
            code = round(self.ZERO + self.PER_G * value)
            self.chip.adc.set_input(self._FIRST + axis, min(max(code, 0), 4095) << 4)


class Microphones(BoardPart):
    """Three microphones on AN2..AN4: 2048 in silence; sound is a function of the cycle."""

    ZERO: Final = 2048
    DEVIATION: Final = 7.0
    """Idle noise in counts: +-20 is three deviations (epuck.md §6)."""
    _FIRST: Final = 2

    def __init__(self, chip: Peripherals, noise: Noise) -> None:
        super().__init__("microphones", chip)
        self._noise: Final = noise
        self._quiet: Final = [partial(self._level, self._FIRST + microphone, None) for microphone in range(3)]
        for microphone in range(3):
            self.play(microphone, None)
        noise.on_change.append(self._predict)

    def play(self, microphone: int, sound: Callable[[int], float] | None) -> None:
        """Play a sound at microphone 0..2 (right, left, back); None means silence.

        `sound(cycle)` returns the sound's level in counts around 0.
        """
        self.chip.adc.catch_up(self.now)
        channel = self._FIRST + microphone
        loud = partial(self._level, channel, sound)
        self.chip.adc.source[channel] = self._quiet[microphone] if sound is None else loud
        self._predict()

    def _predict(self) -> None:
        """Predict the levels of silent microphones, which are constant without noise."""
        self.chip.adc.catch_up(self.now)
        for microphone, quiet in enumerate(self._quiet):
            level = None if self._noise.strength else self.ZERO << 4
            self.chip.adc.source.predict(self._FIRST + microphone, quiet, level)

    def _level(self, channel: int, sound: Callable[[int], float] | None, cycle: int) -> int:
        counts = self.ZERO + self._noise.at(channel, cycle, self.DEVIATION) + (sound(cycle) if sound is not None else 0)
        return min(max(round(counts), 0), 4095) << 4
