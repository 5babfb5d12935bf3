"""Kilobots in lock step that receive each other's infrared light, pulse by pulse (air.c).

    with KilobotSwarm([KilobotSetup(image, number=1), KilobotSetup(image, x=50, number=2)]) as swarm:
        swarm.run(2.0)
        swarm.robots[0].peek("counter")

The same robots, seed and calls give the same run, however it is cut into calls. Facts: kilobot.md §1, §2.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from ctypes import Structure, addressof, c_int32, c_int64, c_uint32, c_uint64, c_void_p, memmove, sizeof, string_at
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from emu.avr.core.state import Avr, declaration
from emu.avr.image import AvrImage
from emu.avr.machine import HZ, Atmega328p, Program
from emu.avr.native import TYPES, native
from emu.avr.observation import STOP_NONE, Observation
from emu.boards.kilobot.observer import EMITTERS
from emu.native_library import ADDRESS, INT, address_of, functions_of

_STOPPED: Final = 1 << 62
"""Tick that a stopped robot has reached (air.c)."""
REACH_MM: Final = 70.0
"""Default range in mm between the centres of two robots. Sellers state 7 cm, real data 14 cm (kilobot.md §1)."""
FULL_SCALE: Final = 1023
HIGH_GAIN_MM, LOW_GAIN_MM = 40.0, 20.0
"""Distances in mm at which the gains saturate; beyond, counts fall with the square. UNVERIFIED, docs/accuracy.md."""
CALIBRATED_MM: Final = tuple(range(33, 99, 5))
"""Distances in mm of the strength tables in the EEPROM (kilobot.md §1)."""
NUMBER_AT, LOW_GAIN_AT, HIGH_GAIN_AT = 0xB0, 0x20, 0x50
"""EEPROM addresses of the calibration (kilobot.md §1): UID (low byte first), counts (high byte first)."""
DUTIES: Final = {0x05: 70, 0x09: 70, 0x0C: 65, 0x14: 65}
"""Calibrated duties of 255 by EEPROM address: turn left, turn right, straight left, straight right (kilobot.md §1)."""
AREF_UV: Final = 3_000_000
THRESHOLD_UV: Final = 500_000
BATTERY_UV, BATTERY_NOISE_UV = 2_000_000, 31_000
"""Voltage of ADC6 at half of a battery of 4 V, and its noise, from which kilolib draws random bits. UNVERIFIED."""
PULSE_TICKS: Final = 9
LEAD_TICKS: Final = 10
"""Ticks by which light from outside is announced: a robot runs at most 8 (MARGIN in air.c) past the end of a run."""
SLOWEST: Final = 0.8
"""Least frequency of an oscillator divided by the nominal one."""
EDGES: Final = 256
"""Capacity of a robot's queue of light edges, without the two edges for each other robot that are added (air.c)."""
ADC6, ADC7, AIN1 = 6, 7, 10
LOSS_ONE: Final = 1 << 16
ONE_RATE: Final = 1 << 32


class KilobotFaultError(Exception):
    """A robot's firmware faulted. `robot` is its index, `what` the fault and its place."""

    def __init__(self, robot: int, what: str) -> None:
        super().__init__(f"robot {robot}: {what}")
        self.robot = robot
        self.what = what


class _Edge(Structure):
    """Mirror of `struct edge` in air.c."""

    _fields_ = [("at", c_uint64), ("high_uv", c_uint32), ("low_uv", c_uint32), ("change", c_int32),
                ("sender", c_uint32)]  # fmt: skip


class _Link(Structure):
    """Mirror of `struct link` in air.c."""

    _fields_ = [(name, c_uint32) for name in ("high_uv", "low_uv", "loss", "shown")]
    high_uv: int
    low_uv: int
    loss: int


class _Robot(Structure):
    """Mirror of `struct robot` in air.c."""

    _fields_ = [("avr", c_void_p), ("code", c_void_p),
                *((name, c_uint64) for name in ("on_at", "rate", "period")),
                ("lights", c_uint32), ("edge_count", c_uint32), ("reached", c_uint64), ("pulses", c_uint64),
                ("observation", c_void_p), ("edges", c_void_p)]  # fmt: skip
    code: int
    on_at: int
    period: int
    pulses: int
    reached: int
    observation: int | None


class _Air(Structure):
    """Mirror of `struct air` in air.c."""

    _fields_ = [("count", c_int64),
                *((name, c_void_p) for name in ("robots", "links", "acts", "run", "input", "run_observed",
                                             "input_observed")),
                *((name, c_uint64) for name in ("delay", "seed", "room", "lost_edges"))]  # fmt: skip
    lost_edges: int


