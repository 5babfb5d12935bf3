"""Conversion of a scene to the bytes of a sensor line: mirroring, gains and colour formats (epuck.md §7.2, §7.4)."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from emu.boards.epuck.camera.native_camera import NativeCamera
from emu.boards.epuck.camera.scan import frame_timing
from emu.boards.epuck.camera.sensors import GREY, HEIGHT, RGB565, WIDTH, YUV, ImageSettings, SensorTiming
from emu.native_library import ADDRESS, INT, functions

Pixels = NDArray[np.uint8]
"""Array of n x 3 values: red, green, blue."""
PixelSource = Callable[[int, NDArray[np.intp], int], Pixels]
"""pixels(y, columns, cycle): returns the pixels of line y in the given columns (0..639), len(columns) x 3 values."""


def scene_columns(timing: SensorTiming, picture: ImageSettings) -> NDArray[np.intp]:
    """Return the scene column (0 = left, 0..639) of every pixel of a line, clamped to the scene's edges."""
    pixels = frame_timing(timing).line_bytes // timing.bytes_per_pixel
    columns = timing.first_column + timing.scale_x * np.arange(pixels) - picture.origin_x
    return np.clip(WIDTH - 1 - columns if picture.flip_x else columns, 0, WIDTH - 1)


def scene_row(timing: SensorTiming, picture: ImageSettings, line: int) -> int:
    """Return the scene row (0 = top, 0..479) of a line of the frame."""
    row = timing.first_row + line * timing.scale_y - picture.origin_y
    return min(max(HEIGHT - 1 - row if picture.flip_y else row, 0), HEIGHT - 1)


def darkness(_y: int, columns: NDArray[np.intp], _cycle: int) -> Pixels:
    """Pixel source of a scene without light."""
    return np.zeros((len(columns), 3), dtype=np.uint8)


class StillImage:
    """Pixel source of a still picture (480 x 640 x 3). Equal row and columns give the identical array."""

    def __init__(self, scene: Pixels) -> None:
        self._scene: Final = scene
        self._columns: NDArray[np.intp] | None = None
        self._cut: Final[dict[int, Pixels]] = {}
        self._addresses: Final = (ctypes.c_void_p * HEIGHT)()
        self._addresses_at: Final = ctypes.addressof(self._addresses)
        self._render: Final = line_code()["render_still"]

    def __call__(self, y: int, columns: NDArray[np.intp], _cycle: int) -> Pixels:
        """Return a row's pixels in the given columns."""
        if columns is not self._columns:
            self._columns = columns
            self._cut.clear()
            ctypes.memset(self._addresses, 0, ctypes.sizeof(self._addresses))
        found = self._cut.get(y)
        if found is None:
            found = self._cut[y] = np.ascontiguousarray(self._scene[y, columns])
            self._addresses[y] = found.ctypes.data
        return found

    def render_natively(self, camera: int, cycle: int) -> bool:
        """Render the line on the bus in `cycle` by native code, for the `NativeCamera` at host address `camera`.

        Return False if Python must render it: for example, the row was not read with the current settings yet.
        """
        return bool(self._render(camera, cycle, self._addresses_at))


Gains = ctypes.c_double * 3
"""Gain factors of red, green and blue."""


def encode(pixels: int, count: int, form: str, gains: ctypes.Array[ctypes.c_double], address: int) -> int:
    """Encode a line of `count` pixels from one host address to another (`line.c`). Return the number of bytes."""
    line_code()["encode"](pixels, count, _FORMS.index(form), gains, address)
    return count * _SIZES[form]


class Readout:
    """Encoder of a frame's lines for one set of sensor settings."""

    def __init__(self, timing: SensorTiming, picture: ImageSettings, lines: int) -> None:
        self._columns: Final = scene_columns(timing, picture)
        self._rows: Final = [scene_row(timing, picture, line) for line in range(lines)]
        self._row_numbers: Final = (ctypes.c_int64 * lines)(*self._rows)
        self._gains: Final = picture.gains
        self._form: Final = picture.form
        self._factors: Final = Gains(*picture.gains)
        self._brightness = 1.0
        self._held: Final[dict[int, tuple[Pixels, int]]] = {}

    def publish(self, camera: NativeCamera, setting: int, picture: ImageSettings) -> None:
        """Publish the settings to native code under the unique number `setting`.

        Keep this object alive while they are used.
        """
        camera.row, camera.count = ctypes.addressof(self._row_numbers), len(self._columns)
        camera.form, camera.gains[:] = _FORMS.index(self._form), self._gains
        camera.manual = -1.0 if picture.exposure is None else picture.exposure
        camera.setting = setting

    def put(self, source: PixelSource | None, line: int, cycle: int, brightness: float, address: int) -> int:
        """Encode a line to a host address, its pixels scaled by `brightness`. Return the number of bytes.

        Raises ValueError if the source returns another number of pixels than requested.
        """
        seen = (source or darkness)(self._rows[line], self._columns, cycle)
        count = len(self._columns)
        if brightness != self._brightness:
            self._brightness = brightness
            self._factors[:] = [gain * brightness for gain in self._gains]
        held, at = self._held.get(line, (None, 0))
        if seen is not held:  # a source that reuses one array saves looking up its address
            if seen.shape != (count, 3):
                raise ValueError(
                    f"the pixel source returned shape {seen.shape}; expected {count} pixels, shape ({count}, 3)"
                )
            whole = np.ascontiguousarray(seen, dtype=np.uint8)
            at = whole.ctypes.data
            self._held[line] = whole, at
        return encode(at, count, self._form, self._factors, address)


