"""Stack bounds of assembly, and the annotation file; expected bytes are counted by hand from isa.md §3.5 and §7.4."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.toolchain.c_programs import build
from toolchain.bounds.annotations.file import FileAnnotations, read_annotation_file
from toolchain.bounds.program import Program
from toolchain.bounds.report import Bound, BoundAnalysis
from toolchain.cli import main
from toolchain.elf.read import read_executable
from toolchain.elf.write import executable_bytes
from toolchain.errors import ToolError

FUNC = "\n .global {0}\n .type {0},@function\n{0}:\n{1}\n"
START = ".global __reset\n__reset: mov #__SP_init, w15\n rcall _main\n reset\n"


def func(name: str, *lines: str) -> str:
    return FUNC.format(name, "\n".join(" " + line for line in lines))


def bounds(image, text: str, *names: str, notes: str = "") -> list[Bound]:
    """Return the bounds of the named functions (default: main), each analysed as an entry."""
    program = Program(image(START + text).linked.image, file=read_annotation_file(notes, "notes"))
    analysis = BoundAnalysis(program)
    return [analysis.bound(name, program.calls.named(name), "call") for name in names or ("_main",)]


@pytest.mark.parametrize(
    ("lines", "bytes_used"),
    [
        (["return"], 0),
        (["push w8", "pop w8", "return"], 2),
        (["push.d w8", "push.d w10", "pop.d w10", "pop.d w8", "return"], 8),
        (["push 0x36", "pop 0x36", "return"], 2),
        (["lnk #10", "push w8", "pop w8", "ulnk", "return"], 14),
        (["add #6, w15", "sub #6, w15", "return"], 6),
        (["add w15, #8, w15", "sub w15, #8, w15", "return"], 8),
        (["inc2 w15, w15", "dec2 w15, w15", "return"], 2),
        (["repeat #4", "push w0", "repeat #4", "pop w0", "return"], 10),
        (["mov [w1++], [w15++]", "mov [--w15], [w2++]", "return"], 2),
        (["cp0 w0", "bra z, 1f", "push w8", "pop w8", "1: return"], 2),
        (["lnk #4", "mov w14, w15", "ulnk", "return"], 6),
        (["mov w0, [w15]", "mov [w15-2], w1", "return"], 0),
        (["do #3, 1f", "push w0", "1: pop w0", "return"], 2),
        (
            [
                "and w0, #1, w0",
                "bra w0",
                "bra 1f",
                "bra 2f",
                "1: push.d w0",
                "pop.d w0",
                "return",
                "2: push w0",
                "pop w0",
                "return",
            ],
            4,
        ),
    ],
)
def test_own_frame_of_a_function(image, lines, bytes_used):
    """The frame of a function includes pushes, LNK, arithmetic on W15, repeated pushes, skips and jump tables."""
    (found,) = bounds(image, func("_main", *lines))
    assert (found.bytes, found.unbounded_stack) == (bytes_used, {})


def test_a_call_costs_its_return_address_at_the_depth_of_the_call(image):
    """A call adds its return address at the present depth: CALL and RCALL push 4 bytes, a tail branch none (isa.md
    §7.4)."""
    text = (
        func("_main", "push w8", "rcall _a", "pop w8", "call _b", "return")
        + func("_a", "push.d w0", "pop.d w0", "bra _c")
        + func("_b", "lnk #20", "ulnk", "goto _a")
        + func("_c", "push w1", "rcall _leaf", "pop w1", "return")
        + func("_leaf", "return")
    )
    found = bounds(image, text, "_leaf", "_c", "_a", "_b", "_main")
    assert [bound.bytes for bound in found] == [0, 6, 6, 22, 26]
    assert found[-1].path == ["main", "b"]


THREE = (
    func("_main", "mov #handle(_callback), w0", "return")
    + func("_callback", "push w0", "pop w0", "return")
    + func("_blinker", "lnk #30", "ulnk", "return")
    + func("__T1Interrupt", "push.d w0", "pop.d w0", "retfie")
)


def test_a_thread_needs_its_stack_and_that_of_interrupts(image, tmp_path, capsys, monkeypatch):
    """The figure of a thread includes return address and interrupts; that of an interrupt, 4 bytes of entry."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.elf").write_bytes(executable_bytes(image(START + THREE).linked.image))
    assert main(["bounds", "x.elf", "--thread", "blinker", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    (blinker,), (timer,) = report["threads"], report["interrupts"]
    assert (timer["name"], timer["stack_bytes"]) == ("_T1Interrupt", 4 + 4)
    assert (blinker["name"], blinker["stack_bytes"]) == ("blinker", 4 + 32 + 8)
    assert report["stacks"]["blinker"] == blinker["stack_bytes"]
    assert main(["bounds", "x.elf", "--thread", "blinker", "--stack-limit", "blinker=44"]) == 0
    assert "  44 " in next(line for line in capsys.readouterr().out.splitlines() if line.startswith("thread"))
    assert main(["bounds", "x.elf", "--thread", "blinker", "--stack-limit", "blinker=43"]) == 1
    assert "blinker: 44 bytes of stack, the limit is 43" in capsys.readouterr().out


def test_a_stack_without_a_bound_fails_its_limit_with_the_reason(image, tmp_path, capsys, monkeypatch):
    """A stack that is not known is shown as ?, and its limit fails with place and reason, whatever the limit is."""
    monkeypatch.chdir(tmp_path)
    text = func("_main", "return") + func("_blinker", "mov w1, w2", "call w2", "return")
    (tmp_path / "x.elf").write_bytes(executable_bytes(image(START + text).linked.image))
    assert main(["bounds", "x.elf", "--thread", "blinker", "--stack-limit", "blinker=9999"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert next(line for line in lines if line.startswith("thread")).split()[2:4] == ["?", "?"]
    assert lines[-2:] == [
        "blinker: ? bytes of stack, the limit is 9999",
        "  _blinker+0x2: the targets of this call through a pointer are not known",
    ]


RECURSIVE = func("_main", "rcall _fib", "return") + func("_fib", "push.d w8", "rcall _fib", "pop.d w8", "return")
BOTH_WAYS = (
    func("_main", "rcall _f", "rcall _g", "return")
    + func("_f", "push w0", "btss w0, #0", "rcall _g", "pop w0", "return")
    + func("_g", "push.d w0", "btss w0, #1", "rcall _f", "pop.d w0", "return")
)
POINTER = (
    func("_main", "mov #handle(_big), w0", "mov 0x900, w1", "call w1", "return")
    + func("_big", "lnk #40", "ulnk", "return")
    + func("_small", "return")
)


def test_recursion_is_reported_and_can_be_bounded(image):
    """Recursion is reported and can be bounded: n activations have n frames and n return addresses.

    The last return address is that of the call which the bound excludes.
    """
    (free,) = bounds(image, RECURSIVE)
    assert "recursion" in free.unbounded_stack.values()
    endless, whole = bounds(image, RECURSIVE, "_fib", "_main", notes="recursion fib 5\n")
    assert (endless.bytes, endless.unbounded_stack) == (5 * 4 + 5 * 4, {})
    assert whole.bytes == 4 + 40
    symbol = ".global __stack_recursion_of_fib\n__stack_recursion_of_fib = 2\n mov #__stack_recursion_of_fib, w0\n"
    assert bounds(image, RECURSIVE + symbol, "_fib")[0].bytes == 16


def test_a_bounded_recursion_counts_from_each_of_its_callers(image):
    """The result of a function within a recursion is not reused for a call outside of it, where more activations fit.

    Deepest are five calls from main: g, f, g, f, g. The sixth is excluded, except for its return address.
    """
    (found,) = bounds(image, BOTH_WAYS, notes="recursion f 2\n")
    assert (found.bytes, found.unbounded_stack) == (6 * 4 + 3 * 4 + 2 * 2, {})


def test_pointer_calls_are_reported_and_can_be_annotated(image):
    """Calls by pointer are reported; `calls` lists their targets. `depth` replaces the analysis of a function."""
    (free,) = bounds(image, POINTER)
    assert "the targets of this call through a pointer are not known" in free.unbounded_stack.values()
    for notes in ("# comment\ncalls main: big, _small\n", "calls main: *\n"):
        (found,) = bounds(image, POINTER, notes=notes)
        assert (found.bytes, found.unbounded_stack) == (4 + 42, {})
    (stated,) = bounds(image, POINTER, notes="calls main: big\ndepth big 100\n")
    assert (stated.bytes, stated.unbounded_stack, stated.cycles) == (4 + 100, {}, None)


def test_unknown_stack_pointers_and_unbalanced_returns_are_reported(image):
    """An unknown W15 (a context switch), a return with bytes on the stack, and a loop that pushes leave no bound."""
    text = (
        func("_main", "mov w0, w15", "return")
        + func("_odd", "push w0", "return")
        + func("_calls_odd", "rcall _odd", "return")
        + func("_loop", "1: push w0", "bra 1b")
        + func("_one_path", "btss w0, #1", "push w8", "call _main", "return")
    )
    reasons = [
        " ".join(bound.unbounded_stack.values())
        for bound in bounds(image, text, "_main", "_odd", "_calls_odd", "_loop", "_one_path")
    ]
    parts = ("unknown address", "another stack depth", "another stack depth", "stack grows", "unknown address")
    for reason, part in zip(reasons, parts, strict=True):
        assert part in reason


def test_assembly_that_shares_w8_to_w14_is_executed_with_their_changes(image):
    """A routine that changes W9 without saving it changes W9 of its callers, which here decides whether they use stack.

    `next` moves the pointer W9; only the second byte of the text leads to the deep path.
    """
    text = (
        func("_main", "mov #tbloffset(text), w9", "rcall next", "rcall next", "cp w1, #2", "bra nz, 1f", "lnk #60",
             "ulnk", "1: return")
        + "next: tblrdl.b [w9++], w1\n ze w1, w1\n return\ntext: .pword 0x000201\n"
    )  # fmt: skip
    (found,) = bounds(image, text)
    assert (found.bytes, found.unbounded_stack) == (62, {})


@pytest.mark.parametrize(
    ("lines", "known"),
    [
        (["mov w15, w8", "push w0", "rcall _leaf", "mov w8, w15", "return"], True),
        (["lnk #0", "mov w15, w1", "add w0, w1, w1", "mov w1, w15", "ulnk", "return"], False),
        (["lnk #0", "mov w15, w1", "mov w0, w15", "ulnk", "return"], False),
        (["mov w15, w1", "push w1", "push w0", "pop w0", "pop w2", "mov w2, w15", "return"], True),
        (["mov w15, w8", "push.d w0", "push.d w2", "mov w8, w15", "return"], True),
    ],
)
def test_only_an_unchanged_copy_of_the_stack_pointer_is_known(image, lines, known):
    """Only an unchanged copy of the stack pointer restores the depth; alloca and arrays of computed length do not."""
    (found,) = bounds(image, func("_main", *lines) + func("_leaf", "return"))
    assert (not found.unbounded_stack) == known


@pytest.mark.parametrize(
    ("text", "message"), [("frob x 1\n", "notes:1"), ("\ndepth f x\n", "notes:2"), ("calls\n", "expected")]
)
def test_annotation_mistakes_name_file_and_line(text, message):
    """An invalid annotation is refused with file and line."""
    with pytest.raises(ToolError, match=message):
        read_annotation_file(text, "notes")


@pytest.mark.parametrize("file", [{"threads": ["missing"]}, {"depth": {"missing": 3}}, {"recursion": {"missing": 3}}])
def test_annotations_for_unknown_functions_are_refused(image, file):
    """An annotation for an unknown function is refused: a misspelt name is an error."""
    with pytest.raises(ToolError, match="no function is called missing"):
        Program(image(".global __reset\n__reset: call w0\n return\n").linked.image, file=FileAnnotations(**file))


HAND_OVER = """
#include <bounds.h>
COMES_BACK(hand_over, 0);
int other;
extern void deep(void);
int main(void) { deep(); return other; }
"""


def test_the_stack_behind_a_call_counts_at_the_priority_of_its_return(tmp_path: Path) -> None:
    """A caller of priority 1 is continued at priority 0, where every interrupt adds its stack to the caller's frame."""
    deep = func("_deep", "bset SR, #5", "lnk #20", "rcall _hand_over", "ulnk", "return")
    (tmp_path / "a.c").write_text(HAND_OVER)
    (tmp_path / "b.s").write_text(" .text" + deep + func("_hand_over", "mov _other, w15", "return"))
    built = build([tmp_path / "a.c", tmp_path / "b.s"], tmp_path / "a.elf", "-Os", "-g", "-fno-lto")
    assert built.status == 0, built.messages
    program = Program(read_executable((tmp_path / "a.elf").read_bytes(), "a.elf"))
    bound = BoundAnalysis(program).bound("_main", program.calls.named("main"), "call")
    assert bound.stack == {0: 4 + 2 + 20, 1: 4 + 2 + 20 + 4}
