"""`FirmwareController`: firmware on an emulated e-puck, connected to the world through pins, voltages and pixels.

Input: poses once per quantum, pixels whenever the firmware's camera driver reads a line. Output: motor steps, LEDs and
lines on UART1 (Bluetooth). Poses are extrapolated within the quantum to the cycle in which a line is read.
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
from arena.camera.renderer import Renderer
from arena.infrared.channel import LINES, OpticalChannel
from arena.infrared.ring import InfraredRing
from arena.robots.controller import (
    STRIP_COLUMNS,
    STRIP_PIXELS,
    LedChange,
    Reading,
    SerialLine,
    power_on_cycle,
    remote_key_cycle,
)
from arena.robots.native_robot import NativeRobot
from arena.robots.robot_control import RobotControl
from arena.scene.loader import FCY, BatterySetting, Scene
from arena.world.physics import STREAM_SENSORS, generator, traits_of
from arena.world.poses import Poses
from arena.world.wheels import Wheels
from emu.boards.epuck.board import Epuck
from emu.boards.epuck.camera.scan import LINE_PIXELS
from emu.boards.epuck.camera.sensors import WIDTH
from emu.boards.epuck.remote import REPEAT_SECONDS
from emu.boards.epuck.simple import LED_PINS, Battery
from emu.boards.epuck.stimulus import parse
from emu.debug.fault_report import VECNUM
from emu.machine.machine import Machine
from emu.system.native_handle import Call

PROBE_TCY: Final = 147_456
"""Mean time between two CPU probes, which come at random cycles: 10 ms, 90,000 probes in 15 minutes."""
LINE_LIMIT: Final = 200
"""Bytes after which a line without a line end is cut."""
LED_CHANGES_LIMIT: Final = 100
"""LED changes kept per sample. Firmware may dim LEDs by switching them fast."""
REPORT_AFTER: Final = 64
"""Quanta after which motor steps are reported to the wheels even if the world does not wait for them: the motors keep
4096 steps."""
STUCK_TCY: Final = FCY // 10
"""Time after which a trap handler counts as stuck."""
_TRAP_BIT: Final = 3
"""IPL3 of CORCON: the CPU is handling a trap (isa.md §14.4)."""
FULL_VOLTS: Final = 4.2
"""Voltage of a full battery (epuck.md §6)."""
_STRIP_ROWS: Final = range(232, 249)
"""Rows of the whole picture: of those that the firmware reads, the last one is recorded."""
_NOISE_BITS: Final = 14
"""2^14 values of pixel noise are drawn once per robot. Each camera line starts at a random one of them."""
_DRAWN_BITS: Final = 32
_DRAWN_MASK: Final = (1 << _DRAWN_BITS) - 1


PosesAt = Callable[[int], tuple[Poses, Poses]]
"""poses_at(tick): the poses at the start of quantum `tick` and of the quantum before."""
NativeRunner = Callable[[], int]
"""run_native(): let the scheduler run the native code; return the exit reason. For the robot's own greenlet only."""


