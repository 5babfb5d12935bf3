"""The engine of Kilobots: AVR images as avr-gcc built them, on emulated robots that exchange infrared light.

Input: poses once per quantum, light of the scene, commands of the overhead controller. Output: duties of the motors,
LED, messages and lines on the debug UART. All Kilobots of a trial run together (emu/boards/kilobot), because each pulse
of light may reach others within 4 us.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from arena.robots.controller import LedChange, Program, Reading, SerialLine, power_on_cycle
from arena.robots.crowd_breakpoints import CrowdBreakpoints
from arena.robots.robot_control import CrowdControl
from arena.scene.checks import overhead_commands
from arena.scene.loader import FCY, Scene, SceneError
from arena.scene.robot_kind import STRAIGHT_DUTY, TURN_DUTY, motor_strengths
from arena.world.physics import STREAM_SENSORS, STREAM_TRAITS, generator
from arena.world.poses import Poses
from emu.avr.core.addresses import ADDRESSES
from emu.avr.core.state import RESTARTED
from emu.avr.image import AvrImage, load_avr_image
from emu.avr.machine import HZ, UDR0, Atmega328p, Change
from emu.boards.kilobot.messages import DATA_SIZE, TYPES, Message, PulseDecoder, frame
from emu.boards.kilobot.observer import DDRB, MCUSR, PORTB, WATCHED, emits_light, is_reset, led_of, motors_of
from emu.boards.kilobot.overhead import send_frame
from emu.boards.kilobot.swarm import (
    ADC7,
    FULL_SCALE,
    LEAD_TICKS,
    KilobotFaultError,
    KilobotSetup,
    KilobotSwarm,
    microvolts,
)

LAMP_CM: Final = 100.0
"""Distance in cm to which the counts of a lamp refer."""
NEAREST_CM: Final = 5.0
"""Least distance in cm to a lamp in the inverse-square law: lamps hang above the table. UNVERIFIED"""
MAX_DUTY: Final = 255
LINE_LIMIT: Final = 200
"""Bytes after which a line of the debug UART without a line end is cut."""
_EMITTING: Final = (DDRB, PORTB)
MAX_VARIABLES: Final = 24
"""Maximum number of variables that `KilobotController.inspection` shows."""


def controllers(
    scene: Scene, seed: int, robots: Sequence[int], programs: Sequence[Program], _channel: object
) -> list[KilobotController]:
    """Return the controllers of some Kilobots, each with its image. Raises SceneError, emu.LoadError."""
    images: dict[str, AvrImage] = {}
    for program in programs:
        if program.image is None:
            raise SceneError(f"{scene.name}: robots.image: a Kilobot runs the image of a firmware; none is named")
        path = str(program.image)
        images[path] = images.get(path) or load_avr_image(path)
    crowd = KilobotCrowd(scene, seed, robots, [images[str(program.image)] for program in programs])
    return [KilobotController(scene, crowd, index) for index in range(len(robots))]


class KilobotCrowd:
    """All Kilobots of a trial, which run together, quantum by quantum."""

    def __init__(self, scene: Scene, seed: int, robots: Sequence[int], images: Sequence[AvrImage]) -> None:
        self._scene: Final = scene
        self._quantum: Final = scene.clock.quantum_tcy
        self.robots: Final = list(robots)
        setting = scene.kilobots
        self.swarm: Final = KilobotSwarm(
            [_setup(scene, seed, robot, image) for robot, image in zip(robots, images, strict=True)],
            seed=seed, loss=[(10 * cm, share) for cm, share in setting.lost_at] or setting.lost_share,
            reach=10 * setting.reach_cm,
        )  # fmt: skip
        registers = WATCHED if setting.records_messages else [one for one in WATCHED if one not in _EMITTING]
        for machine in self.swarm.robots:
            machine.watch(registers)
        self.faults: Final[dict[int, str]] = {}
        """Faults of the firmware by the index of the robot."""
        self.breakpoints: Final = CrowdBreakpoints(self.swarm)
        self.control: CrowdControl | None = None
        """Runs the robots in place of `run_until` while a debugger has one of them."""
        self._commands: Final = overhead_commands(setting.overhead)
        self._frame_at = self._command_start()
        self._tick = -1
        self._lamps: Final = [(one.x_cm, one.y_cm, one.counts) for one in scene.lamps]
        if scene.light.lamp_counts:
            self._lamps.append((scene.light.lamp_x_cm, scene.light.lamp_y_cm, scene.light.lamp_counts))
        self._ambient = [-1] * len(robots)

    def advance(self, tick: int, poses: Poses) -> None:
        """Run quantum `tick`, which begins with `poses`. Further calls for the same quantum do nothing."""
        if tick == self._tick:
            return
        self._tick = tick
        places = poses.values[: 3 * poses.counts[0]].reshape(-1, 3)[self.robots, :2]
        self.swarm.move_all(10 * places)
        self._set_light(places.tolist())
        end = (tick + 1) * self._quantum * HZ // FCY
        while self._commands and self._frame_at < end + LEAD_TICKS:
            self._run(max(self._frame_at - LEAD_TICKS, self.swarm.now))
            self._send()
        self._run(end)

    def _set_light(self, places: Sequence[Sequence[float]]) -> None:
        """Set the voltage of each sensor of ambient light if its counts have changed."""
        setting = self._scene.kilobots
        if not self._lamps and self._ambient[:1] == [setting.ambient_counts]:
            return
        for index, (x, y) in enumerate(places):
            lit = sum(counts * (LAMP_CM / max(math.hypot(lamp_x - x, lamp_y - y), NEAREST_CM)) ** 2
                      for lamp_x, lamp_y, counts in self._lamps)  # fmt: skip
            counts = min(round(setting.ambient_counts + setting.lamp_gain * lit), FULL_SCALE)
            if counts != self._ambient[index]:
                self._ambient[index] = counts
                machine = self.swarm.robots[index]
                machine.set_analog(machine.cycle, ADC7, microvolts(counts))

    def _run(self, end: int) -> None:
        if self.control is not None:
            self.control.run_crowd(end)
        else:
            self.run_until(end)

    def run_until(self, end: int) -> None:
        """Run all robots to tick `end` (125 ns each); a robot whose firmware faults stops."""
        while True:
            try:
                self.breakpoints.run_until(end)
                return
            except KilobotFaultError as fault:
                self.switch_off(fault)

    def switch_off(self, fault: KilobotFaultError) -> None:
        """Stop a robot permanently because of a fault."""
        self.faults[fault.robot] = f"stopped: {fault.what}"
        self.swarm.stop(fault.robot)

    def _command_start(self) -> int:
        return round(self._commands[0][0] * HZ) if self._commands else 0

    def _send(self) -> None:
        """Let the overhead controller send its message; store the time at which the next one begins."""
        start, name, seconds = self._commands[0]
        self._frame_at = send_frame(self.swarm, frame(Message(bytes(DATA_SIZE), TYPES[name])), self._frame_at)
        if self._frame_at >= (start + seconds) * HZ:
            del self._commands[0]
            self._frame_at = max(self._frame_at, self._command_start())


def _setup(scene: Scene, seed: int, robot: int, image: AvrImage) -> KilobotSetup:
    """Return a robot at power-on: its UID, its clock error, and the duties that calibrate its motors."""
    left, right = motor_strengths(scene.kilobots, generator(seed, STREAM_TRAITS, robot).normal(0.0, 1.0, 4).tolist())
    duties = tuple(min(round(duty / strength), MAX_DUTY)
                   for duty in (TURN_DUTY, STRAIGHT_DUTY) for strength in (left, right))  # fmt: skip
    clock = 1.0 + scene.kilobots.clock_sd * float(np.clip(generator(seed, STREAM_SENSORS, robot).normal(), -3, 3))
    on_at = power_on_cycle(scene, seed, robot) / FCY
    return KilobotSetup(image, number=scene.id_of(robot), on_at=on_at, clock=clock, duties=duties)


class KilobotController:
    """One Kilobot of a crowd. It drives with the mean duties of its left and right motor, 0 to 255."""

    def __init__(self, scene: Scene, crowd: KilobotCrowd, index: int) -> None:
        self.crowd: Final = crowd
        self.index: Final = index
        """Index of the robot in the crowd."""
        self.machine: Final[Atmega328p] = crowd.swarm.robots[index]
        self._off_tick: Final = scene.off_tick(crowd.robots[index])
        self._registers: dict[int, int] = {}
        self._motors = (0, 0)
        self._leds = 0
        self._since = 0
        self._decoder: Final = PulseDecoder()
        self._led_changes: list[LedChange] = []
        self._messages: list[SerialLine] = []
        self._lines: list[SerialLine] = []
        self._line = bytearray()
        self._line_at = 0
        self._reset_at = -FCY
        self._reported = (0, 0)

    def control_step(self, tick: int, poses: Poses) -> tuple[float, float]:
        """As `Controller.control_step`. Duties are means over the quantum."""
        self.crowd.advance(tick, poses)
        if tick == self._off_tick:
            self.crowd.swarm.stop(self.index)
            self._set_leds(0, self.machine.cycle)
        if tick >= self._off_tick or self.index in self.crowd.faults:
            return 0.0, 0.0
        changes, end = self.machine.changes, self.machine.cycle
        if not changes:
            self._since = end
            return self._motors
        driven = [0.0, 0.0]
        begin = since = self._since
        for change in changes:
            self._take(change)
            motors = motors_of(self._registers) if change.register not in (PORTB, UDR0) else self._motors
            if motors != self._motors:
                driven = [sum_ + duty * (change.cycle - since) for sum_, duty in zip(driven, self._motors, strict=True)]
                since, self._motors = change.cycle, motors
        changes.clear()
        self._since = end
        span = end - begin
        if since == begin or span <= 0:
            return self._motors
        left, right = ((sum_ + duty * (end - since)) / span for sum_, duty in zip(driven, self._motors, strict=True))
        return left, right

    @property
    def has_stopped(self) -> bool:
        """Whether the firmware has stopped after a fault."""
        return self.index in self.crowd.faults

    def _take(self, change: Change) -> None:
        """Take a change of a register: a pulse of light, a byte of the UART, the LED."""
        if change.register == UDR0:
            self._take_byte(change)
            return
        if change.register == RESTARTED:
            self._note_reset("the program has jumped to address 0", change.cycle)
            return
        if change.register == MCUSR and is_reset(self._registers.get(MCUSR, 0), change.value):
            self._registers.clear()
            self._note_reset("by the watchdog", change.cycle)
        was_lit = emits_light(self._registers)
        self._registers[change.register] = change.value
        if change.register in _EMITTING and emits_light(self._registers) and not was_lit:
            message = self._decoder.pulse(change.cycle)
            if message is not None:
                note = "" if message.is_whole else " wrong CRC"
                text = f"{message.type:#04x} {message.data.hex()}{note}"
                self._messages.append(SerialLine(self._trial_cycle(change.cycle), text))
        if change.register != PORTB:
            red, green, blue = led_of(self._registers)
            self._set_leds(red | green << 2 | blue << 4, change.cycle)

    def _note_reset(self, cause: str, cycle: int) -> None:
        """Add a line to the log. Resets within 1 ms of each other give one line, as in an endless loop of resets."""
        at = self._trial_cycle(cycle)
        if at - self._reset_at >= FCY // 1000:
            self._lines.append(SerialLine(at, f"reset: {cause}"))
        self._reset_at = at

    def _take_byte(self, change: Change) -> None:
        """Add a byte of the debug UART to the present line."""
        if not self._line:
            self._line_at = self._trial_cycle(change.cycle)
        if change.value not in b"\r\n":
            self._line.append(change.value)
        if self._line and (change.value in b"\r\n" or len(self._line) >= LINE_LIMIT):
            self._lines.append(SerialLine(self._line_at, self._line.decode("ascii", "backslashreplace")))
            self._line.clear()

    def _set_leds(self, leds: int, cycle: int) -> None:
        """Note a change of the LED's colour. Registers of one colour change within 1 ms: they count as one change."""
        if leds == self._leds:
            return
        at, self._leds = self._trial_cycle(cycle), leds
        if self._led_changes and at - self._led_changes[-1].cycle < FCY // 1000:
            at = self._led_changes.pop().cycle
        self._led_changes.append(LedChange(at, leds))

    def _trial_cycle(self, cycle: int) -> int:
        """Return the cycle of the trial, in Tcy of an e-puck, at a cycle of the robot's own clock."""
        return self.crowd.swarm.tick_of(self.index, cycle) * FCY // HZ

    def reading(self) -> Reading:
        """As `Controller.reading`. `load` is the share of cycles in which the CPU did not sleep."""
        cycle, slept = self.machine.cycle, self.machine.state.slept
        span, asleep = cycle - self._reported[0], slept - self._reported[1]
        self._reported = (cycle, slept)
        load = 1.0 - asleep / span if span > 0 else 0.0
        return Reading(seen=0, load=max(load, 0.0), leds=self._leds, fault=self.crowd.faults.get(self.index, ""))

    def take_lines(self) -> list[SerialLine]:
        """As `Controller.take_lines`, of the debug UART."""
        lines, self._lines = self._lines, []
        return lines

    def take_messages(self) -> list[SerialLine]:
        """As `Controller.take_messages`: type and data of each message, hexadecimal, in order."""
        messages, self._messages = self._messages, []
        return messages

    def take_led_changes(self) -> list[LedChange]:
        """As `Controller.take_led_changes`."""
        changes, self._led_changes = self._led_changes, []
        return changes

    def feed_uart(self, data: bytes) -> None:
        """Ignore the bytes: a Kilobot's debug UART has no receiver."""

    def take_uart(self) -> bytes:
        """Return no bytes: no radio is connected to the debug UART."""
        return b""

    def state(self) -> bytes:
        """As `Controller.state`."""
        return self.machine.comparable_state()

    def place(self) -> str:
        """As `Controller.place`: function and line, and cycle."""
        return f"{self.machine.image.place(self.machine.pc)}, cycle {self.machine.cycle:,}"

    def inspection(self) -> list[str]:
        """Return lines of text with the instruction, the registers and the small variables; numbers are unsigned."""
        machine = self.machine
        registers = machine.peek_bytes(0, 32)
        variables = sorted((one.address, one.size, one.name) for one in machine.image.symbols.all
                           if one.space == "data" and one.kind == "object" and one.size in (1, 2, 4))  # fmt: skip
        return [
            machine.image.place(machine.pc) + ("  asleep" if machine.state.asleep else ""),
            f"cycle {machine.cycle:,}  SP {machine.sp:04x}  SREG {machine.peek(ADDRESSES['SREG']):02x}",
            *(f"R{n:<3} {registers[n : n + 16].hex(' ')}" for n in (0, 16)),
            *(f"{name:<24} {machine.peek(address, size)}" for address, size, name in variables[:MAX_VARIABLES]),
            *filter(None, [self.crowd.faults.get(self.index)]),
        ]

    def close(self) -> None:
        """Do nothing: the machine is freed with the object."""
