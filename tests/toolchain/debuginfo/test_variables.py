"""Locations of local variables in optimised code are correct or "optimised out", never wrong.

Random functions pass their variables to a probe function. At each call the argument is the variable's value. The
location of the variable at the address of the call must yield the same value.
"""

from __future__ import annotations

import random
from itertools import pairwise
from pathlib import Path

import pytest
from elftools.dwarf.die import DIE
from elftools.dwarf.dwarfinfo import DWARFInfo

import emu
from tests.fuzz.seeds import base_seed
from tests.toolchain.c_programs import build
from tests.toolchain.debuginfo.dwarf_reader import dwarf_of

TYPES = {"int": (2, True), "unsigned int": (2, False), "long": (4, True), "unsigned char": (1, False),
         "signed char": (1, True)}  # fmt: skip
FUNCTIONS = 12
PROLOGUE = """
volatile int step = 1;
__attribute__((noinline)) void probe(long value) { __asm__ volatile("" : : "r"(value) : "memory"); step++; }
__attribute__((noinline)) void change(void *p) { *(unsigned char *)p ^= 5; __asm__ volatile("" : : "r"(p) : "memory"); }
"""


class Program:
    """Generator of random functions with scalars, address-taken scalars, arrays, structs and inlined calls."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.lines = PROLOGUE.splitlines()
        self.probes: dict[int, str] = {}  # line -> probed variable
        for n in range(FUNCTIONS):
            self.function(n)
        self.lines.append("int main(void) {")
        for n in range(FUNCTIONS):
            self.lines.append(f"  f{n}({self.random.randrange(-99, 99)}, {self.random.randrange(9999)});")
        self.lines.append("  return 0; }")

    def probe(self, name: str) -> None:
        self.lines.append(f"  probe({name});")
        self.probes[len(self.lines)] = name

    def function(self, n: int) -> None:
        rng = self.random
        inline = rng.choice(["static inline", "__attribute__((noinline))"])
        self.lines.append(f"{inline} int f{n}(int a, long b)")
        self.lines.append("{")
        names = {"a": "int", "b": "long"}
        for k in range(rng.randint(1, 5)):
            kind = rng.choice(list(TYPES))
            names[f"v{k}"] = kind
            self.lines.append(f"  {kind} v{k} = {self.expression(list(names)[:-1])};")
        array = rng.random() < 0.5
        if array:
            self.lines.append(f"  int table[{rng.randint(2, 6)}] = {{ {self.expression(list(names))} }};")
            self.lines.append("  change(table);")
        for _ in range(rng.randint(2, 8)):
            self.statement(n, names, array)
        for name in names:
            self.probe(name)
        self.lines.append(f"  return {self.expression(list(names))}{' + table[1]' if array else ''};")
        self.lines.append("}")

    def expression(self, names: list[str]) -> str:
        rng = self.random
        terms = [rng.choice([*names, str(rng.randrange(1, 300)), "step"]) for _ in range(rng.randint(1, 3))]
        return f" {rng.choice('+-*^&|')} ".join(terms)

    def statement(self, n: int, names: dict[str, str], array: bool) -> None:
        rng = self.random
        target = rng.choice(list(names))
        match rng.randrange(7):
            case 0 | 1:
                self.lines.append(f"  {target} = {self.expression(list(names))};")
            case 2:
                self.lines.append(f"  if ({self.expression(list(names))} > {rng.randrange(99)}) {target} += step;")
            case 3:
                self.lines.append(f"  for (int i = 0; i < {rng.randint(1, 4)}; i++) {{")
                self.lines.append(f"  {target} += {self.expression(list(names))};")
                self.probe(rng.choice([target, "i"]))
                self.lines.append("  }")
            case 4:
                self.lines.append(f"  change(&{target});")
            case 5 if n:
                self.lines.append(f"  {target} += f{rng.randrange(n)}({target}, {self.expression(list(names))});")
            case _:
                self.probe(target)


class LocationReader:
    """Evaluates DWARF locations on a stopped machine, independently of the debugger."""

    def __init__(self, image: Path, machine: emu.Machine) -> None:
        self.info: DWARFInfo = dwarf_of(image)
        self.machine = machine
        entries = [die for unit in self.info.iter_CUs() for die in unit.iter_DIEs()]
        self.rows = [
            (one.address, two.address, one.line)
            for unit in self.info.iter_CUs()
            for one, two in pairwise(
                e.state for e in self.info.line_program_for_CU(unit).get_entries() if e.state is not None
            )
            if not one.end_sequence
        ]
        self.scopes = [die for die in entries if die.tag == "DW_TAG_subprogram"]

    def line(self, pc: int) -> int:
        """Return the source line of an address."""
        return max(((start, line) for start, end, line in self.rows if start <= pc < end), default=(-1, 0))[1]

    def covers(self, die: DIE, pc: int) -> bool:
        values = {k: v.value for k, v in die.attributes.items()}
        if "DW_AT_low_pc" in values:
            return bool(values["DW_AT_low_pc"] <= pc < values["DW_AT_high_pc"])
        if "DW_AT_ranges" in values:
            pieces = self.info.range_lists().get_range_list_at_offset(values["DW_AT_ranges"])
            return any(piece.begin_offset <= pc < piece.end_offset for piece in pieces)
        return False

    def value(self, name: str, pc: int) -> int | None:
        """Return the value of the innermost variable with a name at `pc`, or None if it has no location."""
        for function in self.scopes:
            if self.covers(function, pc):
                found = self._innermost(function, name, pc, function)
                if found is not None:
                    return self._read(*found, pc)
        return None

    def _innermost(self, scope: DIE, name: str, pc: int, function: DIE) -> tuple[DIE, DIE] | None:
        """Return the variable's entry, or the entry of an inlined function that hides outer variables."""
        for child in scope.iter_children():
            if child.tag in ("DW_TAG_lexical_block", "DW_TAG_inlined_subroutine") and self.covers(child, pc):
                found = self._innermost(child, name, pc, function)
                if found or child.tag == "DW_TAG_inlined_subroutine":
                    return found or (child, function)
        for child in scope.iter_children():
            named = child.attributes.get("DW_AT_name")
            if child.tag in ("DW_TAG_variable", "DW_TAG_formal_parameter") and named and named.value == name.encode():
                return child, function
        return None

    def _read(self, die: DIE, function: DIE, pc: int) -> int | None:
        if die.tag == "DW_TAG_inlined_subroutine":
            return None
        size, signed = TYPES[self._type(die)]
        location, constant = (die.attributes.get(f"DW_AT_{what}") for what in ("location", "const_value"))
        if constant is not None:
            assert location is None
            data = constant.value.to_bytes(size, "little") if isinstance(constant.value, int) else bytes(constant.value)
            return int.from_bytes(data[:size], "little", signed=signed)
        if location is None:
            return None
        if location.form == "DW_FORM_block1":
            return self._evaluate(list(location.value), function, size, signed)
        for entry in self.info.location_lists().get_location_list_at_offset(location.value):
            if entry.begin_offset <= pc < entry.end_offset:
                return self._evaluate(list(entry.loc_expr), function, size, signed)
        return None

    def _type(self, die: DIE) -> str:
        base = die.get_DIE_from_attribute("DW_AT_type")
        return str(base.attributes["DW_AT_name"].value.decode())

    def _evaluate(self, code: list[int], function: DIE, size: int, signed: bool) -> int | None:
        w = self.machine.w
        if code[0] == 0x91:  # DW_OP_fbreg
            base = list(function.attributes["DW_AT_frame_base"].value)
            at = self.stack(base[0] - 0x70) + _sleb(base[1:]) + _sleb(code[1:])
            data = bytes(self.machine.peek(at + k, 1) for k in range(size))
        elif code[0] == 0x9E:  # DW_OP_implicit_value
            data = bytes(code[2:])[:size]
        elif 0x93 in (code[0], code[3] if len(code) > 3 else 0):  # DW_OP_piece without location
            return None
        else:
            words = [code[k] - 0x50 for k in range(0, len(code), 3)]
            data = b"".join(w[r].to_bytes(2, "little") for r in words)[:size]
        return int.from_bytes(data, "little", signed=signed)

    def stack(self, register: int) -> int:
        """Return W14 or W15 of the caller: the probe's return address lies above it."""
        return self.machine.w[register] - (4 if register == 15 else 0)


