"""Annotations above a function that quote a line of it (BOUNDS_AT), in the compiler and in `toolchain bounds`."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.toolchain.bounds.test_bounds import built, report
from tests.toolchain.c_programs import build
from toolchain.frontend.annotated_lines import definitions

TWO_LISTS = """#include <bounds.h>
struct item { struct item *next; } items[8], *volatile head;
volatile int total;
typedef void (*action)(void);
action volatile chosen;
void one(void) { total++; }
void two(void) { total += 2; }
BOUNDS_AT("for (p = head", loop n);
BOUNDS_AT("while (--q > \\"a\\")",
          loop 2 * n + min(1, m));
BOUNDS_AT("chosen()", calls (one, two));
static int count(void)
{
    const char *q = (const char *)head;
    int c = 0;
    for (const struct item *p = head; p; p = p->next) { c++; }
    while (--q > "a") { c--; }
    chosen();
    return c;
}
int main(void)
{
    chosen = total ? one : two;
    head = items;
    return count();
}
"""


def test_quoted_lines_bind_like_annotations_in_front_of_them(tmp_path: Path, capsys) -> None:
    """The quoted annotations give the same bound as LOOP_BOUND and CALL_TARGETS in front of the lines."""
    quoted = TWO_LISTS.replace("for (p = head", "for (const struct item *p")
    inside = re.sub(r"BOUNDS_AT\([^;]*\);\n", "", quoted)
    inside = inside.replace("    for (const", "    LOOP_BOUND(n);\n    for (const")
    inside = inside.replace("    while (--q", "    LOOP_BOUND(2 * n + min(1, m));\n    while (--q")
    inside = inside.replace("    chosen();", "    CALL_TARGETS(one, two);\n    chosen();")
    cycles = []
    for text in (quoted, inside):
        row = report(capsys, built(tmp_path, text), "--let", "n=5", "--let", "m=1")
        assert not row["open"]
        cycles.append(row["cycles"])
    assert cycles[0] == cycles[1]
    assert report(capsys, built(tmp_path, quoted), "--let", "n=6", "--let", "m=1")["cycles"] > cycles[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("for (no such", "a.c:8: error: no line of the next function contain"),
        ("head", "a.c:8: error: 2 lines of the next function contain"),
    ],
)
def test_a_text_without_exactly_one_line_is_refused(tmp_path: Path, text: str, message: str) -> None:
    """The compiler refuses a quoted text that no line, or several lines, of the next function contain."""
    (tmp_path / "a.c").write_text(TWO_LISTS.replace("for (p = head", text))
    refused = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-g")
    assert refused.status == 2
    assert message in refused.messages


def test_the_line_of_an_annotation_is_that_of_its_end(tmp_path: Path) -> None:
    """An annotation of two lines is defined for its second line, where clang counts it."""
    (tmp_path / "a.c").write_text(TWO_LISTS.replace("for (p = head", "for (const struct item *p"))
    assert definitions(tmp_path / "a.c") == ["-D_BOUNDS_AT_8=16", "-D_BOUNDS_AT_10=17", "-D_BOUNDS_AT_11=18"]
    assert definitions(tmp_path / "missing.c") == []


def test_an_unknown_kind_of_annotation_is_refused(tmp_path: Path) -> None:
    """The linker refuses a misspelt kind within BOUNDS_AT with the quoted line."""
    text = TWO_LISTS.replace("for (p = head", "for (const struct item *p").replace("loop n", "lop n")
    (tmp_path / "a.c").write_text(text)
    refused = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-g", "-w")
    assert refused.status == 2
    assert "a.c:16: expected one of loop, total" in refused.messages
