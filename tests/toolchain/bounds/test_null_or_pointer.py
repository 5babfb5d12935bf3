"""Abstract values of a pointer that may be NULL; annotated call targets that the linker has dropped."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest

from tests.fuzz.compiler.fuzz_bounds import measure
from tests.toolchain.c_programs import build
from toolchain.bounds.abstract import values
from toolchain.bounds.abstract.conditions import FlagResult
from toolchain.bounds.abstract.values import Interval, extremes, interval, known_bits, union
from toolchain.bounds.program import Program
from toolchain.bounds.report import Bound, BoundAnalysis
from toolchain.elf.read import read_executable
from toolchain.errors import ToolError

QUEUE = """
struct place { unsigned char filled, size, payload[15]; } queue[4];
volatile unsigned char first, length;
__attribute__((noinline)) int put(const unsigned char *bytes, unsigned char size)
{
    struct place *p = 0;
    if (length < 4) p = queue + ((first + length++) & 3);
    __asm__ volatile("" : "+r"(p));
    if (!p) return 0;
    for (unsigned char k = 0; k < (size & 15); k++) p->payload[k] = bytes[k];
    p->filled = 1;
    return 1;
}
int main(void) { return put((const unsigned char *)"abc", 3) + put((const unsigned char *)"abcdef", 6); }
"""
CALLER = """
typedef int (*hook)(int);
hook volatile chosen;
int add(int x) { return x + 1; }
__attribute__((noinline)) int call(int x) { return chosen(x); }
int main(void) { chosen = add; return call(2); }
"""
NOTES = "#include <bounds.h>\nTARGETS_OF(a.c / call, NAME);\n"


def bound_of(image: Path) -> Bound:
    program = Program(read_executable(image.read_bytes(), str(image)))
    return BoundAnalysis(program).bound("_main", program.calls.named("main"), "call")


@pytest.mark.parametrize("level", ["-O1", "-Os"])
def test_a_store_through_a_pointer_that_may_be_null_spares_the_stack_pointer(tmp_path: Path, level: str) -> None:
    """The pointer is tested before the store, so it is not between 0 and the array, where W15 lies."""
    (tmp_path / "a.c").write_text(QUEUE)
    assert build([tmp_path / "a.c"], tmp_path / "a.elf", level, "-g", "-fno-lto").status == 0
    seen, bound = measure(tmp_path / "a.elf"), bound_of(tmp_path / "a.elf")
    assert not isinstance(seen, str), seen
    assert bound.stack_is_known, bound.unbounded
    assert seen["_main"].stack <= bound.bytes
    assert bound.cycles is not None
    assert seen["_main"].cycles <= bound.cycles


def holds(where: values.Value, number: int) -> bool:
    """Whether a number satisfies the set's extremes, its known bits and its least member other than 0."""
    (lo, hi), (mask, bits) = extremes(where), known_bits(where)
    least = where.least if isinstance(where, Interval) else 0
    return lo <= number <= hi and number & mask == bits and (number == 0 or number >= least)


def check_unions(seed: int) -> None:
    """Build random unions, restrict them to what is not 0, and check that no member is lost."""
    random = Random(seed)
    for _ in range(2_000):
        members, joined = [0], 0
        for _ in range(random.randint(1, 4)):
            lo = random.choice((0, 1, random.randint(0, 60_000)))
            hi = lo + random.choice((0, 1, random.randint(0, 5_000)))
            members += [lo, hi, random.randint(lo, hi)]
            joined = union(joined, interval(lo, hi)) if random.random() < 0.5 else union(interval(lo, hi), joined)
        assert all(holds(joined, member) for member in members)
        left = FlagResult(0, *extremes(joined), False).restrict("NZ", joined)
        assert all(holds(left, member) for member in members if member), (members, joined, left)


def test_no_member_of_a_union_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unions of 0 and intervals keep every member; a least member that is too great is found."""
    check_unions(1)
    least = values._least_but_zero
    monkeypatch.setattr(values, "_least_but_zero", lambda value: least(value) + 2)
    with pytest.raises(AssertionError):
        check_unions(1)


def test_a_target_that_the_linker_dropped_adds_nothing(tmp_path: Path) -> None:
    """TARGETS_OF names a function of its own file that is dropped while its debug information stays."""
    armed = "extern int (*volatile chosen)(int); void arm(void) { chosen = apply; }\n"
    target = "static int apply(int x) { return x / 7; }\n"
    a, b, image = tmp_path / "a.c", tmp_path / "b.c", tmp_path / "a.elf"
    flags = "-Os", "-g", "-w", "-fno-lto", "-ffunction-sections", "-Wl,--gc-sections"
    a.write_text(NOTES.replace("NAME", "add") + CALLER)
    assert build([a], image, *flags).status == 0
    alone = bound_of(image)
    assert alone.cycles is not None
    b.write_text(NOTES.replace("NAME", "apply") + target + armed)
    assert build([a, b], image, *flags).status == 0
    assert bound_of(image).cycles == alone.cycles
    b.write_text(NOTES.replace("NAME", "absent") + target + armed)
    assert build([a, b], image, *flags).status == 0
    with pytest.raises(ToolError, match="absent is neither a function nor a function type"):
        bound_of(image)


def test_targets_in_a_file_that_is_not_linked_are_none(tmp_path: Path) -> None:
    """TARGETS_OF names a function of its own file, which the linker has dropped; a wrong name elsewhere is refused."""
    (tmp_path / "a.c").write_text(CALLER)
    (tmp_path / "b.c").write_text(NOTES.replace("NAME", "apply") + "static int apply(int x) { return x; }\n")
    image = tmp_path / "a.elf"
    assert build([tmp_path / "a.c", tmp_path / "b.c"], image, "-Os", "-g", "-w", "-fno-lto").status == 0
    assert BoundAnalysis(program := Program(read_executable(image.read_bytes(), str(image)))).bound(
        "_call", program.calls.named("call"), "call"
    )
    (tmp_path / "a.c").write_text(NOTES.replace("NAME", "ad") + CALLER)
    assert build([tmp_path / "a.c"], image, "-Os", "-g", "-w", "-fno-lto").status == 0
    with pytest.raises(ToolError, match="ad is neither a function nor a function type"):
        bound_of(image)
