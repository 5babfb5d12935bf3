"""Bounds with shared iterations and calls, with constants in the PSV window, and with longjmp."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.compiler.fuzz_bounds import measure
from tests.toolchain.bounds.test_bounds import built, report

SHARED = """
#include <bounds.h>
struct item { struct item *next; } items[9], *volatile first, *volatile second;
__attribute__((noinline)) void visit(void) { __asm__ volatile("repeat #99\\n nop"); }
__attribute__((noinline)) struct item *down(struct item *p, int most)
{
    LOOP_BOUND(8); NOTE
    while (p->next && most--) { visit(); p = p->next; }
    return p;
}
__attribute__((noinline)) void walk(void)
{
    down(down(first, 3), 9);
}
int main(void)
{
    for (int i = 0; i < 8; i++) items[i].next = &items[i + 1];
    first = items;
    walk();
    walk();
    return 0;
}
"""
RARE = """
#include <bounds.h>
volatile int wanted = 2;
__attribute__((noinline)) void repair(void) { __asm__ volatile("repeat #999\\n nop"); }
__attribute__((noinline)) void work(void)
{
    for (int i = 0; i < 10; i++) {
        NOTE
        if (wanted == i) repair();
    }
}
int main(void) { work(); return 0; }
"""
CONSTANTS = """
static const int counts[4] __attribute__((space(auto_psv))) = {0x0102, 0x0101, 0x0203, 0x0180};
volatile unsigned which = 2;
__attribute__((noinline)) int main(void)
{
    int n = counts[which & 3], sum = 0;
    for (int i = 0; i < n; i++) { sum += i; __asm__ volatile("" : "+r"(sum)); }
    return sum;
}
"""
LINKS = """
#include <bounds.h>
LINKS_IN_RAM();
struct item { struct item *next; int key; } items[12], *head;
volatile const int constant = 5; /* there is something behind the window */
__attribute__((noinline)) struct item **link_of(int key)
{
    struct item **link = &head;
    LOOP_BOUND(11);
    while (*link && (*link)->key != key) link = &(*link)->next;
    return link;
}
int main(void)
{
    for (int i = 0; i < 11; i++) { items[i].key = i; items[i].next = i < 10 ? &items[i + 1] : 0; }
    head = items;
    return *link_of(constant + 100) == 0;
}
"""
INDEXED = """
#include <bounds.h>
LINKS_IN_RAM();
static const char letters[80] __attribute__((space(auto_psv))) = {1, 2, 3, 4, 5, 6, 7};
unsigned places[20];
volatile int found;
__attribute__((noinline)) int sum(const unsigned *place)
{
    int s = 0;
    for (int i = 0; i < 20; i++) s += letters[place[i]];
    return s;
}
int main(void) { for (int i = 0; i < 20; i++) places[i] = i; return sum(places); }
"""
LONG_JUMP = """
#include <setjmp.h>
static jmp_buf back;
volatile int never;
__attribute__((noinline)) void leave(void) { longjmp(back, 1); }
int main(void) { if (setjmp(back) == 0) leave(); return never; }
"""


def measured(image: Path) -> int:
    seen = measure(image)
    assert isinstance(seen, dict)
    return seen["_main"].cycles


def test_rounds_of_two_calls_are_shared_in_the_function_that_makes_them(tmp_path: Path, capsys) -> None:
    """Iterations annotated as shared by two calls are counted once in their caller.

    Each of two calls of walk() has eight iterations, three of them in the first call of down(). Without the
    annotation the second call of down() may have eight.
    """
    image = built(tmp_path, SHARED.replace("NOTE", "LOOP_SHARE(walk, 8);"))
    assert measured(image) <= report(capsys, image)["cycles"] <= 1.1 * measured(image)
    apart = built(tmp_path, SHARED.replace("NOTE", ""))
    assert report(capsys, apart)["cycles"] > 1.3 * measured(apart)


def test_a_call_is_made_only_so_often(tmp_path: Path, capsys) -> None:
    """An annotated call that is made in one of ten iterations, or never, is counted that often."""
    image = built(tmp_path, RARE.replace("NOTE", "CALL_SHARE(repair, work, 1);"))
    assert measured(image) <= report(capsys, image)["cycles"] <= 1.1 * measured(image)
    image = built(tmp_path, RARE.replace("NOTE", "CALL_IF(repair, x);"))
    assert report(capsys, image, "--let", "x=0")["cycles"] < 1000 < report(capsys, image, "--let", "x=1")["cycles"]


@pytest.mark.parametrize("level", ["-O0", "-Os", "-O2"])
def test_constants_behind_the_window_have_both_their_bytes(tmp_path: Path, capsys, level: str) -> None:
    """The analysis reads both bytes of a constant in the PSV window, here the iteration count of a loop."""
    image = built(tmp_path, CONSTANTS, level)
    assert measured(image) <= report(capsys, image)["cycles"] <= 1.1 * measured(image)


def test_an_address_that_is_moved_still_leads_to_ram(tmp_path: Path, capsys) -> None:
    """Following a link whose address was moved still costs no PSV cycle: the object is in RAM."""
    image = built(tmp_path, LINKS)
    assert measured(image) <= report(capsys, image)["cycles"] <= 1.03 * measured(image)


@pytest.mark.parametrize("level", ["-O0", "-Os", "-O2"])
def test_an_index_that_is_loaded_may_lead_into_the_window(tmp_path: Path, capsys, level: str) -> None:
    """A loaded index may lead into the PSV window.

    The index is no pointer, although its file contains only pointers to RAM.
    """
    image = built(tmp_path, INDEXED, level)
    assert measured(image) <= report(capsys, image)["cycles"]


def test_a_long_jump_leaves_no_bound(tmp_path: Path, capsys) -> None:
    """A function with longjmp has no bound, and the report names longjmp as the reason."""
    row = report(capsys, built(tmp_path, LONG_JUMP))
    assert row["cycles"] is None
    assert any("longjmp" in reason for reason in row["open"].values())
