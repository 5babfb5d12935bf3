"""Bounds of linked images: at least the time measured on the emulator, and equal to it if every value is known."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from emu.image.loader import load_image
from tests.fuzz.compiler.fuzz_bounds import examine, measure
from tests.toolchain.c_programs import build
from toolchain.bounds.program import Program
from toolchain.bounds.report import BoundAnalysis
from toolchain.cli import main
from toolchain.elf.read import read_executable

COUNTDOWN_CONDITION = """
int a[20];
__attribute__((noinline)) int sum(int n) { int s = 0; for (int i = 0; i < n; i++) s += a[i]; return s; }
__attribute__((noinline)) int fib(int n) { return n < 2 ? n : fib(n - 1) + fib(n - 2); }
int main(void) { for (int i = 0; i < 20; i++) a[i] = i * i; volatile int x = sum(20) + fib(6) + sum(7) / 3; return x; }
"""
LIST = """
#include <bounds.h>
struct item { struct item *next; } items[8], *volatile head;
__attribute__((noinline)) int count(struct item *p)
{
    int c = 0;
    NOTE
    for (; p; p = p->next) c++;
    return c;
}
int main(void)
{
    for (int i = 0; i < 7; i++) items[i].next = &items[i + 1];
    head = items;
    return count(head);
}
"""
NESTED = """
#include <bounds.h>
struct item { struct item *next; int key; } items[8], *volatile head;
__attribute__((noinline)) int pairs(struct item *q, int key)
{
    for (; q; q = q->next) {
        LOOP_BOUND(7);
        for (struct item *p = q; p; p = p->next) if (p->key == key) return 1;
    }
    return 0;
}
int main(void) { return pairs(head, 3); }
"""
TABLE = """
#include <bounds.h>
struct item { struct item *next; int key; } items[8], *table[8];
volatile int found;
__attribute__((noinline)) void visit(struct item *p) { __asm__ volatile("repeat #99\\n nop" :: "r"(p)); }
int main(void)
{
    for (int i = 0; i < 8; i++) { items[i].next = table[i & 3]; table[i & 3] = &items[i]; }
    for (int i = 0; i < 8; i++) {
        LOOP_BOUND(b); LOOP_TOTAL(min(t, 8 * b));
        for (struct item *p = table[i]; p; p = p->next) visit(p);
    }
    return 0;
}
"""
SPLIT = """
#include <bounds.h>
struct item { struct item *next; int key; } items[8], *head, **volatile place;
__attribute__((noinline)) void visit(struct item *p) { __asm__ volatile("repeat #99\\n nop" :: "r"(p)); }
__attribute__((noinline)) void walk(void)
{
    const struct item *s;
    place = &head;
    LOOP_BOUND(n);
    while ((s = *place) != 0) {
        if (s->key)
            visit((struct item *)s);
        SAME_LOOP();
        if (*place == s)
            place = &((struct item *)s)->next;
    }
}
int main(void) { walk(); return 0; }
"""
COPY = """
#include <bounds.h>
#include <string.h>
char to[40], from[40] = {1, 2};
volatile unsigned size = 20;
ARGUMENT_BOUND(copy, 2, 20);
__attribute__((noinline)) void copy(char *a, const char *b, unsigned n)
{
    memcpy(a, b, n);
    __asm__ volatile("" ::: "memory");
}
int main(void)
{
    copy(to + (size >> 9), from + (size & 1), size);
    return to[size];
}
"""
MASKS = """
#include <dspic30f6014a.h>
int main(void) { SRbits.IPL = 5; __asm__ volatile("repeat #29\\n nop"); SRbits.IPL = 0; return 0; }
"""


def built(folder: Path, text: str, *options: str) -> Path:
    (folder / "program.c").write_text(text)
    made = build([folder / "program.c"], folder / "program.elf", *(options or ("-Os",)), "-g")
    assert made.status == 0, made.messages
    return folder / "program.elf"


def report(capsys: pytest.CaptureFixture[str], image: Path, *options: str) -> dict:
    """Return the row of main in the report of `bounds --json`."""
    assert main(["bounds", str(image), "--json", *options]) == 0
    row: dict = json.loads(capsys.readouterr().out)["calls"][0]
    return row


@pytest.mark.parametrize("level", ["-O0", "-Os", "-O2"])
def test_counted_loops_recursion_and_division_are_bounded_closely(tmp_path, capsys, level: str) -> None:
    """Bounds of counted loops, recursion and division are at least the measured time and at most 5 % above it."""
    image = built(tmp_path, COUNTDOWN_CONDITION, level)
    seen = measure(image)
    assert isinstance(seen, dict)
    row = report(capsys, image)
    assert seen["_main"].cycles <= row["cycles"] <= 1.05 * seen["_main"].cycles
    assert max(row["stack"].values()) >= seen["_main"].stack


@pytest.mark.parametrize("seed", [2])
def test_random_programs_stay_within_their_bounds(tmp_path: Path, seed: int) -> None:
    """Bounds of random programs are at least the measured cycles and stack (sample of fuzz_bounds.py)."""
    outcome, pairs = examine(seed, tmp_path)
    assert outcome == "bounded"
    seen, bound = pairs["_main"]
    assert seen.cycles <= bound.cycles <= 1.05 * seen.cycles
    assert seen.stack <= bound.bytes


def test_a_loop_over_a_list_is_named_with_its_line(tmp_path, capsys) -> None:
    """The report names the line of a loop over a list, whose length depends on data, and gives no bound."""
    image = built(tmp_path, LIST.replace("NOTE", ""))
    row = report(capsys, image)
    assert row["cycles"] is None
    (place,) = row["open"]
    assert "program.c:8 " in place
    assert main(["bounds", str(image)]) == 0
    assert "program.c:8 " in capsys.readouterr().out


def test_an_annotated_loop_is_bounded_by_its_annotation(tmp_path, capsys) -> None:
    """A loop has the bound of its annotation: each further permitted iteration adds the same cycles.

    The program executes eight iterations.
    """
    image = built(tmp_path, LIST.replace("NOTE", "LOOP_BOUND(n + 1);"))
    seen = measure(image)
    assert isinstance(seen, dict)
    assert report(capsys, image)["cycles"] is None
    seven, eight, nine = (report(capsys, image, "--let", f"n={n}")["cycles"] for n in (7, 8, 9))
    assert seen["_main"].cycles <= seven
    assert nine - eight == eight - seven > 0
    assert report(capsys, image, "--let", "n=2")["cycles"] < seen["_main"].cycles  # as annotated


@pytest.mark.parametrize("level", ["-Os", "-O1", "-O2"])
def test_the_annotation_of_an_inner_loop_does_not_apply_to_the_outer_one(tmp_path, capsys, level: str) -> None:
    """The annotation of an inner loop does not bound the outer loop, although the inner loop's line also exits both."""
    row = report(capsys, built(tmp_path, NESTED, level))
    assert row["cycles"] is None
    assert [place for place in row["open"] if "program.c:6 " in place or "program.c:8 " in place]