def _sleb(code: list[int]) -> int:
    value = shift = 0
    for byte in code:
        value |= (byte & 0x7F) << shift
        shift += 7
    return value - (1 << shift) if code[-1] & 0x40 else value


def compare(seed: int, options: tuple[str, ...], folder: Path) -> tuple[int, int]:
    """Run a program; return (number of probes whose variable has a location, number of probes).

    A wrong value fails.
    """
    program = Program(seed)
    (folder / "p.c").write_text("\n".join(program.lines) + "\n")
    built = build([folder / "p.c"], folder / "p.elf", "-g", "-w", "-fwrapv", *options)
    assert built.status == 0, built.messages
    machine = emu.load(folder / "p.elf", engine="auto")
    assert machine.image is not None
    reader = LocationReader(folder / "p.elf", machine)
    entry = machine.image.symbols.find("probe")
    assert entry is not None
    evaluated = seen = 0
    while machine.run(until=entry.address, cycles=2_000_000).reason == "until" and seen < 400:
        at = machine.w[15] - 4
        back = machine.peek(at, 2) & 0xFFFE | (machine.peek(at + 2, 2) & 0x7F) << 16
        pc = back - 2
        name = program.probes.get(reader.line(pc))
        if name is not None:
            seen += 1
            said = reader.value(name, pc)
            meant = int.from_bytes(machine.w[0].to_bytes(2, "little") + machine.w[1].to_bytes(2, "little"), "little")
            if said is not None:
                evaluated += 1
                assert said & 0xFFFFFFFF == meant, f"seed {seed} {options}: {name} at line {reader.line(pc)}, {pc:#x}"
        machine.step()
    return evaluated, seen


