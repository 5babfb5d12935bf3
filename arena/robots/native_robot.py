"""`Ahead`: what compiled code knows of a robot that runs ahead: `struct robot` of lockstep.c.

In: the machine and its parts. Out: counts of looks at the CPU, and which line of the picture was painted last.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import POINTER, Structure, addressof, c_int64, c_void_p, pointer

from arena.camera.renderer import Fan, Sight
from arena.world.wheels import Wheels
from emu.boards.epuck.board import Epuck
from emu.boards.epuck.camera.camera import DATA_PORT
from emu.boards.epuck.camera.native_camera import LentCamera
from emu.boards.epuck.camera.pixels import line_code
from emu.boards.epuck.camera.sensors import HEIGHT
from emu.native_library import address_of
from emu.system.native_handle import Native

AWAY, RUNS, PAINTS, LOOKS = range(4)
"""What is to be done with a robot."""


class _Code(Structure):
    _fields_ = [(name, c_void_p) for name in ("asked", "send", "line", "both_by", "turned", "draw")]


class Ahead(Structure):
    """See the struct."""

    _fields_ = [
        *((name, c_int64) for name in ("stands", "tick", "why")), ("native", c_void_p), ("code", POINTER(_Code)),
        *((name, c_int64) for name in ("quantum", "on_at", "taken", "told", "end", "probe_at", "probes", "busy",
                                       "stuck_at", "probe_span", "kept")),
        ("camera", c_void_p), ("data_port", c_int64), ("view", c_void_p), ("fans", c_void_p),
        *((name, c_int64) for name in ("setting", "first_strip", "last_strip", "strip")),
        ("colours", c_void_p), ("noise", c_void_p), ("noise_shift", c_int64),
        *((name, c_void_p) for name in ("pair", "drive", "generator", "steps")),
        *((name, c_int64) for name in ("row", "href")),
    ]  # fmt: skip
    stands: int
    tick: int
    why: int
    taken: int
    told: int
    end: int
    probe_at: int
    probes: int
    busy: int
    stuck_at: int
    setting: int
    strip: int
    pair: int

    def join(self, board: Epuck, sight: Sight, wheels: Wheels, draw: Callable[..., int], generator: int) -> None:
        """Let it call what these have in C; `draw(generator)` gives 32 random bits."""
        assert board.camera is not None
        lines = line_code()
        line, self.view = sight.lend()
        turned, self.drive = wheels.lend()
        self.generator = generator
        self._camera: LentCamera = board.camera.lent
        self.camera = addressof(self._camera)
        self.data_port = board.chip.ports[DATA_PORT].port.address >> 1
        self.code = pointer(
            _Code(*map(address_of, (lines["asked"], lines["send"])), line, board.motors.code, turned, address_of(draw))
        )
        self._fans_kept: dict[int, Fan] = {}
        self._fans_at = (c_void_p * HEIGHT)()
        self.fans = addressof(self._fans_at)
        self._native: Native | None = None

    def run_by(self, native: Native | None) -> None:
        """What `Machine.lend` gave."""
        self._native = native
        if native is not None:
            self._steps = (c_int64 * (2 * native.room))()
            self.native, self.steps = addressof(native), addressof(self._steps)

    def know(self, row: int, fan: Fan) -> None:
        """How a row is painted in the present setting of the camera."""
        setting = self._camera.setting
        if setting != self.setting:
            self._fans_at[:] = [None] * HEIGHT
            self._fans_kept.clear()
            self.setting = setting
        self._fans_kept[row] = fan
        self._fans_at[row] = fan.address

    @property
    def last_strip_fan(self) -> Fan | None:
        """What the last line that is recorded was painted with, since this was asked last."""
        row, self.strip = self.strip, -1
        return self._fans_kept.get(row)
