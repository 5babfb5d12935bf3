"""Worst-case stack from the call graph; the expected bytes are counted by hand from isa.md §3.5 and §7.4."""

import json

import pytest

from toolchain.cli import main
from toolchain.elf.write import executable_bytes
from toolchain.errors import ToolError
from toolchain.stack.analyse import Analysis
from toolchain.stack.annotations import Annotations, add_symbols, read_annotations

FUNC = "\n .global {0}\n .type {0},@function\n{0}:\n{1}\n"


def func(name: str, *lines: str) -> str:
    return FUNC.format(name, "\n".join(" " + line for line in lines))


def analyse(image, text: str, notes: str = "") -> dict:
    out = image(".global __reset\n__reset: mov #__SP_init, w15\n rcall _main\n return\n" + text)
    annotations = read_annotations(notes, "notes")
    add_symbols(annotations, out.linked.image.symbols)
    return {u.name: u for u in Analysis(out.linked.image, annotations).report().functions}


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
        (["btss w0, #1", "push w8", "nop", "return"], 2),
        (["lnk #4", "mov w14, w15", "ulnk", "return"], 6),
        (["mov w0, [w15]", "mov [w15-2], w1", "return"], 0),
        (["do #3, 1f", "push w0", "1: pop w0", "return"], 2),
        (["bra w0", "bra 1f", "bra 2f", "1: push.d w0", "pop.d w0", "return", "2: push w0", "pop w0", "return"], 4),
    ],
)
def test_own_frame_of_a_function(image, lines, bytes_used):
    """The frame of a function includes pushes, LNK, arithmetic on W15, repeated pushes, skips and jump tables."""
    assert analyse(image, func("_main", *lines))["_main"].frame == bytes_used


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
    found = analyse(image, text)
    assert {n: found[n].total for n in ("_leaf", "_c", "_a", "_b", "_main")} == {
        "_leaf": 0,
        "_c": 6,
        "_a": 6,
        "_b": 22,
        "_main": 26,
    }
    assert found["_main"].path == ["_main", "_b"]
    assert not found["_main"].unknown


def test_interrupts_threads_and_pointer_only_functions_are_entries(image, tmp_path, capsys, monkeypatch):
    """Interrupts, threads and functions called by pointer only are entries.

    An exception pushes 4 bytes (isa.md §7.4); --thread names an additional entry.
    """
    monkeypatch.chdir(tmp_path)
    text = (
        ".global __reset\n__reset: mov #__SP_init, w15\n rcall _main\n reset\n"
        + func("_main", "mov #handle(_callback), w0", "return")
        + func("_callback", "push w0", "pop w0", "return")
        + func("_blinker", "lnk #30", "ulnk", "return")
        + func("__T1Interrupt", "push.d w0", "pop.d w0", "retfie")
    )
    (tmp_path / "x.elf").write_bytes(executable_bytes(image(text).linked.image))
    assert main(["stack", "x.elf", "--thread", "blinker", "--json"]) == 0
    entries = {(e["kind"], e["name"]): e["total"] for e in json.loads(capsys.readouterr().out)["entries"]}
    assert entries[("interrupt", "__T1Interrupt")] == 8
    assert entries[("thread", "_blinker")] == 32
    assert entries[("pointer", "_callback")] == 2
    assert main(["stack", "x.elf", "--limit", "blinker=32"]) == 0
    assert main(["stack", "x.elf", "--limit", "blinker=31"]) == 1
    assert main(["stack", "x.elf", "--limit", "missing=3"]) == 2
    assert main(["stack", "x.elf", "--functions"]) == 0
    assert "_blinker" in capsys.readouterr().out


RECURSIVE = func("_main", "rcall _fib", "return") + func("_fib", "push.d w8", "rcall _fib", "pop.d w8", "return")
POINTER = (
    func("_main", "mov #handle(_big), w0", "call w0", "return")
    + func("_big", "lnk #40", "ulnk", "return")
    + func("_small", "return")
)


def test_recursion_is_named_and_can_be_bounded(image):
    """Recursion is reported and can be bounded: n activations have n frames and n - 1 return addresses."""
    free = analyse(image, RECURSIVE)
    assert any("recursion to _fib" in note for note in free["_main"].unknown)
    bounded = analyse(image, RECURSIVE, "recursion fib 5\n")
    assert (bounded["_fib"].total, bounded["_fib"].unknown) == (5 * 4 + 4 * 4, [])
    assert bounded["_main"].total == 4 + 36
    by_symbol = analyse(
        image,
        RECURSIVE
        + ".global __stack_recursion_of_fib\n__stack_recursion_of_fib = 2\n mov #__stack_recursion_of_fib, w0\n",
    )
    assert by_symbol["_fib"].total == 12


def test_mutual_recursion_is_named_once_per_call(image):
    """Mutual recursion is reported once per call, and the analysis ends."""
    text = (
        func("_main", "rcall _a", "return")
        + func("_a", "push w0", "rcall _b", "pop w0", "return")
        + func("_b", "rcall _a", "return")
    )
    found = analyse(image, text)
    assert any("recursion to _a" in note for note in found["_main"].unknown)
    assert found["_main"].total >= 10


