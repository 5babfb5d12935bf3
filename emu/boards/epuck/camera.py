"""The camera: register file on I2C, sync lines and pixel bus as functions of the cycle (epuck.md §7).

Nothing ticks. HREF, VSYNC and PCLK are closed forms of the cycle, so the timers that count them post one event per
match. Pixels of a line are rendered when the first of them is read and lie in the record until the line is over:
while `camera.line_from <= cycle < camera.line_to`, the byte on RD8..RD15 is
`camera.line[(cycle - camera.line_from) / camera.byte_tcy]`, which native code may read by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from emu.boards.epuck.sensors import GREY, HEIGHT, RGB565, SENSORS, WIDTH, Picture, Timing
from emu.boards.part import Part
from emu.events import NEVER
from emu.peripherals import Peripherals
from emu.peripherals.i2cbus import I2cDevice
from emu.peripherals.pins import parse_pin

ADDRESS: Final = 0x6E
"""7-bit I2C address: 0xDC to write, 0xDD to read (epuck.md §7.1)."""
DATA_PORT: Final = 3
DATA_MASK: Final = 0xFF00
SYNC_PORT: Final = 2
HREF, VSYNC, PCLK = 1 << 3, 1 << 4, 1 << 14
"""RC3, RC4, RC14 (epuck.md §2)."""
RESET_PIN: Final = "RC13"
_LINE_BYTES: Final = 2 * 1024

Row = NDArray[np.uint8]
"""One line of the scene: 640 x 3 values, red, green, blue."""
RowSource = Callable[[int, int], Row]
"""row(y, cycle): line y (0 = top) of the upright scene as seen in `cycle`."""


class _SyncLines:
    """HREF, VSYNC and PCLK for the pins of port C."""

    def __init__(self, camera: Camera) -> None:
        self._camera: Final = camera

    def bits(self, cycle: int) -> int:
        """Levels of the three lines."""
        return self._camera.sync_levels(cycle)

    def rises(self, mask: int, after: int, until: int) -> int:
        """Rising edges of one line in after < c <= until."""
        return self._camera.edges(mask, until) - self._camera.edges(mask, after)

    def nth_rise(self, mask: int, after: int, count: int) -> int:
        """Cycle of the `count`-th rising edge behind `after`."""
        return self._camera.edge_cycle(mask, self._camera.edges(mask, after) + count)


class Camera(Part, I2cDevice):
    """One image sensor on its connector."""

    def __init__(self, chip: Peripherals, sensor: str = "PO6030K") -> None:
        super().__init__("camera", chip)
        if sensor not in SENSORS:
            raise ValueError(f"there is no sensor {sensor!r}; expected one of {', '.join(SENSORS)}")
        self.sensor: Final = SENSORS[sensor]
        self._registers: Final = self.array("registers", "B", 256 * self.sensor.banks)
        self._bank: Final = self.cell("bank", "B")
        self._pointer: Final = self.cell("pointer", "B")
        self._pointer_next: Final = self.cell("pointer_next", "B")
        self._running: Final = self.cell("running", "B")
        self._frame_start: Final = self.cell("frame_start", "Q")
        self._line: Final = self.array("line", "B", _LINE_BYTES)
        self._line_from: Final = self.cell("line_from", "Q")
        self._line_to: Final = self.cell("line_to", "Q")
        self._byte_tcy: Final = self.cell("byte_tcy", "I", 8)
        self._rows: RowSource = _black
        self._sync: Final = _SyncLines(self)
        self.timing: Timing
        self.picture: Picture
        self._load_defaults()
        self.restored()
        self._running.value = 1
        self.pins.set(RESET_PIN, 1)  # pulled up while the port does not drive it
        self.pins.watch(RESET_PIN, self._reset_moved)
        self.plug()

    # -- scene -------------------------------------------------------------------------------------------------------

    def show(self, image: NDArray[np.uint8]) -> None:
        """Let the camera see a still picture: grey or RGB, any size (scaled to 640 x 480 by nearest pixel)."""
        scene = _as_vga(image)
        self.look(lambda y, _cycle: scene[y])

    def look(self, rows: RowSource) -> None:
        """Let the camera see what `rows(y, cycle)` returns for each line when it is read out."""
        self._rows = rows
        self._line_to.value = 0

    def plug(self) -> None:
        """Connect the camera."""
        self.chip.i2c.wire.devices[ADDRESS] = self
        self.pins.change_waveform(self.now, self._attach)

    def unplug(self) -> None:
        """Take the camera off its connector: no answers, no edges."""
        self.chip.i2c.wire.devices.pop(ADDRESS, None)
        self.pins.change_waveform(self.now, self._detach)

    def _attach(self) -> None:
        self.pins.attach(DATA_PORT, DATA_MASK, self)
        self.pins.attach(SYNC_PORT, HREF | VSYNC | PCLK, self._sync)

    def _detach(self) -> None:
        self.pins.detach(DATA_PORT, self)
        self.pins.detach(SYNC_PORT, self._sync)

    # -- time --------------------------------------------------------------------------------------------------------

    @property
    def frame_tcy(self) -> int:
        """Length of a frame."""
        return self._row_tcy * self.timing.rows

    @property
    def frames_per_second(self) -> float:
        """Frame rate at the present clock and setting."""
        return self.chip.fcy / self.frame_tcy

    @property
    def _row_tcy(self) -> int:
        return self.timing.columns * self.timing.column_tcy

    @property
    def _line_tcy(self) -> int:
        """From one HREF to the next: skipped rows have none (§7.4)."""
        return self._row_tcy * self.timing.scale_y

    @property
    def lines(self) -> int:
        """Lines per frame."""
        visible = min(self.timing.end_row, self.timing.rows) - self.timing.first_row
        return max(-(-visible // self.timing.scale_y), 0)

    @property
    def line_bytes(self) -> int:
        """Bytes per line."""
        pixels = -(-(self.timing.end_column - self.timing.first_column) // self.timing.scale_x)
        return max(pixels, 0) * self.timing.bytes_per_pixel

    @property
    def byte_tcy(self) -> int:
        """Tcy per byte on the bus: 8 in every mode of the fast driver (§7.3)."""
        return max(self.timing.column_tcy * self.timing.scale_x // self.timing.bytes_per_pixel, 1)

    @property
    def _first_href(self) -> int:
        """Tcy from the start of a frame to its first HREF."""
        return self.timing.first_row * self._row_tcy + self.timing.first_column * self.timing.column_tcy

    @property
    def _vsync_rise(self) -> int:
        return self.timing.vsync_row * self._row_tcy + self.timing.vsync_column * self.timing.column_tcy

    def href_cycle(self, line: int, frame: int = 0) -> int:
        """Cycle in which HREF rises for a line (0 = first of the frame) of a frame since the last restart."""
        return self._frame_start.value + frame * self.frame_tcy + self._first_href + line * self._line_tcy

    def _place(self, cycle: int) -> tuple[int, int]:
        """(frame, Tcy since its start); the frame is -1 before the sensor started."""
        passed = cycle - self._frame_start.value
        return divmod(passed, self.frame_tcy) if passed >= 0 else (-1, 0)

    def sync_levels(self, cycle: int) -> int:
        """Levels of HREF, VSYNC and PCLK in `cycle`."""
        frame, offset = self._place(cycle)
        if not self._running.value or frame < 0:
            return 0
        line, behind = divmod(offset - self._first_href, self._line_tcy)
        levels = 0
        if 0 <= line < self.lines and behind < self.line_bytes * self.byte_tcy:
            levels |= HREF
            if 2 * (behind % self.byte_tcy) < self.byte_tcy:
                levels |= PCLK
        if self._vsync_rise <= offset < self.timing.vsync_end_row * self._row_tcy:
            levels |= VSYNC
        return levels

    def edges(self, mask: int, cycle: int) -> int:
        """Rising edges of one sync line since the sensor started, up to and with `cycle`."""
        frame, offset = self._place(cycle)
        if not self._running.value or frame < 0:
            return 0
        per_frame = self._edges_per_frame(mask)
        if mask == VSYNC:
            return frame * per_frame + (per_frame if offset >= self._vsync_rise else 0)
        behind = offset - self._first_href
        lines = min(max(behind // self._line_tcy + 1, 0), self.lines)
        if mask == HREF or lines == 0:
            return frame * per_frame + lines
        inside = (behind - (lines - 1) * self._line_tcy) // self.byte_tcy + 1
        return frame * per_frame + (lines - 1) * self.line_bytes + min(inside, self.line_bytes)

    def _edges_per_frame(self, mask: int) -> int:
        if mask == VSYNC:
            return int(self.timing.vsync_row < min(self.timing.vsync_end_row, self.timing.rows))
        return self.lines * (self.line_bytes if mask == PCLK else 1)

    def edge_cycle(self, mask: int, number: int) -> int:
        """Cycle of the `number`-th (1 = first) rising edge since the sensor started, or NEVER."""
        per_frame = self._edges_per_frame(mask)
        if not self._running.value or not per_frame:
            return NEVER
        frame, index = divmod(number - 1, per_frame)
        start = self._frame_start.value + frame * self.frame_tcy
        if mask == VSYNC:
            return start + self._vsync_rise
        line, byte = divmod(index, self.line_bytes) if mask == PCLK else (index, 0)
        return start + self._first_href + line * self._line_tcy + byte * self.byte_tcy

    # -- pixel bus ---------------------------------------------------------------------------------------------------

    def bits(self, cycle: int) -> int:
        """The byte on RD8..RD15: byte k of a line from HREF + (k - 1/2) to HREF + (k + 1/2) byte times (§7.5)."""
        if not self._line_from.value <= cycle < self._line_to.value and not self._render(cycle):
            return 0
        return self._line[(cycle - self._line_from.value) // self._byte_tcy.value] << 8

    def rises(self, mask: int, after: int, until: int) -> int:
        """The data lines clock nothing inside the chip."""
        return 0

    def nth_rise(self, mask: int, after: int, count: int) -> int:
        """The data lines clock nothing inside the chip."""
        return NEVER

    def _render(self, cycle: int) -> bool:
        """Put the line that is on the bus in `cycle` into the record. False between lines."""
        byte = self.byte_tcy
        frame, offset = self._place(cycle + byte // 2)
        line, behind = divmod(offset - self._first_href, self._line_tcy)
        if not self._running.value or frame < 0 or not 0 <= line < self.lines or behind >= self.line_bytes * byte:
            return False
        href = self.href_cycle(line, frame)
        data = self._encode(self.timing.first_row + line * self.timing.scale_y, href)
        self._line[: len(data)] = memoryview(data)
        self._line_from.value = href - byte // 2
        self._line_to.value = self._line_from.value + len(data) * byte
        self._byte_tcy.value = byte
        return True

    def _encode(self, row: int, cycle: int) -> bytes:
        """The bytes of one line: window, sub-sampling, mirrors, gains, colour format."""
        timing, picture = self.timing, self.picture
        columns = np.arange(timing.first_column, timing.end_column, timing.scale_x) - picture.origin_x
        y = row - picture.origin_y
        inside = (columns >= 0) & (columns < WIDTH) & (0 <= y < HEIGHT)
        x = np.clip(WIDTH - 1 - columns if picture.flip_x else columns, 0, WIDTH - 1)
        seen = self._rows(min(max(HEIGHT - 1 - y if picture.flip_y else y, 0), HEIGHT - 1), cycle)
        pixels = np.where(inside[:, None], seen[x], 0).astype(np.float64) * np.array(picture.gains)
        return _BYTES[picture.form](np.minimum(pixels, 255.0).astype(np.int32))

    # -- registers on I2C --------------------------------------------------------------------------------------------

    def register(self, bank: int, number: int) -> int:
        """A register, 0..255."""
        return self._registers[256 * bank + number]

    def start(self, read: bool, cycle: int) -> bool:
        """In reset the sensor does not answer."""
        self._pointer_next.value = not read
        return bool(self._running.value)

    def write(self, byte: int, cycle: int) -> bool:
        """First the register number, then its value."""
        if self._pointer_next.value:
            self._pointer.value = byte
            self._pointer_next.value = 0
        elif self._pointer.value == self.sensor.bank_register:
            self._bank.value = byte % self.sensor.banks
        else:
            self._registers[256 * self._bank.value + self._pointer.value] = byte
            self._reconsider(cycle)
        return True

    def read(self, cycle: int) -> int:
        """Registers 0 and 1 tell the type; the bank register reads back."""
        number = self._pointer.value
        if number < 2:
            return self.sensor.identity[number]
        if number == self.sensor.bank_register:
            return self._bank.value
        return self.register(self._bank.value, number)

    def _reconsider(self, cycle: int) -> None:
        """A register changed. UNVERIFIED: a new timing begins with a new frame at once."""
        self._line_to.value = 0
        self.picture = self.sensor.picture(self.register)
        timing = self.sensor.timing(self.register)
        if timing != self.timing:
            self.pins.change_waveform(cycle, lambda: self._restart(timing, cycle))

    def _restart(self, timing: Timing, cycle: int) -> None:
        self.timing = timing
        self._frame_start.value = cycle
        self._line_to.value = 0

    # -- reset -------------------------------------------------------------------------------------------------------

    def _reset_moved(self, cycle: int, _changed: int, levels: int) -> None:
        """RC13 low holds the sensor in reset (§2)."""
        running = bool(levels & parse_pin(RESET_PIN)[1])
        self.pins.change_waveform(cycle, lambda: self._set_running(running, cycle))

    def _set_running(self, running: bool, cycle: int) -> None:
        self._running.value = running
        self._load_defaults()
        self._restart(self.sensor.timing(self.register), cycle)
        self.picture = self.sensor.picture(self.register)

    def _load_defaults(self) -> None:
        self._bank.value = 0
        for index in range(len(self._registers)):
            self._registers[index] = 0
        for (bank, number), value in self.sensor.defaults.items():
            self._registers[256 * bank + number] = value

    def restored(self) -> None:
        """The record was replaced: timing and picture follow from the registers."""
        self.timing = self.sensor.timing(self.register)
        self.picture = self.sensor.picture(self.register)


def _black(_y: int, _cycle: int) -> Row:
    return np.zeros((WIDTH, 3), dtype=np.uint8)


def _as_vga(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Any grey, RGB or RGBA picture as 480 x 640 x 3. Raises ValueError for other shapes."""
    if image.ndim == 2:
        image = np.repeat(image[:, :, None], 3, axis=2)
    if image.ndim != 3 or image.shape[2] not in (3, 4) or not image.size:
        raise ValueError(f"a picture is height x width, grey or with 3 or 4 channels, not of shape {image.shape}")
    rows = np.arange(HEIGHT) * image.shape[0] // HEIGHT
    columns = np.arange(WIDTH) * image.shape[1] // WIDTH
    return np.ascontiguousarray(image[rows][:, columns, :3], dtype=np.uint8)


