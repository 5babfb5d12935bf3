"""`NativeRobot`: a robot that runs ahead, as native code sees it (`struct robot` of lockstep.c).

Input: the machine and its parts. Output: counts of CPU probes, and the picture row that was rendered last.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import POINTER, Structure, addressof, c_int64, c_void_p, pointer

from arena.camera.renderer import Renderer
from arena.camera.view import RowRays
from arena.infrared.ring import InfraredRing
from arena.world.wheels import Wheels
from emu.boards.epuck.board import Epuck
from emu.boards.epuck.camera.camera import DATA_PORT
from emu.boards.epuck.camera.native_camera import NativeCamera
from emu.boards.epuck.camera.pixels import line_code
from emu.boards.epuck.camera.sensors import HEIGHT
from emu.native_library import address_of
from emu.system.native_handle import Native

IN_PYTHON, RUNNABLE, AWAITS_LINE, AWAITS_POSES = range(4)
"""State of a robot that Python sets; lockstep.c explains them."""


class _Code(Structure):
    """`struct code` of lockstep.c."""

    _fields_ = [(name, c_void_p) for name in ("row_due", "send_line", "render_line", "steps_by", "add_steps", "draw",
                                              "begin_quantum")]


class NativeRobot(Structure):
    """`struct robot` of lockstep.c, which explains the fields."""

    _fields_ = [
        *((name, c_int64) for name in ("state", "tick", "exit_reason")), ("native", c_void_p), ("code", POINTER(_Code)),
        *((name, c_int64) for name in ("quantum", "on_at", "quanta_taken", "quanta_reported", "end", "probe_at",
                                       "probes", "busy_probes", "stuck_since", "probe_span", "report_after")),
        ("camera", c_void_p), ("data_port", c_int64), ("view", c_void_p), ("row_rays", c_void_p),
        *((name, c_int64) for name in ("camera_setting", "strip_first", "strip_last", "last_strip_row")),
        ("colours", c_void_p), ("noise", c_void_p), ("noise_shift", c_int64),
        *((name, c_void_p) for name in ("pair", "drive", "generator", "steps")),
        *((name, c_int64) for name in ("row", "href")), ("sensing", c_void_p),
        *((name, c_int64) for name in ("senses", "sensed_tick")),
    ]  # fmt: skip
    state: int
    tick: int
    exit_reason: int
    quanta_taken: int
    quanta_reported: int
    end: int
    probe_at: int
    probes: int
    busy_probes: int
    stuck_since: int
    camera_setting: int
    last_strip_row: int
    pair: int
    senses: int
    sensed_tick: int

    def connect(
        self, board: Epuck, renderer: Renderer, wheels: Wheels, ring: InfraredRing, draw: Callable[..., int],
        generator: int,
    ) -> None:  # fmt: skip
        """Set the native functions and objects of the robot's parts. `draw(generator)` returns 32 random bits."""
        assert board.camera is not None
        lines = line_code()
        render_line, self.view = renderer.native_handle()
        add_steps, self.drive = wheels.native_handle()
        self.generator = generator
        self._camera: NativeCamera = board.camera.native
        self.camera = addressof(self._camera)
        self.data_port = board.chip.ports[DATA_PORT].port.address >> 1
        row_due, send_line = map(address_of, (lines["row_on_bus"], lines["write_line"]))
        self.sensing = ring.sensing
        functions = row_due, send_line, render_line, board.motors.code, add_steps, address_of(draw), ring.begin_natively
        self.code = pointer(_Code(*functions))
        self._rays_by_row: dict[int, RowRays] = {}
        self._ray_addresses = (c_void_p * HEIGHT)()
        self.row_rays = addressof(self._ray_addresses)
        self._native: Native | None = None

    def attach(self, native: Native | None) -> None:
        """Set the handle of the machine's native code, if it has any."""
        self._native = native
        if native is not None:
            self._steps = (c_int64 * (2 * native.room))()
            self.native, self.steps = addressof(native), addressof(self._steps)

    def set_row_rays(self, row: int, rays: RowRays) -> None:
        """Set the rays of a picture row, for the present setting of the camera."""
        setting = self._camera.setting
        if setting != self.camera_setting:
            self._ray_addresses[:] = [None] * HEIGHT
            self._rays_by_row.clear()
            self.camera_setting = setting
        self._rays_by_row[row] = rays
        self._ray_addresses[row] = rays.address

    def take_strip_rays(self) -> RowRays | None:
        """Return the rays and pixels of the last recorded row that native code has rendered since the last call."""
        row, self.last_strip_row = self.last_strip_row, -1
        return self._rays_by_row.get(row)