def test_pointer_calls_are_reported_and_can_be_annotated(image):
    """Calls by pointer are reported.

    In the annotation file `calls` lists their targets, `depth` replaces an analysis.
    """
    free = analyse(image, POINTER)
    assert any("call through a pointer" in note for note in free["_main"].unknown)
    usage = analyse(image, POINTER, "# comment\ncalls main: big, _small\n")
    assert (usage["_main"].total, usage["_main"].unknown) == (4 + 42, [])
    assert analyse(image, POINTER, "depth main 100")["_main"].total == 100
    anything = analyse(image, POINTER, "calls main: *\n")
    assert (anything["_main"].total, anything["_main"].unknown) == (4 + 42, [])


def test_unknown_stack_pointers_and_unbalanced_returns_are_named(image):
    """Unknown stack pointers (a context switch) and unbalanced code (a loop that pushes) are reported."""
    text = (
        func("_main", "mov w0, w15", "return")
        + func("_odd", "push w0", "return")
        + func("_loop", "1: push w0", "bra 1b")
    )
    found = analyse(image, text)
    assert "W15 is set to an unknown value" in found["_main"].unknown[0]
    assert "returns at" in found["_odd"].unknown[0]
    assert "grows in a loop" in found["_loop"].unknown[0]


def test_a_handler_that_switches_stacks_reports_bytes_on_the_interrupted_one(image):
    """A handler that switches stacks is charged 4 bytes by hardware and 4 pushed bytes on the interrupted stack.

    The rest is on the handler's own stack.
    """
    text = func(
        "__T1Interrupt",
        *["push.d w0", "mov w15, w1", "mov #0x1000, w0", "cpslt w15, w0", "mov #0x900, w15", "push w1", "push.d w2"],
        *["rcall _deep", "pop.d w2", "pop w0", "mov w0, w15", "pop.d w0", "retfie"],
    ) + func("_deep", "lnk #50", "ulnk", "return")
    out = image(".global __reset\n__reset: reset\n" + text)
    report = Analysis(out.linked.image, Annotations()).report()
    entry = next(e for e in report.entries if e.usage.name == "__T1Interrupt")
    assert (entry.before_switch, entry.usage.unknown) == (8, [])
    assert entry.total == 4 + 4 + 2 + 4 + 4 + 52


def test_a_saved_stack_pointer_restores_the_depth(image):
    """A saved stack pointer restores the known depth after a variable-length array (abi-elf.md §2.4).

    The length of the array itself is unknown.
    """
    lines = ["mov w15, w8", "push.d w0", "push.d w2", "mov w8, w15", "return"]
    found = analyse(image, func("_main", *lines))["_main"]
    assert (found.frame, found.unknown) == (8, [])


@pytest.mark.parametrize(
    ("lines", "known"),
    [
        (["mov w15, w8", "push w0", "rcall _leaf", "mov w8, w15", "return"], True),
        (["mov w15, w1", "push w0", "rcall _leaf", "mov w1, w15", "return"], False),
        (["lnk #0", "mov w15, w1", "add w0, w1, w1", "mov w1, w15", "ulnk", "return"], False),
        (["lnk #0", "mov w15, w1", "mov [w1++], w2", "mov w1, w15", "ulnk", "return"], False),
        (["lnk #0", "mov w15, w1", "mov w0, w15", "ulnk", "return"], False),
        (["mov w15, w1", "push w1", "push w0", "pop w0", "pop w2", "mov w2, w15", "return"], True),
        (["lnk #0", "mov w15, w1", "push w1", "pop w2", "push w0", "pop w3", "mov w3, w15", "ulnk", "return"], False),
    ],
)
def test_only_an_unchanged_copy_of_the_stack_pointer_is_known(image, lines, known):
    """Only an unchanged copy of the stack pointer restores the depth.

    alloca and arrays of computed length restore other values, and callees overwrite W0 to W7.
    """
    found = analyse(image, func("_main", *lines) + func("_leaf", "return"))
    assert any("unknown value" in note for note in found["_main"].unknown) != known


@pytest.mark.parametrize(
    ("text", "message"), [("frob x 1\n", "notes:1"), ("\ndepth f x\n", "notes:2"), ("calls\n", "expected")]
)
def test_annotation_mistakes_name_file_and_line(text, message):
    """An invalid annotation is refused with file and line."""
    with pytest.raises(ToolError, match=message):
        read_annotations(text, "notes")


def test_annotations_for_unknown_functions_are_refused(image):
    """An annotation for an unknown function is refused: a misspelt name is an error."""
    with pytest.raises(ToolError, match="no function is called missing"):
        Analysis(
            image(".global __reset\n__reset: call w0\n return\n").linked.image, Annotations(threads=["missing"])
        ).report()