@cache
def line_code() -> dict[str, Callable[..., int]]:
    """Return the functions of line.c."""
    return functions(Path(__file__).with_name("line.c"), {
        "encode": (None, (ADDRESS, INT, INT, ADDRESS, ADDRESS)),
        "row_on_bus": (INT, (ADDRESS, INT, INT, ADDRESS)),
        "write_line": (None, (ADDRESS, INT, ADDRESS)),
        "render_still": (INT, (ADDRESS, INT, ADDRESS)),
    })  # fmt: skip


def decode(data: bytes, form: str) -> Pixels:
    """Decode the pixels in a buffer filled by a driver: the inverse of `encode`, up to the format's precision.

    Raises ValueError for an unknown format or a buffer that ends in the middle of a pixel.
    """
    if form not in _DECODERS:
        raise ValueError(f"unknown pixel format {form!r}; expected one of {', '.join(_DECODERS)}")
    size = 1 if form == GREY else 4 if form == YUV else 2
    if len(data) % size:
        raise ValueError(f"{len(data)} bytes are not a whole number of {form} pixels")
    return _DECODERS[form](np.frombuffer(data, dtype=np.uint8))


def decode_line(data: bytes, form: str) -> Pixels:
    """Decode the pixels of a complete line.

    A YUV line may end with the first of two pixels that share chroma. Its missing red difference is taken as 0.
    """
    is_alone = form == YUV and len(data) % 4 == _SIZES[YUV]
    return decode(data + bytes((128, data[-1])), form)[:-1] if is_alone else decode(data, form)


def as_vga(image: NDArray[np.uint8], turned: int = 0) -> NDArray[np.uint8]:
    """Scale a grey, RGB or RGBA picture to 480 x 640 x 3 by nearest pixel, after a rotation.

    The picture is rotated counter-clockwise by `turned` = 0, 90, 180 or 270 degrees, for rotated sensors (epuck.md
    §7.1). Raises ValueError for other shapes and angles.
    """
    if image.ndim == 2:
        image = np.repeat(image[:, :, None], 3, axis=2)
    if image.ndim != 3 or image.shape[2] not in (3, 4) or not image.size:
        raise ValueError(f"a picture is height x width, grey or with 3 or 4 channels, not of shape {image.shape}")
    if turned not in (0, 90, 180, 270):
        raise ValueError(f"a picture can be turned by 0, 90, 180 or 270 degrees, not {turned}")
    image = np.rot90(image, turned // 90)
    rows = np.arange(HEIGHT) * image.shape[0] // HEIGHT
    columns = np.arange(WIDTH) * image.shape[1] // WIDTH
    return np.ascontiguousarray(image[rows][:, columns, :3], dtype=np.uint8)


_FORMS: Final = (RGB565, GREY, YUV)
"""Pixel formats in the order of `enum form` in line.c."""
_SIZES: Final = {RGB565: 2, GREY: 1, YUV: 2}
"""Bytes per pixel of each format."""


def _from_rgb565(data: NDArray[np.uint8]) -> Pixels:
    words = data[0::2].astype(np.uint16) << 8 | data[1::2]
    return np.stack([words >> 8 & 0xF8, words >> 3 & 0xFC, words << 3 & 0xF8], axis=1).astype(np.uint8)


def _from_grey(data: NDArray[np.uint8]) -> Pixels:
    return np.repeat(data[:, None], 3, axis=1)


def _from_yuv(data: NDArray[np.uint8]) -> Pixels:
    blue_difference, luma1, red_difference, luma2 = (data[index::4].astype(np.int32) for index in range(4))
    luma = np.stack([luma1, luma2], axis=1).reshape(-1)
    blue = luma + np.repeat((blue_difference - 128) * 256 // 145, 2)
    red = luma + np.repeat((red_difference - 128) * 256 // 183, 2)
    green = (256 * luma - 77 * red - 29 * blue) // 150
    return np.clip(np.stack([red, green, blue], axis=1), 0, 255).astype(np.uint8)


_DECODERS: Final[dict[str, Callable[[NDArray[np.uint8]], Pixels]]] = {
    RGB565: _from_rgb565,
    GREY: _from_grey,
    YUV: _from_yuv,
}