def test_one_loop_of_the_source_that_became_two_shares_its_rounds(tmp_path, capsys) -> None:
    """Two loops compiled from one source loop share its iterations.

    Ten more iterations then add ten times the cost of one, not its square; visit() alone takes over 100 cycles.
    """
    image = built(tmp_path, SPLIT)
    few, many = (report(capsys, image, "--let", f"n={n}")["cycles"] for n in (10, 20))
    assert 1_000 < many - few < 2_000


def test_rounds_of_all_entries_together_are_counted_once(tmp_path, capsys) -> None:
    """An annotated total over all entries of a loop is counted once.

    Eight lists of up to eight items have eight items in total: 8 visits of over 100 cycles, not 64.
    """
    image = built(tmp_path, TABLE)
    seen = measure(image)
    assert isinstance(seen, dict)
    apart, together, more = (
        report(capsys, image, "--let", "b=8", *words)["cycles"] for words in ((), ("--let", "t=8"), ("--let", "t=9"))
    )
    assert seen["_main"].cycles <= together <= 1.2 * seen["_main"].cycles
    assert apart > 64 * 100 > 3 * together
    assert 100 < more - together < 150
    assert report(capsys, image, "--let", "b=1", "--let", "t=80")["cycles"] <= together  # the smaller bound


def test_a_bounded_argument_bounds_a_copy(tmp_path, capsys) -> None:
    """The bounded length argument of memcpy bounds its loop.

    memcpy counts down in bytes for odd addresses, and tests the sign of the remaining count.
    """
    row = report(capsys, built(tmp_path, COPY), "--function", "copy")
    assert 20 < row["cycles"] < 80