class FirmwareController:
    """A machine with `image` (ELF or HEX) that is powered on at a time of its own.

    `selector` is the position of the selector switch. `channel` carries the light between the robots of a trial.
    Raises emu.LoadError for an unusable image.
    """

    def __init__(
        self,
        scene: Scene,
        seed: int,
        robot: int,
        image: str | Path,
        selector: int = 0,
        channel: OpticalChannel | None = None,
    ) -> None:
        self._scene = scene
        self._robot = robot
        self._quantum = scene.clock.quantum_tcy
        self._off_tick = scene.off_tick(robot)
        self._on_at = power_on_cycle(scene, seed, robot)
        self._rng = generator(seed, STREAM_SENSORS, robot)
        self._renderer = Renderer(scene, robot, traits_of(scene, seed, robot))
        self._colours = colours_of(scene).astype(np.int16)
        self._colours_at: Final = self._colours.ctypes.data
        self._noise: Final = _pixel_noise(self._rng, scene.camera.pixel_noise)
        self._noise_at: Final = self._noise.ctypes.data
        bits = self._rng.bit_generator.ctypes  # the upper bits are what `integers` returns for a power of two
        self._draw, self._drawn_from = bits.next_uint32, bits.state
        board = partial(Epuck, camera=scene.camera.sensor, selector=selector, seed=seed * 1000 + robot)
        self.machine = emu.load(image, board=board)
        self.control: RobotControl = self.machine
        """Object that runs the machine. A debugger that controls the robot takes its place."""
        self._board: Epuck = self.machine.board
        assert self._board.camera is not None
        self._board.camera.lamp = scene.light.brightness
        self._sees_leds: Final = scene.camera.sees_leds
        self._board.camera.show_pixels(self._pixels, has_native_source=not self._sees_leds)
        self._schedule_inputs(scene)
        self.machine.uart[1].listen(self._on_uart_byte, lazy=True)
        self._channel: Final = channel or OpticalChannel.of(scene)
        self._ring = InfraredRing(scene, seed, self._board, self._channel, robot, self._on_at)
        self._poses = self._before = Poses([], [])
        self._start = 0
        self._poses_tick = -1
        self._poses_at: PosesAt | None = None
        self.ticks_done = 0
        """Quanta this robot has finished."""
        self._quantum_ends: list[int] = []
        self._first_quantum = 0
        self.wheels: Final = Wheels(self._quantum)
        self._board.motors.record_history()
        self.native: Final = NativeRobot(
            quantum=self._quantum, on_at=self._on_at, probe_at=1, stuck_since=-1, probe_span=2 * PROBE_TCY,
            report_after=REPORT_AFTER, strip_first=_STRIP_ROWS.start, strip_last=_STRIP_ROWS.stop - 1,
            last_strip_row=-1, sensed_tick=-1, colours=self._colours_at, noise=self._noise_at,
            noise_shift=_DRAWN_BITS - _NOISE_BITS,
        )  # fmt: skip
        """The robot as native code sees it. Python and native code share its sequence of CPU probes."""
        self.native.connect(self._board, self._renderer, self.wheels, self._ring, self._draw, self._drawn_from)
        self._native_runner: NativeRunner | None = None
        self.is_native = True
        """Whether the scheduler runs native code. False while a robot of the trial is debugged: its breakpoints are in
        the middle of a quantum, and there the progress of the other robots depends on what runs them."""
        self._greenlet: greenlet | None = None
        """The greenlet that executes `run_until`."""
        self._led_changes: list[LedChange] = []
        self._leds = 0
        for bit, pin in enumerate(LED_PINS.values()):
            self.machine.peripherals.pins.watch(pin, partial(self._on_led, bit), lazy=not self._sees_leds)
        self._strip: tuple[NDArray[np.intp], NDArray[np.uint8]] | None = None
        self._lines: list[SerialLine] = []
        self._line_bytes = bytearray()
        self._uart_output: bytearray | None = None
        self._line_cycle = 0
        self._fault = ""
        self._patience = scene.start.silent_s * FCY
        self._active_at = 0
        self._steps = (0, 0)
        self._fault_text = ""

    def _schedule_inputs(self, scene: Scene) -> None:
        """Schedule the key of the remote control and the stimulus script of the scene (`scene.Start`)."""
        start = scene.start_of(self._robot)
        if start.remote:
            key = int(start.remote) if start.remote.isdecimal() else start.remote
            frames = 1 + int(start.remote_held_s / REPEAT_SECONDS)
            period = round(REPEAT_SECONDS * FCY)
            before_power = self._on_at - remote_key_cycle(scene)
            missed = max(math.ceil(before_power / period), 0)  # frames sent before the robot had power
            if missed < frames:
                first = remote_key_cycle(scene) + missed * period - self._on_at
                self._board.remote.press(key, cycle=first, repeat=frames - missed)
        if start.stimulus:
            steps = parse(self._board, start.stimulus, f"{scene.name}: start.stimulus")
            self._board.stimulus.play([replace(step, cycle=max(step.cycle - self._on_at, 0)) for step in steps])

    # -- one quantum -------------------------------------------------------------------------------------------------

    def control_step(self, tick: int, poses: Poses) -> tuple[float, float]:
        """As `Controller.control_step`."""
        self.ticks_done = tick
        if self._end_of(tick) > 0 and not self._fault and tick < self._off_tick:
            self._begin_quantum(tick, poses, self._poses if self._poses.counts[0] else poses)
        self.run_until(tick + 1)
        return self.speed(tick)

    def use_poses(self, poses_at: PosesAt) -> None:
        """Take poses from `poses_at` from now on, when the firmware observes the world, not from `control_step`."""
        self._poses_at = poses_at
        self._ring.poses_source = self._begin_sensing
        self.machine.peripherals.adc.inputs_come_later = True

    def use_native_runner(self, run_native: NativeRunner) -> None:
        """Run native code by `run_native` from now on, if the machine has native code."""
        self._native_runner = run_native
        self.native.attach(self.machine.attach_runner(self._run_native))

    def _run_native(self, call: Call, record: int, env: int) -> int:
        """Update the fields that the scheduler needs and let it run native code; return the exit reason.

        Outside the robot's greenlet (a debugger that replays the past) `call` runs it directly.
        """
        if not self.is_native or getcurrent() is not self._greenlet:
            return call(record, env)
        native = self.native
        native.quanta_taken = self._first_quantum + len(self._quantum_ends)
        if native.quanta_reported < native.quanta_taken:
            self._report_steps()
        native.pair = self._board.motors.native_pair()
        assert self._native_runner is not None
        return self._native_runner()

    @property
    def has_stopped(self) -> bool:
        """Whether the firmware has stopped after a fault."""
        return bool(self._fault)

    def speed(self, tick: int) -> tuple[float, float]:
        """Return the wheel speeds (left, right) in cm/s during a finished quantum."""
        return self.wheels.speed(tick)

    def run_until(self, ticks: int) -> None:
        """Run until `ticks` quanta are finished. A robot that reads its infrared sensors takes the poses of each."""
        self._greenlet = getcurrent()
        while self.ticks_done < ticks:
            if self.ticks_done == self._off_tick:
                self._switch_off()
            if self.ticks_done >= self._off_tick or self._fault or self._end_of(self.ticks_done) <= 0:
                self.wheels.set_stopped(self.ticks_done)
                self.ticks_done += 1
            else:
                if self._poses_at is not None and self._ring.is_read and self.native.sensed_tick != self.ticks_done:
                    self._report_steps()
                    self._begin_quantum(self.ticks_done, *self._poses_at(self.ticks_done))
                    self.native.senses, self.native.sensed_tick = True, self.ticks_done
                self._run(min(ticks, self._off_tick))
        self._report_steps()

    def _switch_off(self) -> None:
        """Switch off all emitters and LEDs: the battery has been removed."""
        now = max(self._off_tick * self._quantum, self._on_at + self.machine.cycle)
        for line in range(LINES + len(LED_PINS)):
            self._channel.switch(self._robot, now, line, False)
        if self._leds:
            self._leds = 0
            self._led_changes.append(LedChange(now, 0))

    def _end_of(self, tick: int) -> int:
        """Return the machine cycle at which a quantum ends."""
        return (tick + 1) * self._quantum - self._on_at

    def _run(self, ticks: int) -> None:
        """Run until `ticks` quanta are finished, the next CPU probe is due, or infrared sensors need new poses."""
        machine, native = self.machine, self.native
        ends = len(self._quantum_ends)
        if native.quanta_reported >= self._first_quantum + ends or ends >= REPORT_AFTER:
            self._report_steps()
            self._quantum_ends, self._first_quantum, native.quanta_reported = [], self.ticks_done, self.ticks_done
        native.end = self._end_of(ticks - 1)
        last = min(native.probe_at, self._end_of(self.ticks_done) if native.senses else native.end)
        stop = self.control.run_past(self._end_of(self.ticks_done), self._quantum, last, self._quantum_ends)
        self.ticks_done = self._first_quantum + len(self._quantum_ends)
        if stop is not None:
            place = f"{stop.reason} at {stop.pc:#08x} in cycle {stop.cycle}"
            text = f"stopped: {place}: {stop.fault.cause if stop.fault else stop.detail}".rstrip(":, ")
            self._fault = self._fault_text if self._fault_text and machine.is_asleep else text
            return
        reached = machine.cycle
        if reached >= native.probe_at:
            native.probes += 1
            native.busy_probes += not machine.is_asleep
            self._detect_stuck()
            native.probe_at = reached + 1 + self._random_below(2 * PROBE_TCY)

    def _random_below(self, end: int) -> int:
        """Return the number that `integers(end)` of the generator would draw next: Lemire's method on 32 bits."""
        while True:
            drawn: int = self._draw(self._drawn_from) * end
            if (drawn & _DRAWN_MASK) >= (1 << _DRAWN_BITS) % end:
                return drawn >> _DRAWN_BITS

    def _report_steps(self) -> None:
        """Report the motor steps of finished quanta to the wheels, before the world advances."""
        reported = self.native.quanta_reported
        new = self._quantum_ends[reported - self._first_quantum :]
        if new:
            self.native.quanta_reported += len(new)
            self.wheels.add_steps(reported, self._board.motors.steps_by(new))

    def _begin_quantum(self, tick: int, poses: Poses, before: Poses) -> None:
        """Begin a quantum with `poses`; `before` are the poses one quantum earlier."""
        self._poses_tick, self._start = tick, tick * self._quantum - self._on_at
        self._poses, self._before = poses, before if self._end_of(tick - 1) > 0 else poses
        self._ring.begin_quantum(poses, self._before)

    def _begin_sensing(self) -> Poses:
        """Return the poses of the quantum in which the firmware reads its infrared sensors.

        At the first reading the run ends with this quantum. From the next one on, `run_until` takes the poses of each.
        """
        if not self._ring.is_read:
            self.control.end_at_cut()
        return self._current_poses()

    def _current_poses(self) -> Poses:
        """Return the poses of the quantum in which the firmware observes the world, in the middle of a run.

        A robot without power or with stopped firmware can only be observed from outside. It shows the current world.
        """
        if self._poses_at is not None:
            tick = self._first_quantum + len(self.control.cuts_so_far())
            if tick < self.ticks_done:
                self._poses_tick, self._start = self.ticks_done, self.machine.cycle
                self._poses = self._before = self._poses_at(self.ticks_done)[0]
            elif tick != self._poses_tick:
                self._report_steps()
                poses, before = self._poses_at(tick)
                self._poses_tick, self._start = tick, tick * self._quantum - self._on_at
                self._poses, self._before = poses, before if self._end_of(tick - 1) > 0 else poses
        return self._poses

    def _detect_stuck(self) -> None:
        """Report firmware that stays in a trap handler."""
        machine, native = self.machine, self.native
        if not machine.state.corcon >> _TRAP_BIT & 1:
            native.stuck_since = -1
            return
        why = f"sits in the handler of {machine.chip.vectors[machine.peek('INTTREG') & VECNUM].name}"
        if native.stuck_since < 0:
            native.stuck_since = machine.cycle
        elif not self._fault_text.startswith(why) and machine.cycle - native.stuck_since > STUCK_TCY:
            where = f" in {machine.image.symbols.text(machine.pc)}" if machine.image else ""
            fault = machine.stopped("halt").fault
            why += f": {fault.cause.rstrip(',')}" if fault is not None else ""
            since = (native.stuck_since + self._on_at) / FCY
            self._fault_text = f"{why} since {since:.2f} s, at {machine.pc:#08x}{where}"

    def _detect_silence(self) -> None:
        """Report firmware without any output for `start.silent_s`."""
        if self.ticks_done >= self._off_tick:
            return
        now = self.machine.cycle
        steps = self._board.motors.steps()
        if steps != self._steps or self._led_changes or self._lines or self._line_bytes:
            self._active_at, self._steps = now, steps
        elif not self._fault_text and now - self._active_at > self._patience:
            since = (self._active_at + self._on_at) / FCY
            self._fault_text = f"is silent: no motor step, LED or byte since {since:.1f} s"

    # -- inputs and outputs of the firmware --------------------------------------------------------------------------

    def _pixels(self, y: int, columns: NDArray[np.intp], cycle: int) -> NDArray[np.uint8]:
        """Return red, green and blue of a camera line, with noise."""
        self._current_poses()
        if self._sees_leds:
            self._renderer.leds[:] = [
                self._channel.leds(other, self._on_at + cycle) for other in range(self._channel.robots)
            ]
        noise = self._noise_at + self._noise.itemsize * (self._draw(self._drawn_from) >> _DRAWN_BITS - _NOISE_BITS)
        quanta = (cycle - self._start) / self._quantum
        pixels = self._renderer.render_line(self._poses, self._before, quanta, y, columns, self._colours_at, noise)
        self._update_strip()  # before the setting of the camera changes
        if y in _STRIP_ROWS:
            self._strip = columns, pixels
        if self._native_runner is not None:
            self.native.set_row_rays(y, self._renderer.row_rays(y, columns))
        return pixels

    def _on_uart_byte(self, byte: int, cycle: int) -> None:
        """Keep a byte that the firmware has sent on UART1, as output and as part of a line."""
        if self._uart_output is not None:
            self._uart_output.append(byte)
        if byte in b"\r\n" or len(self._line_bytes) >= LINE_LIMIT:
            if self._line_bytes:
                self._lines.append(SerialLine(self._line_cycle, self._line_bytes.decode("ascii", "backslashreplace")))
            self._line_bytes.clear()
        if byte not in b"\r\n":
            if not self._line_bytes:
                self._line_cycle = self._on_at + cycle
            self._line_bytes.append(byte)

    def _on_led(self, led: int, cycle: int, changed: int, levels: int) -> None:
        """Keep a change of an LED. Changes in one cycle become one; a replay of the past adds none."""
        if self.machine.events.quiet:
            return
        if self._sees_leds:
            self._channel.switch(self._robot, self._on_at + cycle, LINES + led, bool(levels & changed))
        self._leds = self._leds | 1 << led if levels & changed else self._leds & ~(1 << led)
        if self._led_changes and self._led_changes[-1].cycle == self._on_at + cycle:
            self._led_changes.pop()
        if len(self._led_changes) < LED_CHANGES_LIMIT:
            self._led_changes.append(LedChange(self._on_at + cycle, self._leds))

    # -- values for the record ---------------------------------------------------------------------------------------

    def reading(self) -> Reading:
        """As `Controller.reading`. `load` is the share of CPU probes that found the CPU awake."""
        self.machine.peripherals.pins.flush()
        self._detect_silence()
        self._board.battery.volts = volts_after(self._scene.battery, self.machine.cycle / FCY)
        self._update_strip()
        native = self.native
        load = native.busy_probes / native.probes if native.probes else 0.0
        native.busy_probes = native.probes = 0
        strip = strip_of(*self._strip) if self._strip is not None else b""
        return Reading(-1, load, self._leds, strip, self._ring.readings, self._fault or self._fault_text)

    def _update_strip(self) -> None:
        """Copy the last recorded line if native code has rendered it."""
        if (rays := self.native.take_strip_rays()) is not None and rays.columns is not None:
            self._strip = rays.columns, rays.pixels

    def take_lines(self) -> list[SerialLine]:
        """As `Controller.take_lines`."""
        lines, self._lines = self._lines, []
        return lines

    def take_messages(self) -> list[SerialLine]:
        """As `Controller.take_messages`: an e-puck sends none to all; its infrared light is not decoded."""
        return []

    def take_led_changes(self) -> list[LedChange]:
        """As `Controller.take_led_changes`."""
        changed, self._led_changes = self._led_changes, []
        return changed

    def feed_uart(self, data: bytes) -> None:
        """As `Controller.feed_uart`: the bytes arrive on UART1 at its bit rate."""
        self.machine.uart[1].feed(data)

    def take_uart(self) -> bytes:
        """As `Controller.take_uart`."""
        output = bytes(self._uart_output or b"")
        self._uart_output = bytearray()
        return output

    def state(self) -> bytes:
        """As `Controller.state`."""
        return self.machine.snapshot()

    def place(self) -> str:
        """As `Controller.place`: function and offset, cycle, and whether the CPU sleeps."""
        machine = self.machine
        sleeps = ", asleep" if machine.is_asleep else ""
        return f"{function_at(machine) or f'{machine.pc:#08x}'}, cycle {machine.cycle:,}{sleeps}"

    def close(self) -> None:
        """Do nothing: the machine is freed with the object."""


