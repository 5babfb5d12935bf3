"""The e-puck's camera: I2C registers, sync lines and pixel bus as functions of the cycle (epuck.md §7).

The camera posts no events. HREF, VSYNC and PCLK are closed forms of the cycle (`scan.py`), so timers that count them
post one event per match. The first read of a line renders its pixels into the record, where they stay until the line
ends. Generated code of the port reads the pixels from the record.
"""

from __future__ import annotations

import ctypes
import warnings
from collections.abc import Callable, Iterable
from functools import partial
from typing import TYPE_CHECKING, Final

from emu.boards.epuck.camera.exposure import Exposure
from emu.boards.epuck.camera.native_camera import NativeCamera
from emu.boards.epuck.camera.scan import HREF, LINE_PIXELS, PCLK, VSYNC, Scan, frame_timing
from emu.boards.epuck.camera.sensors import SENSORS, ImageSettings, SensorTiming
from emu.boards.part import BoardPart
from emu.peripherals import Peripherals
from emu.peripherals.i2c.bus import I2cDevice
from emu.peripherals.ports.rules import ByteStream
from emu.system.events import NEVER
from emu.system.rules import cell_of

if TYPE_CHECKING:  # imported when the first picture is shown: runs without a picture start faster
    import numpy as np
    from numpy.typing import NDArray

    from emu.boards.epuck.camera.pixels import Pixels, PixelSource, Readout, StillImage

ADDRESS: Final = 0x6E
"""7-bit I2C address: 0xDC to write, 0xDD to read (epuck.md §7.1)."""
DATA_PORT: Final = 3
DATA_MASK: Final = 0xFF00
SYNC_PORT: Final = 2
RESET_PIN: Final = "RC13"

RowSource = Callable[[int, int], "Pixels"]
"""rows(y, cycle): returns line y (0 = top) of the upright scene at `cycle`, 640 x 3 values."""