def counts(gain_mm: float, distance_mm: float) -> int:
    """Return the converter's counts for a pulse of a neighbour at a distance in mm."""
    return FULL_SCALE if distance_mm <= gain_mm else round(FULL_SCALE * (gain_mm / distance_mm) ** 2)


def _microvolts_by_distance(gain_mm: float, distances: NDArray[np.float64]) -> NDArray[np.uint32]:
    """Return `microvolts(counts(gain_mm, distance))` of many distances in mm."""
    found = np.rint(FULL_SCALE * (gain_mm / np.maximum(distances, gain_mm)) ** 2).astype(np.int64)
    return ((found * AREF_UV + 1023) // 1024 + (found > 0)).astype(np.uint32)


def microvolts(count: int) -> int:
    """Return an input voltage that the converter reads as `count`, 0 to 1023."""
    return (count * AREF_UV + 1023) // 1024 + (1 if count else 0)


@dataclass(frozen=True)
class KilobotSetup:
    """One robot at power-on."""

    image: AvrImage
    x: float = 0.0
    """Position of its centre in mm."""
    y: float = 0.0
    number: int | None = None
    """Its UID; None for a robot whose EEPROM has none."""
    on_at: float = 0.0
    """Time of power-on in seconds."""
    calibrated: bool = True
    """Whether its EEPROM has motor duties and the tables of strength by distance."""
    clock: float = 1.0
    """Frequency of its oscillator divided by the nominal 8 MHz."""
    duties: tuple[int, ...] = tuple(DUTIES.values())
    """Calibrated duties of its motors in the order of DUTIES."""


class KilobotSwarm:
    """Kilobots at power-on.

    `loss`: share of the pulses, 0 to below 1, that a receiver misses. It may be a curve over the distance instead:
    points (mm, share), linear between them and constant beyond. `delay`: ticks of 125 ns after which light reaches
    other robots, 18 or more. `reach`: range in mm between the centres of two robots. Raises ValueError.
    """

    def __init__(self, robots: Sequence[KilobotSetup], *, seed: int = 1, loss: float | Sequence[Sequence[float]] = 0.0,
                 delay: int = 32, reach: float = REACH_MM) -> None:  # fmt: skip
        curve = np.array([(0.0, loss)] if isinstance(loss, int | float) else loss, dtype=float).T
        if not ((curve[1] >= 0) & (curve[1] < 1)).all() or not (np.diff(curve[0]) > 0).all():
            raise ValueError(f"a loss of {loss} is not within 0 and 1, at rising distances")
        if any(robot.clock < SLOWEST for robot in robots):
            raise ValueError(f"a clock of {min(robot.clock for robot in robots)} is less than {SLOWEST}")
        if delay < 2 * PULSE_TICKS:
            raise ValueError(f"a delay of {delay} ticks is less than {2 * PULSE_TICKS}")
        self._loss, self._reach = curve, reach
        self.places = np.array([(robot.x, robot.y) for robot in robots], dtype=float).reshape(-1, 2)
        """Positions of the centres in mm; `move` and `move_all` change them."""
        self.now = 0
        """Ticks of 125 ns since the start."""
        self._observed: dict[int, Observation] = {}
        self._functions = _code()
        programs: dict[bytes, Program] = {}
        self.robots: list[Atmega328p] = []
        for index, robot in enumerate(robots):
            machine = Atmega328p(robot.image, seed=seed * 1_000_003 + index, program=programs.get(robot.image.flash))
            programs.setdefault(robot.image.flash, machine.program)
            set_up(machine, robot.number, calibrated=robot.calibrated, duties=robot.duties)
            self.robots.append(machine)
        count = len(robots)
        room = EDGES + 2 * count
        self._edges = (_Edge * (room * count))()
        self._robots = (_Robot * count)(*(
            _Robot(addressof(machine.state), machine.program.address, int(robot.on_at * HZ),
                   int(robot.clock * ONE_RATE), int(ONE_RATE / robot.clock), reached=int(robot.on_at * HZ),
                   edges=addressof(self._edges) + index * room * sizeof(_Edge))
            for index, (machine, robot) in enumerate(zip(self.robots, robots, strict=True))))  # fmt: skip
        self._links = (_Link * (count * count))()
        words = (c_uint32 * (4 * count * count)).from_buffer(self._links)
        self._table = np.ctypeslib.as_array(words).reshape(count, count, 4) if count else None
        self._acts = (c_uint64 * count)()
        functions = native()
        self._air = _Air(
            count, addressof(self._robots), addressof(self._links), addressof(self._acts),
            address_of(functions["avr_run"]), address_of(functions["avr_input"]),
            address_of(functions["avr_run_observed"]), address_of(functions["avr_input_observed"]), delay,
            seed * 2_654_435_761 % (1 << 63) | 1, room,
        )  # fmt: skip
        self._update_links(np.arange(count))

    def _update_links(self, moved: NDArray[np.intp]) -> None:
        """Compute the links between the robots `moved` and all others, in both directions."""
        if self._table is None:
            return
        apart = self.places[moved][:, None] - self.places[None]
        distances = np.hypot(apart[..., 0], apart[..., 1])
        for field, gain in enumerate((HIGH_GAIN_MM, LOW_GAIN_MM)):
            strengths = np.where(distances <= self._reach, _microvolts_by_distance(gain, distances), 0)
            self._table[moved, :, field] = strengths
            self._table[:, moved, field] = strengths.T
        losses = (np.interp(distances, *self._loss) * LOSS_ONE).astype(np.uint32)
        self._table[moved, :, 2] = losses
        self._table[:, moved, 2] = losses.T

    def move(self, robot: int, x: float, y: float) -> None:
        """Move a robot to a position in mm, at once."""
        self.places[robot] = (x, y)
        self._update_links(np.array([robot]))

    def move_all(self, places: NDArray[np.float64]) -> None:
        """Move all robots to positions in mm, at once: an array of robots x 2. Robots that stay cost no time."""
        moved = np.flatnonzero((places != self.places).any(axis=1))
        if moved.size:
            self.places[moved] = places[moved]
            self._update_links(moved)

    def stop(self, robot: int) -> None:
        """Stop a robot permanently, as after a fault or without its battery. It sends and receives no more light."""
        self._functions["air_stop"](addressof(self._air), robot)

    def flash(self, robot: int, after_us: float, distance: float = 0.0) -> None:
        """Send one robot a light pulse after `after_us`, as strong as that of a robot at `distance` mm.

        A pulse within the next LEAD_TICKS is sent at their end.
        """
        self.light(robot, self.now + max(int(after_us * HZ / 1e6), LEAD_TICKS), distance)

    def light(self, robot: int, tick: int, distance: float = 0.0) -> None:
        """Send one robot a light pulse of 9 ticks at a tick; `distance` as in `flash`. At most 100 may wait.

        `tick` is at least LEAD_TICKS after the end of the last run. Raises ValueError if the robot has run past it.
        """
        strengths = [microvolts(counts(gain, distance)) for gain in (HIGH_GAIN_MM, LOW_GAIN_MM)]
        if self._functions["air_flash"](addressof(self._air), robot, tick, PULSE_TICKS, *strengths):
            raise ValueError(f"robot {robot} has run past tick {tick}: announce light {LEAD_TICKS} ticks ahead")

    def tick_of(self, robot: int, cycle: int) -> int:
        """Return the tick (125 ns) of the swarm's clock at a cycle of a robot's own clock."""
        return self._robots[robot].on_at + cycle * self._robots[robot].period // ONE_RATE

    def has_reached(self, robot: int, tick: int) -> bool:
        """Return whether a robot has run to `tick` (125 ns each)."""
        return self._robots[robot].reached >= tick

    def pulses_sent(self, robot: int) -> int:
        """Return the light pulses that a robot has sent since power-on."""
        return self._robots[robot].pulses

    def observe(self, robot: int, observation: Observation | None) -> None:
        """Run a robot instruction by instruction from now on; None: as the others. The result of a run is the same."""
        self._observed.pop(robot, None)
        if observation is not None:
            self._observed[robot] = observation
        self._robots[robot].observation = None if observation is None else addressof(observation)
        self._robots[robot].code = self.robots[robot].program.address

    @property
    def is_stopped(self) -> bool:
        """Whether an observed robot has ended the run: `reason` of its observation says why."""
        return bool(self._stopped())

    def _stopped(self) -> list[int]:
        """Return the robots that have ended the run."""
        return [robot for robot, observation in self._observed.items() if observation.reason != STOP_NONE]

    def run(self, seconds: float) -> None:
        """Run all robots for a time. Raises KilobotFaultError."""
        self.run_until(self.now + int(seconds * HZ))

    def run_until(self, tick: int) -> None:
        """Run all robots to `tick` (125 ns each), or until an observed one stops; `now` is then its tick.

        Raises KilobotFaultError; ValueError after too many calls of `light`.
        """
        self.now = tick
        while True:
            index = self._functions["air_run"](addressof(self._air), tick)
            if index < 0:
                break
            machine = self.robots[index]
            machine.attend()
            self._robots[index].code = machine.program.address
            self._attend(index)
            if self.is_stopped:
                break
        self.now = min([tick, *(self._robots[robot].reached for robot in self._stopped())])
        if self._air.lost_edges:
            raise ValueError("more pulses of light wait for a robot than there is room for")
        for index in range(len(self.robots)):
            self._attend(index)

    def _attend(self, index: int) -> None:
        """Attend a robot (`Atmega328p.attend`). Raises KilobotFaultError at a fault of a robot that is not stopped."""
        machine = self.robots[index]
        fault = machine.attend()
        if fault is not None and self._robots[index].reached != _STOPPED:
            place = machine.image.place(fault.pc)
            raise KilobotFaultError(index, f"{fault.message} at {place}, cycle {fault.cycle}")

    @property
    def _parts(self) -> list[tuple[int, int]]:
        """Addresses and sizes of everything that changes by a run, beside the robots and `now`."""
        parts = (self._robots, self._edges, self._links, self._acts, self._air)
        return [(addressof(part), sizeof(part)) for part in parts]

    def snapshot(self) -> bytes:
        """Return the state of all robots and of the light between them. It does not contain their positions."""
        light = [string_at(address, size) for address, size in self._parts]
        return b"".join([struct.pack("<Q", self.now), *light, *(one.snapshot() for one in self.robots)])

    def restore(self, snapshot: bytes) -> None:
        """Return to the state of a snapshot of this swarm; observations stay. Raises ValueError for other bytes."""
        if len(snapshot) != 8 + sum(size for _, size in self._parts) + sizeof(Avr) * len(self.robots):
            raise ValueError("these bytes are no snapshot of this swarm")
        (self.now,) = struct.unpack_from("<Q", snapshot)
        at = 8
        for address, size in self._parts:
            memmove(address, snapshot[at : at + size], size)
            at += size
        for index, machine in enumerate(self.robots):
            machine.restore(snapshot[at : at + sizeof(Avr)])
            at += sizeof(Avr)
            self._robots[index].code = machine.program.address
            self._robots[index].observation = None
        for robot, observation in list(self._observed.items()):
            self.observe(robot, observation)

    def close(self) -> None:
        """Do nothing: a swarm holds only memory. The method is for the `with` statement."""

    def __enter__(self) -> KilobotSwarm:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def set_up(
    machine: Atmega328p, number: int | None, *, calibrated: bool = True, duties: Sequence[int] = tuple(DUTIES.values())
) -> None:
    """Connect the parts of a Kilobot to a machine that was not started yet, and write its EEPROM.

    `number` is its UID, None for an erased one; `duties` are its calibrated motor duties in the order of DUTIES.
    """
    if number is not None:
        machine.write_eeprom(NUMBER_AT, struct.pack("<H", number))
    if calibrated:
        for address, duty in zip(DUTIES, duties, strict=True):
            machine.write_eeprom(address, bytes([duty]))
        for address, gain in ((LOW_GAIN_AT, LOW_GAIN_MM), (HIGH_GAIN_AT, HIGH_GAIN_MM)):
            table = [counts(gain, distance) for distance in CALIBRATED_MM]
            machine.write_eeprom(address, struct.pack(f">{len(table)}H", *table))
    state = machine.state
    state.emitters = EMITTERS
    state.aref_uv = AREF_UV
    state.noise_uv[ADC6] = BATTERY_NOISE_UV
    machine.set_analog(0, AIN1, THRESHOLD_UV)
    machine.set_analog(0, ADC6, BATTERY_UV)
    machine.set_pins(0, 2, 1, 1)  # PD0 high: not charging


@cache
def _code() -> dict[str, Callable[..., Any]]:
    """Return the functions of air.c."""
    text = "\n".join([TYPES, declaration(), '#line 1 "emu/boards/kilobot/air.c"',
                      Path(__file__).with_name("air.c").read_text("utf-8")])  # fmt: skip
    return functions_of(text, "air", {"air_run": (INT, (ADDRESS, INT)), "air_flash": (INT, (ADDRESS, *[INT] * 5)),
                                     "air_stop": (None, (ADDRESS, INT))})  # fmt: skip