def function_at(machine: Machine) -> str:
    """Return the name of the function that the machine executes, and the offset in it."""
    return machine.image.symbols.text(machine.pc) if machine.image else ""


def _pixel_noise(rng: np.random.Generator, sd: float) -> NDArray[np.int16]:
    """Return noise for pixel values, long enough for the widest line from any start value."""
    drawn: NDArray[np.int16] = np.rint(rng.normal(0.0, sd, (1 << _NOISE_BITS) + 3 * WIDTH)).astype(np.int16)
    return np.append(drawn, drawn[: 3 * (LINE_PIXELS - WIDTH)])  # a window may be wider than the picture


def volts_after(battery: BatterySetting, seconds: float) -> float:
    """Return the battery voltage after `seconds`, at least 3.0 V, where the robot's own protection would switch off."""
    return max(battery.volts - (FULL_VOLTS - Battery.LOW_VOLTS) * seconds / 3600 / battery.hours, 3.0)


def strip_of(columns: NDArray[np.intp], pixels: NDArray[np.uint8]) -> bytes:
    """Return at most STRIP_PIXELS pixels of a line from the middle of the picture, left to right."""
    middle = np.flatnonzero((columns >= STRIP_COLUMNS.start) & (columns < STRIP_COLUMNS.stop))
    order = middle[np.argsort(columns[middle], kind="stable")]
    count = min(len(order), STRIP_PIXELS)
    return pixels[order[np.arange(count) * len(order) // max(count, 1)]].tobytes()
