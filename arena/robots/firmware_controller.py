"""`EmulatedBrain`: the firmware itself, on an emulated e-puck, joined to the world through pins, volts and pixels.

In: poses once per quantum, pixels whenever the firmware's camera driver reads a line. Out: motor steps, LEDs, lines of
UART1 (Bluetooth). Poses are extrapolated within the quantum to the cycle in which a line is read.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from greenlet import getcurrent, greenlet
from numpy.typing import NDArray

import emu
from arena.camera.appearance import colours_of
from arena.camera.renderer import Sight
from arena.infrared.channel import LINES, Ether
from arena.infrared.ring import Ring
from arena.robots.controller import STRIP_COLUMNS, STRIP_PIXELS, Lights, Line, Reading, switched_on, told_at
from arena.robots.native_robot import Ahead
from arena.scene.loader import FCY, BatterySetting, Scene
from arena.world.physics import STREAM_SENSORS, Poses, generator, traits_of
from arena.world.wheels import Wheels
from emu.boards.epuck.board import Epuck
from emu.boards.epuck.camera.scan import LINE_PIXELS
from emu.boards.epuck.camera.sensors import WIDTH
from emu.boards.epuck.remote import REPEAT_SECONDS
from emu.boards.epuck.simple import LED_PINS, Battery
from emu.boards.epuck.stimulus import parse
from emu.machine.fault_report import VECNUM
from emu.system.native_handle import Call

PROBE_TCY: Final = 147_456
"""Mean time between two looks at whether the CPU is idle, at random cycles: 10 ms, 90,000 looks in 15 minutes."""
LINE_LIMIT: Final = 200
"""Bytes after which a line without an end is taken as one."""
LIGHTS_LIMIT: Final = 100
"""Changes of the LEDs kept per sample: a firmware may dim them by switching fast."""
CUTS_KEPT: Final = 64
"""Ends of quanta after which the wheels' speeds are told though the world does not wait for them: the motors remember
4096 steps."""
STUCK_TCY: Final = FCY // 10
"""A trap's handler that is at work longer does not come back."""
_ENABLES: Final = ("IEC0", "IEC1", "IEC2")
_TRAP_BIT: Final = 3
"""IPL3 of CORCON: a trap is being handled (isa.md §14.4)."""
FULL_VOLTS: Final = 4.2
"""epuck.md §6."""
_STRIP_ROWS: Final = range(232, 249)
"""Rows of the whole picture that count as its middle."""
_NOISE_BITS: Final = 14
"""2^14 values of pixel noise are drawn once per robot; each line of pixels starts at a random one."""
_DRAWN_BITS: Final = 32
_DRAWN_MASK: Final = (1 << _DRAWN_BITS) - 1


LookAt = Callable[[int], tuple[Poses, Poses]]
"""look_at(tick): poses at the beginning of a quantum, and a quantum before."""
Ride = Callable[[], int]
"""ride(): native code run by whoever runs all robots; what it came back for. Only in the robot's own greenlet."""