def _rgb565(pixels: NDArray[np.int32]) -> bytes:
    """High byte first: R4..R0 G5..G3, G2..G0 B4..B0 (§7.4)."""
    red, green, blue = pixels[:, 0], pixels[:, 1], pixels[:, 2]
    return ((red >> 3) << 11 | (green >> 2) << 5 | blue >> 3).astype(">u2").tobytes()


def _luma(pixels: NDArray[np.int32]) -> NDArray[np.int32]:
    weighted = 77 * pixels[:, 0] + 150 * pixels[:, 1] + 29 * pixels[:, 2]  # ITU-R BT.601 in 1/256
    return (weighted + 128) >> 8


def _grey(pixels: NDArray[np.int32]) -> bytes:
    return _luma(pixels).astype(np.uint8).tobytes()


def _yuv(pixels: NDArray[np.int32]) -> bytes:
    """U Y V Y, chroma of the first pixel of each pair. UNVERIFIED order (§7.4)."""
    luma = _luma(pixels)
    blue_difference = np.clip(128 + ((pixels[:, 2] - luma) * 145 >> 8), 0, 255)
    red_difference = np.clip(128 + ((pixels[:, 0] - luma) * 183 >> 8), 0, 255)
    chroma = blue_difference.copy()
    chroma[1::2] = red_difference[: len(chroma) - len(chroma) % 2 : 2]
    return np.stack([chroma, luma], axis=1).astype(np.uint8).tobytes()


_BYTES: Final[dict[str, Callable[[NDArray[np.int32]], bytes]]] = {RGB565: _rgb565, GREY: _grey, "yuv": _yuv}
