"""Structs that Python and compiled code share lie the same way: every field of every one, by the compiler itself."""

from __future__ import annotations

import ctypes
import re
from ctypes import Structure
from pathlib import Path

import pytest

import arena
import emu.boards.epuck
from arena import ahead, ether, infrared, optics, sight, swarm, wheels, world
from emu.boards.epuck import analog, lent, motors
from emu.hostcode import INT, functions
from emu.native import Native

ARENA, BOARD = Path(arena.__path__[0]), Path(emu.boards.epuck.__path__[0])

TWINS: dict[Path, dict[str, type[Structure]]] = {
    ARENA / "lockstep.c": {"native": Native, "code": ahead._Code, "robot": ahead.Ahead,
                           "ground": world.Ground, "helper": swarm._Helper, "swarm": swarm._Swarm},
    ARENA / "sight.c": {"disc": sight._Disc, "lamp": sight._Lamp, "side": sight._Side, "patch": sight._Patch,
                        "view": sight._View, "rays": sight._Rays},
    ARENA / "wheels.c": {"drive": wheels._Drive},
    ARENA / "world.c": {"chipmunk": world._Chipmunk, "disc": world._Disc, "robot": world._Robot,
                        "world": world._World},
    ARENA / "optics.c": {"disc": optics._Disc, "side": optics._Side, "optics": optics._Optics,
                         "poses": optics._Poses},
    ARENA / "light.c": {"track": ether._Track, "receivers": ether.Receivers, "heard": infrared._Heard,
                        "moment": infrared._Moment, "light": infrared._Light},
    BOARD / "line.c": {"camera": lent.LentCamera},
    BOARD / "motors.c": {"history": motors._History, "motor": motors._Motor, "pair": motors._Pair},
    BOARD / "ring.c": {"ring": analog._Ring},
}  # fmt: skip
WITHIN = {"ie1", "ie2"}
"""Later elements of what is an array for the compiled code."""


def fields_of(text: str, name: str) -> list[str]:
    """Names of a struct's fields, in order."""
    body = re.search(rf"^struct {name} \{{\n(.*?)^\}};", text, re.S | re.M)
    assert body is not None, name
    found: list[str] = []
    for one in re.sub(r"//.*|\[[^\]]*\]", "", body[1]).split(";"):
        called = re.match(r"[^(]*\(\*(\w+)\)\(", one)  # a pointer to a function
        found += [called[1]] if called else [part.split()[-1].lstrip("*") for part in one.split(",") if part.strip()]
    return found


@pytest.mark.parametrize("source", TWINS, ids=lambda source: source.name)
def test_a_struct_has_the_offsets_and_the_size_of_its_twin(source: Path, tmp_path: Path) -> None:
    """A field more, less or elsewhere on one side would be somebody else's memory on the other."""
    text = source.read_text()
    names = {name: fields_of(text, name) for name in TWINS[source]}
    numbers = [number for name in names for number in (
        *(f"__builtin_offsetof(struct {name}, {field})" for field in names[name]), f"sizeof(struct {name})"
    )]  # fmt: skip
    asking = tmp_path / "asking.c"
    asking.write_text(f'#include "{source}"\ni64 number(i64 place)\n{{\n    static const i64 numbers[] = '
                      f"{{{', '.join(numbers)}}};\n    return numbers[place];\n}}\n")  # fmt: skip
    number = functions(asking, {"number": (INT, (INT,))})["number"]
    told = iter([number(place) for place in range(len(numbers))])
    for name, twin in TWINS[source].items():
        mine = [field[0] for field in twin._fields_ if field[0] not in WITHIN]
        offsets = [getattr(twin, field).offset for field in mine]
        assert [next(told) for _ in names[name]] == offsets, (name, names[name], mine)
        assert next(told) == ctypes.sizeof(twin), name


def test_every_struct_that_is_shared_is_looked_at() -> None:
    """A new one gets a line above, unless it is the compiled code's own."""
    own = {("sight.c", "pixel"), ("sight.c", "hit"), ("world.c", "vect"),
           ("line.c", "scan"), ("motors.c", "state")}  # fmt: skip
    found = {(path.name, name) for folder in (ARENA, BOARD) for path in folder.glob("*.c")
             for name in re.findall(r"^struct (\w+) \{$", path.read_text(), re.M)}  # fmt: skip
    assert found - own == {(path.name, name) for path, twins in TWINS.items() for name in twins}
    assert own <= found
