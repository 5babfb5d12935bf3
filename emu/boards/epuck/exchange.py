"""Exchange between a robot and a simulated world, as arrays: read `Outputs`, move the world, write `Inputs`.

    machine.run_until(cycle)
    robot.outputs.update()          # steps, LEDs, emitters ... at the current cycle
    ...                             # the world moves
    robot.inputs.distance[:] = ...
    robot.inputs.apply()            # holds from the current cycle on

The camera calls its pixel source when a line is read out (`Camera.show_pixels`). The remote control is `Remote.press`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from emu.boards.epuck.analog import PULSE_PINS, SENSORS
from emu.boards.epuck.hardware import EpuckHardware
from emu.boards.epuck.simple import LED_PINS

LEFT, RIGHT = 0, 1
"""Indices of the wheels."""


class Outputs:
    """The robot's outputs as arrays.

        >>> import emu
        >>> machine = emu.load("firmware.elf")
        >>> machine.run(seconds=0.001).reason
        'limit'
        >>> machine.board.outputs.update()
        >>> machine.board.outputs.steps.tolist(), bool(machine.board.outputs.leds.any())
        ([0, 0], False)

    `update` fills the arrays in place.
    """

    def __init__(self, board: EpuckHardware) -> None:
        self._board: Final = board
        self.steps: Final[NDArray[np.int64]] = np.zeros(2, np.int64)
        """Motor steps since power-on, left and right, forward positive; 1000 make one turn (epuck.md §3)."""
        self.lost: Final[NDArray[np.int64]] = np.zeros(2, np.int64)
        """Steps lost because the phase jumped by two."""
        self.illegal: Final[NDArray[np.int64]] = np.zeros(2, np.int64)
        """Coil patterns that are not a phase and were constant for 1 us or more."""
        self.coil_cycles: Final[NDArray[np.int64]] = np.zeros(2, np.int64)
        """Tcy during which at least one coil was on."""
        self.leds: Final[NDArray[np.bool_]] = np.zeros(len(LED_PINS), np.bool_)
        """Whether each LED is lit: ring LEDs 0-7, front, body."""
        self.emitters: Final[NDArray[np.bool_]] = np.zeros(len(PULSE_PINS), np.bool_)
        """Whether each infrared pulse line is on; line n lights the emitters of sensors n and n + 4."""
        self.camera_running = False
        """Whether the camera is plugged in and not in reset."""
        self.speaker_on = False
        self._levels = b""

    def update(self) -> None:
        """Read the current outputs.

        Complete all conversions that sampled earlier, so that later inputs cannot affect them.
        """
        board = self._board
        board.chip.adc.catch_up(board.chip.adc.now)
        left, right = board.motors.left.counts(), board.motors.right.counts()
        self.steps[:] = left[0], right[0]
        self.lost[:] = left[1], right[1]
        self.illegal[:] = left[2], right[2]
        self.coil_cycles[:] = left[3], right[3]
        levels = board.chip.pins.level.tobytes()
        if levels != self._levels:
            self._levels = levels
            self.leds[:] = board.leds.states()
            self.emitters[:] = board.ir.lines_lit()
            self.speaker_on = board.codec.is_on
        self.camera_running = board.camera is not None and board.camera.is_plugged and board.camera.scan.running


class Inputs:
    """The robot's inputs.

        >>> import emu
        >>> inputs = emu.load("firmware.elf").board.inputs
        >>> inputs.distance[0] = 20.0      # mm
        >>> inputs.battery = 3.5           # V
        >>> inputs.apply()

    Write the arrays and attributes, then call `apply`.
    """

    def __init__(self, board: EpuckHardware) -> None:
        self._board: Final = board
        self.distance: Final[NDArray[np.float64]] = np.full(SENSORS, np.inf)
        """Distance in mm from each infrared sensor to the nearest surface; inf means no surface."""
        self.share: Final[NDArray[np.float64]] = np.ones(SENSORS)
        """Reflection relative to a white surface that is perpendicular to the beam, 0..1."""
        self.ambient: Final[NDArray[np.int64]] = np.array(board.ir.ambient, np.int64)
        """Ambient light in raw counts 0..4095, with the emitter off; dark is high."""
        self.acceleration: Final[NDArray[np.float64]] = np.array([0.0, 0.0, 1.0])
        """Acceleration in g; see `Accelerometer.set_g`."""
        self.selector = board.selector.position
        """Position of the selector, 0..15."""
        self.battery = board.battery.volts
        """Battery voltage in V."""
        self._surfaces = self._light = self._motion = b""

    def apply(self) -> None:
        """Apply all changes since the last call, effective from the current cycle on.

        Raises ValueError for a value out of range.
        """
        board = self._board
        surfaces = self.distance.tobytes() + self.share.tobytes()
        if surfaces != self._surfaces:
            self._surfaces = surfaces
            board.ir.set_distances(zip(range(SENSORS), self.distance.tolist(), self.share.tolist(), strict=True))
        light = self.ambient.tobytes()
        if light != self._light:
            self._light = light
            for sensor, counts in enumerate(self.ambient.tolist()):
                board.ir.set_ambient(sensor, counts)
        motion = self.acceleration.tobytes()
        if motion != self._motion:
            self._motion = motion
            board.accelerometer.set_g(*self.acceleration.tolist())
        if self.selector != board.selector.position:
            board.selector.position = self.selector
        if self.battery != board.battery.volts:
            board.battery.volts = self.battery
