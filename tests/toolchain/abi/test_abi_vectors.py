"""All vectors of tests/vectors/abi.csv, as caller and as callee (abi-elf.md §2.2, §2.3).

As caller, a compiled function passes objects of random bytes. At the entry of the called function each object must be
at the vector's location, and the result that is put at its location must arrive. As callee, a compiled function starts
with random registers and stack, copies its parameters, which must equal the bytes at the vector's locations, and
returns a known object.

`double` of the vectors has 4 bytes, which is `float` here. Where promotion would widen it, the test uses `long`,
which has the same location.
"""

from __future__ import annotations

import csv
import random
import re
from dataclasses import dataclass
from pathlib import Path

import pytest

import emu
from tests.fuzz.seeds import base_seed
from tests.toolchain.c_programs import build

BATCH = 64
ENTRY, BACK = "_arrived", "_sentinel"
STACK_BYTES = 96  # more than any vector uses
SCALAR_DOUBLE = re.compile(r"(?<!long )double")
STUB = "\n".join([" .text", " .global _arrived,_sentinel", "{labels}", "_arrived: nop", " return", "_sentinel: nop",
                  " bra _sentinel"])  # fmt: skip


@dataclass(frozen=True)
class Vector:
    """One signature: types, sizes and locations of the arguments and the result.

    Variadic arguments start at index `named`.
    """

    number: int
    types: list[str]
    sizes: list[int]
    places: list[str]
    result: str
    result_size: int
    result_place: str
    named: int | None
    prototyped: bool


def read(path: Path) -> list[Vector]:
    """Return all vectors of the file."""
    rows: dict[int, list[dict[str, str]]] = {}
    for row in csv.DictReader(path.open()):
        rows.setdefault(int(row["id"]), []).append(row)
    out = []
    for number, of_one in rows.items():
        args = [r for r in of_one if r["arg"] != "result"]
        result = next((r for r in of_one if r["arg"] == "result"), None)
        signature = of_one[0]["signature"]
        named = signature.partition("...")[0].count(",") if "..." in signature else None
        out.append(Vector(
            number, [r["type"] for r in args], [int(r["size"]) for r in args], [r["placement"] for r in args],
            of_one[0]["result"], int(result["size"]) if result else 0, result["placement"] if result else "",
            named, "called" not in signature,
        ))  # fmt: skip
    return out


def _type(v: Vector, k: int) -> str:
    promoted = not v.prototyped or (v.named is not None and k >= v.named)
    return SCALAR_DOUBLE.sub("long" if promoted else "float", v.types[k])


def _result(v: Vector) -> str:
    return SCALAR_DOUBLE.sub("float", v.result)


def _parameters(v: Vector) -> str:
    if not v.prototyped:
        return ""
    names = [f"{_type(v, k)} p{k}" for k in range(len(v.types) if v.named is None else v.named)]
    return ", ".join(names + ["..."] * (v.named is not None)) or "void"


def caller_source(v: Vector) -> str:
    """Return C source of the objects for the arguments and the result, and of the function that makes the call."""
    objects = [f"{_type(v, k)} a{v.number}_{k};" for k in range(len(v.types))]
    call = f"f{v.number}({', '.join(f'a{v.number}_{k}' for k in range(len(v.types)))})"
    if v.result != "void":
        objects.append(f"{_result(v)} r{v.number};")
        call = f"r{v.number} = {call}"
    return "\n".join(
        [*objects, f"{_result(v)} f{v.number}({_parameters(v)});", f"void c{v.number}(void) {{ {call}; }}"]
    )


def callee_source(v: Vector) -> str:
    """Return C source of the function that copies its arguments and returns an object."""
    lines = [f"{_type(v, k)} b{v.number}_{k};" for k in range(len(v.types))]
    body = [f"b{v.number}_{k} = p{k};" for k in range(len(v.types) if v.named is None else v.named)]
    if v.named is not None:
        body = [f"va_list l; va_start(l, p{v.named - 1});", *body]
        body += [f"b{v.number}_{k} = va_arg(l, {_type(v, k)});" for k in range(v.named, len(v.types))]
    if v.result != "void":
        lines.append(f"{_result(v)} s{v.number};")
        body.append(f"return s{v.number};")
    parameters = _parameters(v)
    if not v.prototyped:
        declared = " ".join(f"{_type(v, k)} p{k};" for k in range(len(v.types)))
        header = f"g{v.number}({', '.join(f'p{k}' for k in range(len(v.types)))}) {declared}"
    else:
        header = f"g{v.number}({parameters})"
    return "\n".join([*lines, f"{_result(v)} {header} {{ {' '.join(body)} }}"])