class EmulatedBrain:
    """A machine with `image` (ELF or HEX), switched on at its own moment; `selector` is the switch's position, `ether`
    what the robots of a trial share to see each other's infrared emitters.

    Raises emu.LoadError for an unusable image.
    """

    def __init__(
        self, scene: Scene, seed: int, robot: int, image: str | Path, selector: int = 0, ether: Ether | None = None
    ) -> None:
        self._scene = scene
        self._robot = robot
        self._quantum = scene.clock.quantum_tcy
        self._off_tick = scene.off_tick(robot)
        self._on_at = switched_on(scene, seed, robot)
        self._rng = generator(seed, STREAM_SENSORS, robot)
        self._sight = Sight(scene, robot, traits_of(scene, seed, robot))
        self._colours = colours_of(scene).astype(np.int16)
        self._colours_at: Final = self._colours.ctypes.data
        noise = self._rng.normal(0.0, scene.camera.pixel_noise, (1 << _NOISE_BITS) + 3 * WIDTH)
        drawn: NDArray[np.int16] = np.rint(noise).astype(np.int16)
        self._noise: Final = np.append(drawn, drawn[: 3 * (LINE_PIXELS - WIDTH)])  # a window may be wider
        self._noise_at: Final = self._noise.ctypes.data
        generating = self._rng.bit_generator.ctypes  # its upper bits are what `integers` gives for a power of two
        self._draw, self._drawn_from = generating.next_uint32, generating.state
        board = partial(Epuck, camera=scene.camera.sensor, selector=selector, seed=seed * 1000 + robot)
        self.machine = emu.load(image, board=board)
        self._board: Epuck = self.machine.board
        assert self._board.camera is not None
        self._board.camera.lamp = scene.light.brightness
        self._sees_leds: Final = scene.camera.sees_leds
        self._board.camera.sample(self._pixels, is_lent=not self._sees_leds)
        self._begin(scene)
        self.machine.uart[1].listen(self._byte, lazy=True)
        self._ether: Final = ether or Ether.of(scene)
        self._ring = Ring(scene, seed, self._board, self._ether, robot, self._on_at)
        self._poses = self._before = Poses([], [])
        self._start = 0
        self._looked = -1
        self._look_at: LookAt | None = None
        self.lived = 0
        """Quanta that are over for this robot."""
        self._cuts: list[int] = []
        self._first_cut = 0
        self.wheels: Final = Wheels(self._quantum)
        self._board.motors.remember()
        self.ahead: Final = Ahead(
            quantum=self._quantum, on_at=self._on_at, probe_at=1, stuck_at=-1, probe_span=2 * PROBE_TCY, kept=CUTS_KEPT,
            first_strip=_STRIP_ROWS.start, last_strip=_STRIP_ROWS.stop - 1, strip=-1, colours=self._colours_at,
            noise=self._noise_at, noise_shift=_DRAWN_BITS - _NOISE_BITS,
        )  # fmt: skip
        """What compiled code knows of the robot; Python and it go on with the same looks at the CPU."""
        self.ahead.join(self._board, self._sight, self.wheels, self._draw, self._drawn_from)
        self._ride: Ride | None = None
        self.is_native = True
        """Whether native code is run as `lend` says. Not beside a debugged robot: where that stands in the middle of a
        quantum, it shows how far the others have come, and that depends on who runs them."""
        self._life: greenlet | None = None
        """Where it lives."""
        self._enables: Final = tuple(self.machine.chip.sfrs[name].address >> 1 for name in _ENABLES)
        self._lights: list[Lights] = []
        self._leds = 0
        for bit, pin in enumerate(LED_PINS.values()):
            self.machine.peripherals.pins.watch(pin, partial(self._lit, bit), lazy=not self._sees_leds)
        self._strip: tuple[NDArray[np.intp], NDArray[np.uint8]] | None = None
        self._said: list[Line] = []
        self._text = bytearray()
        self._spoken: bytearray | None = None
        self._text_at = 0
        self._fault = ""
        self._patience = scene.start.silent_s * FCY
        self._active_at = 0
        self._steps = (0, 0)
        self._told = ""

    def _begin(self, scene: Scene) -> None:
        """What is done to the robot from outside (`scene.Start`)."""
        start = scene.start_of(self._robot)
        if start.remote:
            key = int(start.remote) if start.remote.isdecimal() else start.remote
            frames = 1 + int(start.remote_held_s / REPEAT_SECONDS)
            period = round(REPEAT_SECONDS * FCY)
            missed = max(math.ceil((self._on_at - told_at(scene)) / period), 0)  # sent before the robot had power
            if missed < frames:
                first = told_at(scene) + missed * period - self._on_at
                self._board.remote.press(key, cycle=first, repeat=frames - missed)
        if start.stimulus:
            steps = parse(self._board, start.stimulus, f"{scene.name}: start.stimulus")
            self._board.stimulus.play([replace(step, cycle=max(step.cycle - self._on_at, 0)) for step in steps])

    # -- one quantum -------------------------------------------------------------------------------------------------

    def think(self, tick: int, poses: Poses) -> tuple[float, float]:
        """As `Brain.think`."""
        self.lived = tick
        if self._end_of(tick) > 0 and not self._fault and tick < self._off_tick:
            self._see(tick, poses, self._poses if self._poses.counts[0] else poses)
        self.live(tick + 1)
        return self.speed(tick)

    def join(self, look_at: LookAt) -> None:
        """Ask for poses from now on, when they are looked at, instead of being told them by `think`."""
        self._look_at = look_at
        self._ring.look = self._sense_first

    def lend(self, ride: Ride) -> None:
        """Let native code be run by `ride` from now on, where there is any."""
        self._ride = ride
        self.ahead.run_by(self.machine.lend(self._run_native))

    def _run_native(self, call: Call, record: int, env: int) -> int:
        """Native code is to be run: what compiled code is to know before. Who runs it elsewhere than in the robot's
        life (a debugger, its past) runs it alone."""
        if not self.is_native or getcurrent() is not self._life:
            return call(record, env)
        ahead = self.ahead
        ahead.taken = self._first_cut + len(self._cuts)
        if ahead.told < ahead.taken:
            self._settle()
        ahead.pair = self._board.motors.lend()
        assert self._ride is not None
        return self._ride()

    @property
    def has_stopped(self) -> bool:
        """Whether the firmware has stopped for good."""
        return bool(self._fault)

    def speed(self, tick: int) -> tuple[float, float]:
        """Wheel speeds (left, right) in cm/s during a quantum that is over; asked for once."""
        return self.wheels.speed(tick)

    def live(self, ticks: int) -> None:
        """Live until so many quanta are over. A robot whose infrared sensors are read sees every one of them begin."""
        self._life = getcurrent()
        while self.lived < ticks:
            if self.lived == self._off_tick:
                self._go_dark()
            if self.lived >= self._off_tick or self._fault or self._end_of(self.lived) <= 0:
                self.wheels.rested(self.lived)
                self.lived += 1
            elif self._look_at is not None and self._ring.is_read:
                self._settle()
                self._see(self.lived, *self._look_at(self.lived))
                self._run(self.lived + 1)
            else:
                self._run(min(ticks, self._off_tick))
        self._settle()

    def _go_dark(self) -> None:
        """The battery has been taken out: emitters and LEDs go off."""
        now = max(self._off_tick * self._quantum, self._on_at + self.machine.cycle)
        for line in range(LINES + len(LED_PINS)):
            self._ether.switch(self._robot, now, line, False)
        if self._leds:
            self._leds = 0
            self._lights.append(Lights(now, 0))

    def _end_of(self, tick: int) -> int:
        """Cycle of the machine in which a quantum ends."""
        return (tick + 1) * self._quantum - self._on_at

    def _run(self, ticks: int) -> None:
        """Run until so many quanta are over, or to the next probe."""
        machine, ahead = self.machine, self.ahead
        if ahead.told >= self._first_cut + len(self._cuts) or len(self._cuts) >= CUTS_KEPT:
            self._settle()
            self._cuts, self._first_cut, ahead.told = [], self.lived, self.lived
        ahead.end = self._end_of(ticks - 1)
        last = min(ahead.probe_at, ahead.end)
        stop = machine.run_past(self._end_of(self.lived), self._quantum, last, self._cuts)
        self.lived = self._first_cut + len(self._cuts)
        if stop is not None:
            place = f"{stop.reason} at {stop.pc:#08x} in cycle {stop.cycle}"
            said = f"stopped: {place}: {stop.fault.cause if stop.fault else stop.detail}".rstrip(":, ")
            self._fault = self._told if self._told and machine.is_asleep else said
            return
        reached = machine.cycle
        if reached >= ahead.probe_at:
            ahead.probes += 1
            ahead.busy += not machine.is_asleep
            self._watch()
            ahead.probe_at = reached + 1 + self._below(2 * PROBE_TCY)

    def _below(self, end: int) -> int:
        """What `integers(end)` of the generator would draw next: Lemire's method on 32 bits."""
        while True:
            drawn: int = self._draw(self._drawn_from) * end
            if (drawn & _DRAWN_MASK) >= (1 << _DRAWN_BITS) % end:
                return drawn >> _DRAWN_BITS

    def _settle(self) -> None:
        """Tell the speeds of the wheels in quanta that are over, before the world goes on: by the steps made then."""
        told = self.ahead.told
        new = self._cuts[told - self._first_cut :]
        if new:
            self.ahead.told += len(new)
            self.wheels.turned(told, self._board.motors.steps_by(new))

    def _see(self, tick: int, poses: Poses, before: Poses) -> None:
        """A quantum begins with `poses`; `before` are those a quantum ago."""
        self._looked, self._start = tick, tick * self._quantum - self._on_at
        self._poses, self._before = poses, before if self._end_of(tick - 1) > 0 else poses
        self._ring.move(poses)

    def _sense_first(self) -> Poses:
        """The firmware reads its infrared sensors for the first time: from now on every quantum is seen to begin."""
        self.machine.end_at_cut()
        return self._look_now()

    def _look_now(self) -> Poses:
        """Poses of the quantum in which the firmware looks at something, in the middle of a run. Of a robot that has
        no power yet, no more, or has stopped, somebody outside looks: at the world as it is for the others."""
        if self._look_at is not None:
            tick = self._first_cut + len(self.machine.cuts_so_far())
            if tick < self.lived:
                self._looked, self._start = self.lived, self.machine.cycle
                self._poses = self._before = self._look_at(self.lived)[0]
            elif tick != self._looked:
                self._settle()
                poses, before = self._look_at(tick)
                self._looked, self._start = tick, tick * self._quantum - self._on_at
                self._poses, self._before = poses, before if self._end_of(tick - 1) > 0 else poses
        return self._poses

    def _watch(self) -> None:
        """Notice firmware that does nothing more: it sits in a trap's handler, or sleeps and nothing can wake it."""
        machine = self.machine
        why = ""
        if machine.state.corcon >> _TRAP_BIT & 1:
            trap = machine.chip.vectors[machine.peek("INTTREG") & VECNUM].name
            why = f"sits in the handler of {trap}"
        elif machine.is_asleep and not any(machine.record.u16[word] for word in self._enables):
            why = "sleeps with every interrupt off"
        if not why:
            self.ahead.stuck_at = -1
        elif self.ahead.stuck_at < 0:
            self.ahead.stuck_at = machine.cycle
        elif not self._told.startswith(why) and machine.cycle - self.ahead.stuck_at > STUCK_TCY:
            where = f" in {machine.image.symbols.text(machine.pc)}" if machine.image else ""
            fault = machine.stopped("halt").fault
            why += f": {fault.cause.rstrip(',')}" if fault is not None else ""
            self._told = f"{why} since {(self.ahead.stuck_at + self._on_at) / FCY:.2f} s, at {machine.pc:#08x}{where}"

    def _listen(self) -> None:
        """Notice firmware that nothing is seen or heard of."""
        if self.lived >= self._off_tick:
            return
        now = self.machine.cycle
        steps = self._board.motors.steps()
        if steps != self._steps or self._lights or self._said or self._text:
            self._active_at, self._steps = now, steps
        elif not self._told and now - self._active_at > self._patience:
            since = (self._active_at + self._on_at) / FCY
            self._told = f"is silent: no motor step, LED or byte since {since:.1f} s"

    # -- what the firmware reads and says ----------------------------------------------------------------------------

    def _pixels(self, y: int, columns: NDArray[np.intp], cycle: int) -> NDArray[np.uint8]:
        self._look_now()
        if self._sees_leds:
            self._sight.leds[:] = [self._ether.leds(other, self._on_at + cycle) for other in range(self._ether.robots)]
        noise = self._noise_at + self._noise.itemsize * (self._draw(self._drawn_from) >> _DRAWN_BITS - _NOISE_BITS)
        quanta = (cycle - self._start) / self._quantum
        pixels = self._sight.line(self._poses, self._before, quanta, y, columns, self._colours_at, noise)
        self._take_strip()  # before the camera's setting becomes another
        if y in _STRIP_ROWS:
            self._strip = columns, pixels
        if self._ride is not None:
            self.ahead.know(y, self._sight.fan(y, columns))
        return pixels

    def _byte(self, byte: int, cycle: int) -> None:
        if self._spoken is not None:
            self._spoken.append(byte)
        if byte in b"\r\n" or len(self._text) >= LINE_LIMIT:
            if self._text:
                self._said.append(Line(self._text_at, self._text.decode("ascii", "backslashreplace")))
            self._text.clear()
        if byte not in b"\r\n":
            if not self._text:
                self._text_at = self._on_at + cycle
            self._text.append(byte)

    def _lit(self, led: int, cycle: int, changed: int, levels: int) -> None:
        """Changes in one cycle are one. What is run again has been noted."""
        if self.machine.events.quiet:
            return
        if self._sees_leds:
            self._ether.switch(self._robot, self._on_at + cycle, LINES + led, bool(levels & changed))
        self._leds = self._leds | 1 << led if levels & changed else self._leds & ~(1 << led)
        if self._lights and self._lights[-1].cycle == self._on_at + cycle:
            self._lights.pop()
        if len(self._lights) < LIGHTS_LIMIT:
            self._lights.append(Lights(self._on_at + cycle, self._leds))

    # -- what is recorded --------------------------------------------------------------------------------------------

    def reading(self) -> Reading:
        """As `Brain.reading`. `load` comes from looking at the CPU at random cycles."""
        self.machine.peripherals.pins.flush()
        self._listen()
        self._board.battery.volts = volts_after(self._scene.battery, self.machine.cycle / FCY)
        self._take_strip()
        ahead = self.ahead
        load = ahead.busy / ahead.probes if ahead.probes else 0.0
        ahead.busy = ahead.probes = 0
        strip = strip_of(*self._strip) if self._strip is not None else b""
        return Reading(-1, load, self._leds, strip, self._ring.readings, self._fault or self._told)

    def _take_strip(self) -> None:
        """Take over the last line that is recorded, if compiled code has painted it."""
        if (fan := self.ahead.last_strip_fan) is not None and fan.columns is not None:
            self._strip = fan.columns, fan.pixels

    def lines(self) -> list[Line]:
        """As `Brain.lines`."""
        said, self._said = self._said, []
        return said

    def lights(self) -> list[Lights]:
        """As `Brain.lights`."""
        changed, self._lights = self._lights, []
        return changed

    def tell(self, data: bytes) -> None:
        """As `Brain.tell`: into UART1, byte after byte at its rate."""
        self.machine.uart[1].feed(data)

    def spoken(self) -> bytes:
        """As `Brain.spoken`."""
        said = bytes(self._spoken or b"")
        self._spoken = bytearray()
        return said

    def close(self) -> None:
        """Memory goes with the object."""


def volts_after(battery: BatterySetting, seconds: float) -> float:
    """Voltage after so long, never under 3.0 V, where the robot's own protection would end it."""
    return max(battery.volts - (FULL_VOLTS - Battery.LOW_VOLTS) * seconds / 3600 / battery.hours, 3.0)


def strip_of(columns: NDArray[np.intp], pixels: NDArray[np.uint8]) -> bytes:
    """At most STRIP_PIXELS of the pixels of a line that lie in the middle of the picture, left to right."""
    middle = np.flatnonzero((columns >= STRIP_COLUMNS.start) & (columns < STRIP_COLUMNS.stop))
    order = middle[np.argsort(columns[middle], kind="stable")]
    count = min(len(order), STRIP_PIXELS)
    return pixels[order[np.arange(count) * len(order) // max(count, 1)]].tobytes()
