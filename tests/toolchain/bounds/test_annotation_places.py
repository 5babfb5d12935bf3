"""An annotation applies to one line, function and file, and to one call or loop."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.compiler.fuzz_bounds import examine, measure
from tests.toolchain.bounds.test_bounds import built, report
from tests.toolchain.c_programs import build
from toolchain.cli import main

SLOW = '__attribute__((noinline)) {} void repair(void) {{ __asm__ volatile("repeat #{}\\n nop"); }}\n'
TWICE = """
#include <bounds.h>
volatile int wanted = 2;
{slow}
__attribute__((noinline)) void work(void)
{{
    for (int i = 0; i < 10; i++) {{
        if (wanted == i) {{ {annotation} repair();
        }}
        repair();
    }}
}}
int main(void) {{ work(); return 0; }}
"""
PART = """
#include <bounds.h>
struct item {{ struct item *next; }} items_{name}[{count}], *volatile head_{name};
__attribute__((noinline)) static int length(struct item *p)
{{
    int c = 0;
    {annotation}
    for (; p; p = p->next) c++;
    return c;
}}
int walk_{name}(void)
{{
    for (int i = 1; i < {count}; i++) items_{name}[i - 1].next = &items_{name}[i];
    head_{name} = items_{name};
    return length(head_{name});
}}
"""
WAYS_BACK = """
#include <bounds.h>
struct item {{ struct item *next; int key, mark; }} items[8], *volatile head;
volatile int odd;
__attribute__((noinline)) struct item *after(struct item *p) {{ return p->next; }}
__attribute__((noinline)) int visit(struct item *p, int key)
{{
    {annotation}
    while ((p = after(p)) != 0) {{
        if (p->key != key)
            continue;
        if (!(p->mark & 4) ||
            p->mark == odd)
            return 1;
    }}
    return 0;
}}
int main(void)
{{
    for (int i = 1; i < 8; i++) items[i - 1].next = &items[i], items[i].mark = 4;
    head = items;
    return visit(head, 0);
}}
"""
UNROLLED = """
#include <bounds.h>
struct item { struct item *next; int key[2]; } items[8], *volatile head;
volatile int sum;
__attribute__((noinline)) void visit(struct item *p)
{
    for (; p; p = p->next) {
        sum++;
        LOOP_BOUND(2);
        for (int i = 0; i < 2; i++)
            sum += p->key[i];
        sum--;
    }
}
int main(void) { head = items; visit(head); return 0; }
"""


def cycles(image: Path) -> int:
    seen = measure(image)
    assert isinstance(seen, dict)
    return seen["_main"].cycles


@pytest.mark.parametrize("level", ["-Os", "-O2"])
def test_the_annotation_of_a_call_does_not_apply_to_the_next_line(tmp_path: Path, capsys, level: str) -> None:
    """The annotation of a call does not apply to the call of repair() in the next line."""
    text = TWICE.format(slow=SLOW.format("", 999), annotation="CALL_SHARE(repair, work, 1);")
    image = built(tmp_path, text, level)
    assert cycles(image) <= report(capsys, image)["cycles"] <= 1.1 * cycles(image)
    image = built(tmp_path, text.replace("CALL_SHARE(repair, work, 1)", "CALL_IF(repair, 0)"), level)
    assert 10_000 < report(capsys, image)["cycles"] < cycles(image)  # ten calls instead of eleven


@pytest.mark.parametrize(
    ("annotation", "message"),
    [
        ("CALL_SHARE(work, work, 1);", "program.c:9: line 9 contains no call of work"),
        ("CALL_IF(other, 0);", "program.c:9: line 9 contains no call of other"),
        ("CALL_SHARE(repair, work, );", "program.c:9: expected 3 arguments, got 'repair work'"),
    ],
)
def test_an_annotation_without_its_call_is_refused(tmp_path: Path, capsys, annotation: str, message: str) -> None:
    """An annotation without a call to apply to is refused with its file and line."""
    image = built(tmp_path, TWICE.format(slow=SLOW.format("", 9), annotation=annotation))
    assert main(["bounds", str(image)]) == 2
    assert message in capsys.readouterr().err


def test_an_annotation_after_all_code_is_refused(tmp_path: Path, capsys) -> None:
    """An annotation after the last code is refused, because it applies to nothing."""
    text = "#include <bounds.h>\nvolatile int a;\nint main(void)\n{\n    a = 2;\n    return 0;\n    LOOP_BOUND(3);\n}\n"
    assert main(["bounds", str(built(tmp_path, text))]) == 2
    assert "program.c:7: main has no code after this annotation" in capsys.readouterr().err


@pytest.mark.parametrize("lto", [[], ["-fno-lto"]])
def test_static_functions_with_equal_names_are_distinguished(tmp_path: Path, capsys, lto: list[str]) -> None:
    """Annotations distinguish static functions with equal names in files with equal names and lines.

    One list has 40 items, the other 5.
    """
    sources = []
    for name, count, annotation in (("one", 40, "LOOP_BOUND(40);"), ("two", 5, "LOOP_BOUND(5);")):
        (tmp_path / name / "part").mkdir(parents=True)
        sources.append(tmp_path / name / "part" / "list.c")
        sources[-1].write_text(PART.format(name=name, count=count, annotation=annotation))
    (tmp_path / "main.c").write_text(
        "int walk_one(void), walk_two(void); int main(void) { return walk_one() + walk_two(); }"
    )
    made = build([tmp_path / "main.c", *sources], tmp_path / "a.elf", "-Os", "-g", *lto)
    assert made.status == 0, made.messages
    seen = cycles(tmp_path / "a.elf")
    assert seen <= report(capsys, tmp_path / "a.elf")["cycles"] <= 1.1 * seen
    for source, most in zip(sources, (40, 5), strict=True):
        text = source.read_text().replace(f"LOOP_BOUND({most});", "")
        source.write_text(text.replace("int walk", f"LOOPS_OF(length, {most});\nint walk"))
    made = build([tmp_path / "main.c", *sources], tmp_path / "a.elf", "-Os", "-g", *lto)
    assert made.status == 0, made.messages
    assert cycles(tmp_path / "a.elf") <= report(capsys, tmp_path / "a.elf")["cycles"] <= 1.1 * seen
    sources[0].write_text(sources[0].read_text().replace("LOOPS_OF(length", "LOOPS_OF(list.c/length"))
    assert build([tmp_path / "main.c", *sources], tmp_path / "a.elf", "-Os", "-g", *lto).status == 0
    assert main(["bounds", str(tmp_path / "a.elf")]) == 2
    assert "list.c/length is ambiguous: write " in capsys.readouterr().err
    assert main(["bounds", str(tmp_path / "a.elf"), "--function", "length"]) == 2


def test_a_static_function_of_another_file_is_named_with_it(tmp_path: Path, capsys) -> None:
    """A static function of another file is named with its file: `list.c/length`, with or without blanks.

    The plain name `length` is not visible in main.c.
    """
    (tmp_path / "list.c").write_text(PART.format(name="one", count=8, annotation=""))
    for name in ("list.c/length", "list.c / length", "length"):
        (tmp_path / "main.c").write_text(
            f"#include <bounds.h>\nLOOPS_OF({name}, 8);\nint walk_one(void); int main(void) {{ return walk_one(); }}"
        )
        made = build([tmp_path / "main.c", tmp_path / "list.c"], tmp_path / "a.elf", "-Os", "-g")
        assert made.status == 0, made.messages
        if "/" in name:
            assert report(capsys, tmp_path / "a.elf")["cycles"] is not None
    assert main(["bounds", str(tmp_path / "a.elf")]) == 2
    assert "main.c:2: length is not visible in this file; candidates: " in capsys.readouterr().err


def test_several_back_edges_are_one_loop_only_with_an_annotation(tmp_path: Path, capsys) -> None:
    """Several back edges form one loop only with an annotation: `continue` could also lead to an inner loop's
    condition."""
    image = built(tmp_path, WAYS_BACK.format(annotation="LOOP_BOUND(8);"), "-Os")
    row = report(capsys, image)
    assert row["cycles"] is None
    assert any("several back edges" in why for why in row["open"].values())
    image = built(tmp_path, WAYS_BACK.format(annotation="LOOP_BOUND(8); ONE_LOOP();"), "-Os")
    assert cycles(image) <= report(capsys, image)["cycles"] <= 1.3 * cycles(image)


def test_the_annotation_of_an_unrolled_loop_does_not_apply_to_the_enclosing_loop(tmp_path: Path, capsys) -> None:
    """The annotation of an unrolled inner loop does not apply to the enclosing loop, although only its line remains."""
    row = report(capsys, built(tmp_path, UNROLLED, "-O2"))
    assert row["cycles"] is None
    assert "this loop has no known bound" in row["open"].values()


COUNTED_LIST = """
struct node { struct node *next; } *volatile head; volatile unsigned result;
int main(void) { unsigned n = 0; for (struct node *p = head; p && %s; p = p->next) n++; result = n; return 0; }
"""


def test_a_counter_that_decides_no_branch_does_not_prolong_the_analysis(tmp_path: Path, capsys) -> None:
    """A loop that only its data end has no known bound even if it counts; a counter in its condition bounds it."""
    row = report(capsys, built(tmp_path, COUNTED_LIST % "1", "-Os"))
    assert list(row["open"].values()) == ["this loop has no known bound"]
    row = report(capsys, built(tmp_path, COUNTED_LIST % "n != 1000", "-Os"))
    assert not row["open"]
    assert row["cycles"] > 4000


def test_a_loop_with_too_many_iterations_is_reported(tmp_path: Path, capsys) -> None:
    """A loop whose iteration count exceeds the limit of the analysis is reported."""
    text = "volatile unsigned n; int main(void) { for (unsigned i = 0; i < 6000; i++) n = i; return 0; }"
    row = report(capsys, built(tmp_path, text, "-Os"))
    assert row["cycles"] is None
    assert any("more than 5,000 iterations" in why for why in row["open"].values())


@pytest.mark.parametrize("seed", [4, 7, 10])
def test_programs_with_correct_annotations_of_every_kind_stay_within_their_bounds(tmp_path: Path, seed: int) -> None:
    """Programs with correct annotations of every kind stay within their bounds.

    Sample of tests/fuzz/compiler/fuzz_bounds.py with programs of tests/fuzz/programs/c_annotations.py.
    """
    outcome, _ = examine(seed, tmp_path)
    assert outcome == "bounded"