class Bench:
    """A machine with the functions of one batch."""

    def __init__(self, image: Path, seed: int) -> None:
        self.machine = emu.load(image, engine="auto")
        self.machine.run(100_000, until="_main")
        self.rng = random.Random(seed)
        self.top = self.machine.w[15] + STACK_BYTES + 64

    def enter(self, function: str) -> None:
        """Fill registers and stack with random values, push a return address and start the function."""
        m = self.machine
        for k in range(STACK_BYTES // 2):
            m.poke(self.top - STACK_BYTES + 2 * k, self.rng.randrange(0x10000))
        for r in range(8):
            m.w[r] = self.rng.randrange(0x10000)
        back = m.program_address(BACK)
        m.poke(self.top - 4, back & 0xFFFF)
        m.poke(self.top - 2, back >> 16)
        m.w[15] = self.top
        m.pc = m.program_address(function)

    def fill(self, name: str, size: int) -> bytes:
        """Fill an object with random bytes."""
        data = self.rng.randbytes(size)
        for k, byte in enumerate(data):
            self.machine.poke(self.machine.address_of(name) + k, byte, 1)
        return data

    def at(self, place: str, size: int) -> bytes:
        """Return the bytes of an argument at the first instruction of the called function."""
        if place == "none" or not size:
            return b""
        if place.startswith("stack"):
            return self.machine.peek_bytes(self.machine.w[15] + int(place.split()[1]), size)
        first, _, last = place.replace("W", "").partition(":")
        words = [self.machine.w[r] for r in range(int(first), int(last or first) + 1)]
        return b"".join(w.to_bytes(2, "little") for w in words)[:size]

    def call(self, v: Vector) -> str:
        """Check the caller's side; return a description of the first error, or ""."""
        given = [self.fill(f"_a{v.number}_{k}", size) for k, size in enumerate(v.sizes)]
        self.enter(f"_c{v.number}")
        if self.machine.run(20_000, until=ENTRY).reason != "until":
            return "the call is never made"
        wrong = [k for k, data in enumerate(given) if self.at(v.places[k], v.sizes[k]) != data]
        if wrong:
            return f"caller: argument {wrong[0]} is not in {v.places[wrong[0]]}"
        result = self.give(v)
        self.machine.run(20_000, until=BACK)
        if v.result != "void" and self.machine.peek_bytes(f"_r{v.number}", v.result_size) != result:
            return f"caller: the result is not taken from {v.result_place}"
        return "" if self.machine.w[15] == self.top - 4 else "caller: the stack is not balanced"

    def give(self, v: Vector) -> bytes:
        """Put a random result at the vector's location."""
        data, m = self.rng.randbytes(v.result_size), self.machine
        if v.result_place == "memory":
            for k, byte in enumerate(data):
                m.poke(m.w[0] + k, byte, 1)
        elif v.result_place:
            for k in range((v.result_size + 1) // 2):
                m.w[k] = int.from_bytes(data[2 * k : 2 * k + 2], "little") | (0xA500 if v.result_size == 1 else 0)
        return data

    def receive(self, v: Vector, where: int) -> str:
        """Check the callee's side; return a description of the first error, or "".

        `where` is free memory for a result in memory.
        """
        result = self.fill(f"_s{v.number}", v.result_size) if v.result != "void" else b""
        self.enter(f"_g{v.number}")
        if v.result_place == "memory":
            self.machine.w[0] = where
        given = [self.at(place, size) for place, size in zip(v.places, v.sizes, strict=True)]
        if self.machine.run(20_000, until=BACK).reason != "until":
            return "callee: does not return"
        for k, data in enumerate(given):
            if data and self.machine.peek_bytes(f"_b{v.number}_{k}", v.sizes[k]) != data:
                return f"callee: argument {k} is not taken from {v.places[k]}"
        if v.result_place == "memory" and self.machine.peek_bytes(where, v.result_size) != result:
            return "callee: the result is not at the hidden pointer"
        if v.result_place.startswith("W") and self.at(v.result_place, v.result_size) != result:
            return f"callee: the result is not in {v.result_place}"
        return "" if self.machine.w[15] == self.top - 4 else "callee: the stack is not balanced"


@pytest.mark.slow
@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_every_vector_of_the_calling_convention(level: str, vectors: Path, tmp_path: Path) -> None:
    """Compiled callers and callees use the locations of every row of tests/vectors/abi.csv.

    Each row is tried as a caller at one level and as a callee at the other, which the commit determines.
    """
    every = read(vectors / "abi.csv")
    types = SCALAR_DOUBLE.sub("float", (vectors / "abi.h").read_text())
    wrong: dict[int, str] = {}
    for first in range(0, len(every), BATCH):
        batch = every[first : first + BATCH]
        callers = {v.number for v in batch if (v.number + base_seed()) % 2 == (level == "-Os")}
        program = tmp_path / "vectors.c"
        functions = [caller_source(v) if v.number in callers else callee_source(v) for v in batch]
        program.write_text("\n".join(
            ["#include <stdarg.h>", types, *functions, "char spare[64];", "void arrived(void);",
             "int main(void) { spare[0] = 1; arrived(); return 0; }"]))  # fmt: skip
        stub = tmp_path / "stub.s"
        stub.write_text(STUB.format(labels="\n".join(f" .global _f{n}\n_f{n}:" for n in sorted(callers))) + "\n")
        image = tmp_path / "vectors.elf"
        built = build([program, stub], image, level, "-fno-lto", "-std=gnu11", "-w", "-Wl,--no-gc-sections")
        assert built.status == 0, built.messages
        bench = Bench(image, first)
        for v in batch:
            said = bench.call(v) if v.number in callers else bench.receive(v, bench.machine.address_of("_spare"))
            if said:
                wrong[v.number] = said
    assert wrong == {}
    assert len(every) == 757