def test_paths_that_call_a_function_can_be_excluded(tmp_path, capsys) -> None:
    """Paths that call an excluded function do not count: main is then cheaper, or has no path to its return."""
    text = '__attribute__((noinline)) int rare(int x) { __asm__ volatile("repeat #99\\n nop"); return x; }\n'
    text += "volatile int v; int main(void) { int x = v; return x == 7 ? rare(x) : x; }"
    image = built(tmp_path, text)
    whole, cheap = report(capsys, image)["cycles"], report(capsys, image, "--without", "rare")["cycles"]
    assert whole - cheap > 100
    assert main(["bounds", str(image), "--without", "nothing"]) == 2
    assert "no function is called nothing" in capsys.readouterr().err


def test_a_call_is_bounded_inside_of_sections_too(tmp_path, capsys) -> None:
    """A call within a critical section is bounded too.

    There a PRIVATE_VALUE does not hold, and the code that leaves a section runs only there.
    """
    text = "#include <bounds.h>\nint depth; PRIVATE_VALUE(depth, 0);\n__attribute__((noinline)) void leave(void)\n"
    text += '{ if (depth) { depth--; __asm__ volatile("repeat #99\\n nop" ::: "memory"); } }\n'
    text += "int main(void) { depth = 1; leave(); return depth; }"
    assert report(capsys, built(tmp_path, text), "--function", "leave")["cycles"] > 100


def test_a_branch_on_a_shift_is_followed(tmp_path, capsys) -> None:
    """The analysis follows branches on shift results: shifts by a literal set Z and N and have no byte form."""
    shift = '__asm__("lsr %1,#3,%0\\n\\tbra z,1f\\n\\tnop\\n1:" : "=r"(r) : "r"(v));'
    text = "volatile int v; int main(void) { int r; " + shift + " return r; }"
    assert report(capsys, built(tmp_path, text))["cycles"] > 5


def test_an_annotation_costs_neither_code_nor_memory(tmp_path: Path) -> None:
    """Annotations change neither the code nor the data of an image."""
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    without = read_executable(built(tmp_path / "a", LIST.replace("NOTE", "")).read_bytes(), "a")
    noted = read_executable(built(tmp_path / "b", LIST.replace("NOTE", "LOOP_BOUND(8);")).read_bytes(), "b")
    for image in (without, noted):
        image.sections = [s for s in image.sections if s.is_code or s.is_ram or s.is_psv]
    assert [(s.name, s.address, s.data) for s in without.sections] == [
        (s.name, s.address, s.data) for s in noted.sections
    ]


def test_the_longest_masked_time_is_reported(tmp_path, capsys) -> None:
    """The longest masked time is reported: REPEAT #29, NOP takes 1 + 30 cycles at level 5.

    The instructions that write SR are added.
    """
    row = report(capsys, built(tmp_path, MASKS))
    cycles, place = row["masked"]["5"]
    assert 31 < cycles <= 40
    assert "program.c:3" in place
    assert "6" not in row["masked"]


def test_the_masked_time_is_unknown_if_a_loop_has_no_bound(tmp_path, capsys) -> None:
    """No number is shown for a level that a loop without a bound may mask for longer."""
    image = built(tmp_path, MASKS.replace('__asm__ volatile("repeat', 'while (PORTD) {} __asm__ volatile("repeat'))
    assert report(capsys, image)["masked"]["5"][0] is None
    main(["bounds", str(image)])
    assert re.search(r"^call +main .*  \?    -  main$", capsys.readouterr().out, re.M)