@pytest.mark.slow
@pytest.mark.parametrize("options", [("-O0",), ("-O1",), ("-Os",), ("-O2",), ("-Os", "-fno-lto")], ids=" ".join)
def test_locations_of_variables_are_correct(options: tuple[str, ...], tmp_path: Path) -> None:
    """Locations give the values of all variables, in two of four programs, which the commit determines."""
    evaluated = seen = 0
    for seed in range(base_seed() % 2, 4, 2):
        one, all_ = compare(seed, options, tmp_path)
        evaluated, seen = evaluated + one, seen + all_
    assert seen > 50
    if options == ("-O0",):
        assert evaluated == seen
    else:
        assert evaluated > seen / 5  # DWARF 2 gives constants no location


WORDS = """
struct three { int a; char b, c; long d; };
struct pair { int lo, hi; };
volatile int sink = 3;
static const long big = 123456;
__attribute__((noinline)) long sum(struct three t, struct pair p)
{
    int first = t.a + p.lo;
    sink = first;
    return first + t.c + p.hi + t.d;
}
int main(void)
{
    int five = 5;
    long long wide = 0x123456789ALL;
    sink = five + (int)wide + (int)big;
    for (int i = 0; i < 3; i++)
        sink += i;
    return sum((struct three){sink, 2, 3, sink * 4L}, (struct pair){7, sink});
}
"""


@pytest.mark.parametrize("level", ["-O1", "-Os", "-O2"])
def test_structs_in_registers_and_constants_have_values(level: str, tmp_path: Path) -> None:
    """Struct members in registers and variables that the optimiser replaced by constants have correct values."""
    (tmp_path / "words.c").write_text(WORDS)
    built = build([tmp_path / "words.c"], tmp_path / "words.elf", "-g", level, "-fno-lto")
    assert built.status == 0, built.messages
    machine = emu.load(tmp_path / "words.elf", engine="auto")
    machine.run(until="main", cycles=1_000_000)
    machine.step()
    assert [machine.value(name).get() for name in ("five", "wide", "big")] == [5, 0x123456789A, 123456]
    machine.run(until="sum", cycles=1_000_000)
    shown = [machine.value(name).get() for name in ("t.a", "t.c", "t.d", "p.lo", "p.hi")]
    total = shown[0]
    assert shown == [total, 3, 4 * total, 7, total]
    machine.set_var("t.c", 99)
    assert (machine.var("t.c"), machine.w[1] & 0xFF) == (99, 2)
