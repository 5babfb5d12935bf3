"""`NativeCamera`: camera state for native code that renders lines; twin of `struct camera` in line.c.

Native code renders the same bytes as `Camera`, or declines a line, which Python then renders.
"""

from __future__ import annotations

from ctypes import Structure, c_double, c_int64, c_uint64, c_void_p

from emu.boards.epuck.camera.exposure import ONE
from emu.system.record import Record


class NativeCamera(Structure):
    """Addresses in the record, and the settings of a `Readout`. `setting` is 0 before the first `Readout.publish`."""

    _fields_ = [
        *((name, c_void_p) for name in ("scan", "plugged", "lamp", "exposure", "begin", "end", "byte_tcy", "line")),
        ("setting", c_int64), ("row", c_void_p), ("count", c_int64), ("form", c_int64), ("gains", c_double * 3),
        ("manual", c_double), ("one", c_uint64),
    ]  # fmt: skip
    setting: int

    @classmethod
    def of(cls, record: Record) -> NativeCamera:
        """Return the camera state for native code, with the addresses of a record."""
        cells = ("frame_tcy", "plugged", "lamp", "exposure", "line_from", "line_to", "line_byte_tcy", "line")
        return cls(*(record.address + record.fields[f"camera.{cell}"].offset for cell in cells), one=ONE)