class Camera(BoardPart, I2cDevice):
    """An image sensor and its connector. Raises ValueError for a sensor type that is not in SENSORS."""

    def __init__(self, chip: Peripherals, sensor: str = "PO6030K", plugged: bool = True) -> None:
        super().__init__("camera", chip)
        if sensor not in SENSORS:
            raise ValueError(f"there is no sensor {sensor!r}; expected one of {', '.join(SENSORS)}")
        self.sensor: Final = SENSORS[sensor]
        self.scan: Final = Scan(self.record)
        self._exposure: Final = Exposure(self.record)
        self._registers: Final = self.array("registers", "B", 256 * self.sensor.banks)
        self._bank: Final = self.cell("bank", "B")
        self._pointer: Final = self.cell("pointer", "B")
        self._pointer_next: Final = self.cell("pointer_next", "B")
        self._plugged: Final = self.cell("plugged", "B")
        self.pins.add_rule_waveform(SYNC_PORT, HREF | VSYNC | PCLK, self.scan, self._plugged.cell)
        self._line: Final = self.array("line", "B", 2 * LINE_PIXELS)
        self._line_address: Final = self.record.address + self.record.fields["camera.line"].offset
        self._u64: Final = self.record.u64
        self._line_from: Final = self.cell("line_from", "Q")
        self._line_to: Final = self.cell("line_to", "Q")
        self._byte: Final = self.cell("line_byte_tcy", "Q", 1)
        places = (cell_of(self.record, f"camera.{name}") for name in ("line_from", "line_to", "line", "line_byte_tcy"))
        chip.ports[DATA_PORT].attach_byte_stream(ByteStream(DATA_MASK, 8, *places), self._refresh)
        self.native: Final = NativeCamera.of(self.record)
        """State for native code that renders the scene of `show_pixels`."""
        self._native_address: Final = ctypes.addressof(self.native)
        self._has_native_source, self._settings = False, 0
        self._pixels: PixelSource | None = None
        self._still: StillImage | None = None
        self._timing: SensorTiming
        self._picture: ImageSettings
        self._readout: Readout | None
        self._load_defaults()
        self._decode_registers()
        self.scan.begin(frame_timing(self._timing), self.now, running=True)
        self.pins.set(RESET_PIN, 1)  # UNVERIFIED: pulled up while not driven
        self.pins.watch(RESET_PIN, self._reset_pin_changed)
        if plugged:
            self.plug()

    # -- scene -------------------------------------------------------------------------------------------------------

    def show(self, image: NDArray[np.uint8], turned: int = 0) -> None:
        """Show a still picture to the camera: grey or RGB, any size (scaled to 640 x 480 by nearest pixel).

        `turned` = 90, 180 or 270 rotates it counter-clockwise, for a sensor that is mounted rotated (§7.1). Raises
        ValueError for an array that is not a picture.
        """
        from emu.boards.epuck.camera.pixels import StillImage, as_vga

        still = StillImage(as_vga(image, turned))
        self.show_pixels(still, has_native_source=True)
        self._still = still

    def show_rows(self, rows: RowSource) -> None:
        """Set a scene that is computed row by row. The camera calls `rows(y, cycle)` when it reads out a line."""
        self.show_pixels(lambda y, columns, cycle: rows(y, cycle)[columns])

    def show_pixels(self, pixels: PixelSource, has_native_source: bool = False) -> None:
        """Set a scene that is computed pixel by pixel.

        The camera calls `pixels(y, columns, cycle)` once for each line that the firmware reads; `cycle` is the rising
        edge of the line's HREF. With `has_native_source`, native code that uses `native` may render the same scene
        instead.
        """
        self._pixels, self._has_native_source, self._still = pixels, has_native_source, None
        self.native.setting = 0
        self._line_to.value = 0

    def sample(self, pixels: PixelSource, has_native_source: bool = False) -> None:
        """Old spelling of `show_pixels`, which this release still accepts."""
        warnings.warn("Camera.sample is called show_pixels now", DeprecationWarning, stacklevel=2)
        self.show_pixels(pixels, has_native_source)

    @property
    def pixel_source(self) -> PixelSource | None:
        """The current pixel source."""
        return self._pixels

    @property
    def lamp(self) -> float:
        """Brightness of the scene's light, 1 = as in the picture. Automatic exposure adapts to a change."""
        return self._exposure.lamp

    @lamp.setter
    def lamp(self, brightness: float) -> None:
        self._exposure.set_lamp(brightness, self.now, self.scan.timing.frame_tcy)
        self._line_to.value = 0

    def frame(self, cycle: int | None = None) -> Pixels:
        """Return the picture that the sensor would send at `cycle` (default: now): lines x pixels x 3.

        The sensor's current window, format and exposure apply.
        """
        import numpy as np

        from emu.boards.epuck.camera.pixels import decode_line

        at = self.now if cycle is None else cycle
        room = (ctypes.c_uint8 * (2 * LINE_PIXELS))()
        lines = []
        for line in range(self.scan.timing.lines):
            count = self._encode_line(line, at, ctypes.addressof(room))
            lines.append(decode_line(bytes(room[:count]), self._picture.form))
        return np.stack(lines) if lines else np.zeros((0, 0, 3), np.uint8)

    def _encode_line(self, line: int, cycle: int, address: int) -> int:
        """Encode a line read out at `cycle` and write its bytes to a host address. Return the number of bytes."""
        if self._readout is None:
            from emu.boards.epuck.camera.pixels import Readout

            self._readout = Readout(self._timing, self._picture, self.scan.timing.lines)
        if self._has_native_source and not self.native.setting:
            self._settings += 1
            self._readout.publish(self.native, self._settings, self._picture)
        brightness = self._exposure.brightness(self._picture.exposure, cycle, self.scan.timing.frame_tcy)
        return self._readout.put(self._pixels, line, cycle, brightness, address)

    # -- connector ---------------------------------------------------------------------------------------------------

    @property
    def is_plugged(self) -> bool:
        """Whether the camera is plugged in."""
        return bool(self._plugged.value)

    def plug(self) -> None:
        """Plug the camera in."""
        self._set_plugged(True)

    def unplug(self) -> None:
        """Unplug the camera: it no longer answers on I2C, and its lines have no edges."""
        self._set_plugged(False)

    def _set_plugged(self, plugged: bool) -> None:
        self._plugged.value = plugged
        self._line_to.value = 0
        self.pins.change_waveform(self.now, self._connect)

    def _connect(self) -> None:
        """Attach or detach the waveforms and the I2C address, depending on whether the camera is plugged in."""
        for port, mask, wave in ((DATA_PORT, DATA_MASK, self), (SYNC_PORT, HREF | VSYNC | PCLK, self.scan)):
            if self.is_plugged:
                self.pins.attach(port, mask, wave)
            else:
                self.pins.detach(port, wave)
        assert self.chip.i2c is not None
        wire = self.chip.i2c.wire
        wire.devices.pop(ADDRESS, None)
        if self.is_plugged:
            wire.attach(ADDRESS, self)

    @property
    def frames_per_second(self) -> float:
        """Frame rate at the current clock and sensor settings."""
        return self.chip.fcy / self.scan.timing.frame_tcy

    def align(self, cycle: int, line: int = 0) -> None:
        """Shift the sensor's phase so that HREF of a line (0 = first of the frame) rises in the future `cycle`.

        Tests use this to place an edge on a chosen instruction. On a robot the phase is arbitrary.
        """
        timing = self.scan.timing
        start = cycle - timing.first_href - line * timing.line_tcy
        start -= max(-(-(start - self.now) // timing.frame_tcy), 0) * timing.frame_tcy
        self._line_to.value = 0
        self.pins.change_waveform(self.now, partial(self.scan.begin, timing, start, self.scan.running))

    # -- pixel bus ---------------------------------------------------------------------------------------------------

    def bits(self, cycle: int) -> int:
        """Return the byte on RD8..RD15 in `cycle`, 0 between lines."""
        u64, first = self._u64, self._line_from.index
        if not u64[first] <= cycle < u64[self._line_to.index]:
            if self.events.is_peeking:
                return self._peek_byte(cycle) << 8
            if not self._render(cycle):
                return 0
        return self._line[(cycle - u64[first]) // u64[self._byte.index]] << 8

    def _peek_byte(self, cycle: int) -> int:
        """Return the byte on the bus in `cycle` for a tool, and keep the record as it is.

        It is 0 for lines of a computed scene that the firmware has not read yet: its source may draw random numbers.
        """
        found = self.scan.line_at(cycle) if self._pixels is self._still else None
        if found is None:
            return 0
        room = (ctypes.c_uint8 * (2 * LINE_PIXELS))()
        line, href = found
        self._encode_line(line, href, ctypes.addressof(room))
        tcy = self.scan.timing.byte_tcy
        return room[(cycle - href + tcy // 2) // tcy]

    def constant_until(self, cycle: int) -> int:
        """Return the start of the next line if `cycle` is between lines; within a line, `cycle` (no guarantee)."""
        u64 = self._u64
        in_line = u64[self._line_from.index] <= cycle < u64[self._line_to.index]
        return cycle if in_line else self.scan.next_line(cycle)

    def rises(self, mask: int, after: int, until: int) -> int:
        """Report no rising edges, because no device of the chip is clocked by the data lines."""
        return 0

    def nth_rise(self, mask: int, after: int, count: int) -> int:
        """Report no rising edges, because no device of the chip is clocked by the data lines."""
        return NEVER

    def changes(self, after: int, until: int) -> Iterable[tuple[int, int, int]]:
        """Return no edges: the log of pin changes has no pixel bytes, which depend on the scene at their time."""
        return ()

    def _refresh(self, cycle: int) -> bool:
        """Render the line on the bus into the record, where native code reads its bytes.

        Return whether a line was rendered.
        """
        u64 = self._u64
        if not self._plugged.value or u64[self._line_from.index] <= cycle < u64[self._line_to.index]:
            return False
        still = self._still
        return (still is not None and still.render_natively(self._native_address, cycle)) or self._render(cycle)

    def _render(self, cycle: int) -> bool:
        """Render the line that is on the bus in `cycle` into the record. Return False between lines."""
        found = self.scan.line_at(cycle)
        if found is None:
            return False
        line, href = found
        tcy = self.scan.timing.byte_tcy
        count = self._encode_line(line, href, self._line_address)
        self._line_from.value = begin = href - tcy // 2
        self._line_to.value = begin + count * tcy
        self._byte.value = tcy
        return True

    # -- registers on I2C --------------------------------------------------------------------------------------------

    def register(self, bank: int, number: int) -> int:
        """Return the value of a register, 0..255."""
        return self._registers[256 * bank + number]

    def start(self, read: bool, cycle: int) -> bool:
        """Handle the sensor's I2C address. In reset, the sensor does not acknowledge it."""
        self._pointer_next.value = not read
        return self.scan.running

    def write(self, byte: int, cycle: int) -> bool:
        """Handle a byte written on I2C: first the register number, then the register's value."""
        if self._pointer_next.value:
            self._pointer.value = byte
            self._pointer_next.value = 0
        elif self._pointer.value == self.sensor.bank_register:
            self._bank.value = byte % self.sensor.banks
        else:
            self._registers[256 * self._bank.value + self._pointer.value] = byte
            self._register_changed(cycle)
        return True

    def read(self, cycle: int) -> int:
        """Return the value of the selected register.

        Registers 0 and 1 hold the sensor type; the bank register reads back.
        """
        number = self._pointer.value
        if number < len(self.sensor.identity):
            return self.sensor.identity[number]
        if number == self.sensor.bank_register:
            return self._bank.value
        return self.register(self._bank.value, number)

    def _register_changed(self, cycle: int) -> None:
        """Apply a register change. UNVERIFIED: a new timing starts a new frame immediately."""
        before = self._picture.exposure
        self._decode_registers()
        if (before is None) != (self._picture.exposure is None):
            self._exposure.hold(cycle, self.scan.timing.frame_tcy)
        timing = frame_timing(self._timing)
        if timing != self.scan.timing:
            self._exposure.hold(cycle, self.scan.timing.frame_tcy)
            self.pins.change_waveform(cycle, partial(self.scan.begin, timing, cycle, self.scan.running))

    def _decode_registers(self) -> None:
        """Decode the registers and discard a rendered line."""
        self._timing = self.sensor.timing(self.register)
        self._picture = self.sensor.picture(self.register)
        self._readout = None
        self.native.setting = 0
        self._line_to.value = 0

    # -- reset -------------------------------------------------------------------------------------------------------

    def _reset_pin_changed(self, cycle: int, changed: int, levels: int) -> None:
        """Handle an edge of RC13, which holds the sensor in reset while low (§2)."""
        self.pins.change_waveform(cycle, partial(self._set_running, bool(changed & levels), cycle))

    def _set_running(self, running: bool, cycle: int) -> None:
        self._load_defaults()
        self._decode_registers()
        self._exposure.restart(cycle)
        self.scan.begin(frame_timing(self._timing), cycle, running)

    def _load_defaults(self) -> None:
        self._bank.value = 0
        for index in range(len(self._registers)):
            self._registers[index] = 0
        for (bank, number), value in self.sensor.defaults.items():
            self._registers[256 * bank + number] = value

    def restored(self) -> None:
        """Rebuild derived state after a snapshot was restored. A rendered line stays valid."""
        line_to = self._line_to.value
        self._decode_registers()
        self._line_to.value = line_to
        self.scan.restored()
        self._connect()
