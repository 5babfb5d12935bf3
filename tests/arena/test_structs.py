"""Structs shared by Python and C have the same layout; the C compiler computes the offset of every field."""

from __future__ import annotations

import ctypes
import re
from ctypes import Structure
from pathlib import Path

import pytest

import arena
import emu.boards.epuck
from arena.camera import line_of_sight, view
from arena.infrared import channel, propagation, ring
from arena.lockstep import threads
from arena.robots import native_robot
from arena.world import physics, solver, wheels
from emu.boards.epuck import analog, motors
from emu.boards.epuck.camera import native_camera
from emu.native_library import INT, functions
from emu.system.native_handle import Native

ARENA, BOARD = Path(arena.__path__[0]), Path(emu.boards.epuck.__path__[0])

TWINS: dict[Path, dict[str, type[Structure]]] = {
    ARENA / "lockstep/lockstep.c": {"native": Native, "code": native_robot._Code, "robot": native_robot.NativeRobot,
                           "native_world": physics.NativeWorld, "worker": threads._Worker,
                           "scheduler": threads._Scheduler},
    ARENA / "camera/renderer.c": {"disc": view.Disc, "led": view.Led, "side": view.Side, "polygon": view.Polygon,
                        "patch": view.Patch, "view": view.View, "rays": view.Rays},
    ARENA / "camera/line_of_sight.c": {"grid": line_of_sight._GridStruct},
    ARENA / "world/solver.c": {"settled": solver._Settled, "solver": solver._Solver},
    ARENA / "world/wheels.c": {"drive": wheels._Drive},
    ARENA / "world/physics.c": {"chipmunk": physics._Chipmunk, "disc": physics._Disc, "drive": physics._Drive,
                        "robot": physics._Robot,
                        "world": physics._World},
    ARENA / "infrared/propagation.c": {"disc": propagation._Disc, "side": propagation._Side,
                         "polygon": propagation._Polygon, "optics": propagation._Optics,
                         "poses": propagation._Poses},
    ARENA / "infrared/light.c": {"history": channel._History, "receivers": channel.Receivers, "source": ring._Source,
                        "source_list": ring._SourceList, "light": ring._Light, "emission": channel.Emission,
                        "poses": propagation._Poses, "sensing": ring._Sensing},
    BOARD / "camera/line.c": {"camera": native_camera.NativeCamera},
    BOARD / "motors.c": {"history": motors._History, "motor": motors._Motor, "pair": motors._Pair},
    BOARD / "ring.c": {"ring": analog._Ring},
}  # fmt: skip
WITHIN = {"ie1", "ie2"}
"""Python fields that are in C the second and later elements of an array."""


def fields_of(text: str, name: str) -> list[str]:
    """Return the names of a struct's fields, in order."""
    body = re.search(rf"^struct {name} \{{\n(.*?)^\}};", text, re.S | re.M)
    assert body is not None, name
    found: list[str] = []
    for one in re.sub(r"//.*|\[[^\]]*\]", "", body[1]).split(";"):
        called = re.match(r"[^(]*\(\*(\w+)\)\(", one)  # field that is a pointer to a function
        found += [called[1]] if called else [part.split()[-1].lstrip("*") for part in one.split(",") if part.strip()]
    return found


@pytest.mark.parametrize("source", TWINS, ids=lambda source: source.name)
def test_a_struct_has_the_offsets_and_the_size_of_its_twin(source: Path, tmp_path: Path) -> None:
    """Every ctypes structure has the field offsets and the size of its C struct; otherwise one side would access
    other memory."""
    text = source.read_text()
    names = {name: fields_of(text, name) for name in TWINS[source]}
    numbers = [number for name in names for number in (
        *(f"__builtin_offsetof(struct {name}, {field})" for field in names[name]), f"sizeof(struct {name})"
    )]  # fmt: skip
    source_file = tmp_path / "source_file.c"
    before = f'#include "{source.with_name("renderer.c")}"\n' if source.name == "line_of_sight.c" else ""
    source_file.write_text(f'{before}#include "{source}"\ni64 number(i64 place)\n{{\n    static const i64 numbers[] = '
                      f"{{{', '.join(numbers)}}};\n    return numbers[place];\n}}\n")  # fmt: skip
    number = functions(source_file, {"number": (INT, (INT,))})["number"]
    numbers_in_c = iter([number(place) for place in range(len(numbers))])
    for name, twin in TWINS[source].items():
        mine = [field[0] for field in twin._fields_ if field[0] not in WITHIN]
        offsets = [getattr(twin, field).offset for field in mine]
        assert [next(numbers_in_c) for _ in names[name]] == offsets, (name, names[name], mine)
        assert next(numbers_in_c) == ctypes.sizeof(twin), name


def test_every_shared_struct_is_compared() -> None:
    """Every struct that Python and C share is in TWINS; a new one needs an entry unless only C uses it."""
    own = {("renderer.c", "pixel"), ("line_of_sight.c", "beam"), ("physics.c", "vect"), ("physics.c", "twist"),
           ("propagation.c", "ray"), ("line.c", "scan"), ("motors.c", "state"),
           ("solver.c", "array"), ("solver.c", "body"), ("solver.c", "joint_class"), ("solver.c", "joint"),
           ("solver.c", "contact"), ("solver.c", "arbiter"), ("solver.c", "space")}  # fmt: skip
    found = {(path.name, name) for folder in (ARENA, BOARD) for path in folder.rglob("*.c")
             for name in re.findall(r"^struct (\w+) \{$", path.read_text(), re.M)}  # fmt: skip
    assert found - own == {(path.name, name) for path, twins in TWINS.items() for name in twins}
    assert own <= found