def test_a_limit_that_can_be_exceeded_fails(tmp_path, capsys) -> None:
    """A bound above its limit fails, for cycles (`--limit`) and for stack bytes (`--stack-limit`)."""
    image = built(tmp_path, COUNTDOWN_CONDITION)
    cycles = report(capsys, image)["cycles"]
    assert main(["bounds", str(image), "--limit", f"main={cycles}"]) == 0
    assert main(["bounds", str(image), "--limit", f"main={cycles - 1}"]) == 1
    assert f"main: {cycles:,} cycles, the limit is {cycles - 1}" in capsys.readouterr().out
    assert main(["bounds", str(image), "--stack-limit", "main=2"]) == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--let", "n"], "--let n: expected NAME=NUMBER"),
        (["--function", "nothing"], "no function is called nothing"),
        (["--limit", "nothing=3"], "no analysed function is called nothing"),
    ],
)
def test_bad_arguments_are_refused(tmp_path, capsys, options: list[str], message: str) -> None:
    """Bad arguments end with exit status 2 and a message that names the argument."""
    assert main(["bounds", str(built(tmp_path, COUNTDOWN_CONDITION)), *options]) == 2
    assert message in capsys.readouterr().err


ROOM = """
volatile unsigned u, o; volatile unsigned long long a = 12345678901234, b = 77;
__attribute__((noinline)) void fill(unsigned char *q, unsigned n)
{
    for (unsigned k = 0; k < 8; k++) q[k % n] = k;
    a /= b;
}
__attribute__((noinline)) void sized(void)
{
    unsigned n = (u & 7) + 1;
    unsigned char q[n];
    fill(q, n);
    o = q[n / 2];
}
__attribute__((noinline)) void any(void)
{
    unsigned n = u;
    unsigned char *q = __builtin_alloca(n);
    fill(q, n);
    o = *q;
}
__attribute__((noinline)) void some(void)
{
    unsigned char one[1], *q = one;
    unsigned n = 1;
    if (u & 1) q = __builtin_alloca(n = 40);
    fill(q, n);
    o = *q;
}
int main(void) { u = 9; CALLED(); return 0; }
"""


@pytest.mark.parametrize("called", ["sized", "any", "some"])
@pytest.mark.parametrize("level", ["-O0", "-O2"])
def test_room_of_unknown_length_is_no_other_stack(level: str, called: str, tmp_path: Path) -> None:
    """A function with `alloca` of unknown length has no stack bound, instead of one below the measurement."""
    (tmp_path / "a.c").write_text(ROOM.replace("CALLED", called))
    assert build([tmp_path / "a.c"], tmp_path / "a.elf", level, "-w", "-fno-lto").status == 0
    seen = measure(tmp_path / "a.elf")
    assert not isinstance(seen, str), seen
    executable = read_executable((tmp_path / "a.elf").read_bytes(), "a.elf")
    program = Program(executable)
    address = program.address("_main")
    assert address is not None
    bound = BoundAnalysis(program).bound("_main", address, "call", 0)
    assert bound.cycles is None or bound.cycles >= seen["_main"].cycles
    assert not bound.stack_is_known or bound.bytes >= seen["_main"].stack
    assert (
        any("allocates an unknown number of bytes" in why for why in bound.unbounded.values())
        or bound.cycles is not None
    )


@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_annotations_are_no_variables_of_the_program(tmp_path: Path, level: str) -> None:
    """DWARF describes no annotation as a variable: the section of annotations is not in data memory."""
    image = load_image(str(built(tmp_path, LIST.replace("NOTE", "LOOP_BOUND(8);"), level)))
    assert set(image.lines.files) <= {symbol.address for symbol in image.symbols.all if symbol.space == "data"}
    head = image.symbols.find("_head")
    assert head is not None
    assert image.lines.files[head.address].endswith("program.c")
