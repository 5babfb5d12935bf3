"""Whole programs: constructors, polling loops, library functions introduced by the optimiser."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

LEVELS = ["-O0", "-O1", "-Os", "-O2"]
ALONE = ["", "-fno-lto"]

CONSTRUCTORS = """
int value = 1;
__attribute__((constructor)) static void second(void) { value += 5; }
__attribute__((user_init)) void third(void) { value *= 2; }
__attribute__((constructor(101))) void first(void) { value += 10; }
int main(void) { return value; }
"""


@pytest.mark.parametrize("alone", ALONE)
@pytest.mark.parametrize("level", LEVELS)
def test_constructors_run_before_main_in_order_of_priority(level: str, alone: str, tmp_path: Path) -> None:
    """Constructors run before main in order of priority: GCC's attribute and XC16's `user_init` (abi-elf.md §1.4)."""
    assert status(CONSTRUCTORS, tmp_path, level, *alone.split()) == 32


IDIOMS = """
#include <string.h>
#include <stdio.h>
#include <stdlib.h>
#include <math.h>
static const unsigned wide[] = {3, 4, 0};
static const long longs[] = {3, 4, 5, 0};
unsigned words(const unsigned *a) { unsigned i = 0; while (a[i]) i++; return i; }
unsigned bytes(const char *a) { unsigned i = 0; while (a[i]) i++; return i; }
unsigned long_items(const long *a) { unsigned i = 0; while (a[i]) i++; return i; }
int same(const char *a, const char *b, unsigned n) { return !memcmp(a, b, n); }
int equal_loop(const char *a, const char *b, int n) {
  for (int i = 0; i < n; i++) if (a[i] != b[i]) return 0;
  return 1;
}
char *copy(char *d, const char *s) { while ((*d++ = *s++)) ; return d; }
char *append(char *d, const char *s) { strcpy(d, s); return d + strlen(s); }
int formatted(char *d, const char *s) { return sprintf(d, "%s", s); }
float power(float x) { return powf(2.0f, x); }
float scaled(float x, int n) { return x * powf(2.0f, n); }
void fill(unsigned *d, unsigned v, int n) { for (int i = 0; i < n; i++) d[i] = v; }
void clear(char *d, int n) { for (int i = 0; i < n; i++) d[i] = 0; }
int ones(unsigned long v) { int n = 0; while (v) { v &= v - 1; n++; } return n; }
int top(unsigned v) { int n = 0; while (v >>= 1) n++; return n; }
unsigned crc8(unsigned char b) {
  unsigned c = b;
  for (int k = 0; k < 8; k++) c = c & 1 ? c >> 1 ^ 0x8C : c >> 1;
  return c;
}
char *tail(const char *s) { return strrchr(s, 0); }
void *zeroed(unsigned n) { void *p = malloc(n); if (p) memset(p, 0, n); return p; }
int main(void) {
  char b[20], c[20];
  unsigned u[8];
  volatile int two = 2;
  fill(u, 7, 8); clear(b, 20); copy(b, "abc"); copy(c, b);
  int ok = words(wide) == 2 && bytes(b) == 3 && long_items(longs) == 3 && same(b, c, 4) && equal_loop(b, c, 3);
  ok &= append(b, "xy") == b + 2 && formatted(c, "hello") == 5 && power(two) == 4.0f && scaled(3.0f, two) == 12.0f;
  ok &= u[7] == 7 && ones(0xF00FUL) == 8 && top(0x100) == 8 && crc8(1) == 0x5E && tail(c) == c + 5;
  ok &= zeroed(0) == 0 || 1;
  puts(c); printf("%s\\n", c); printf("x"); fputs("abc", stdout); fprintf(stdout, "done\\n");
  return ok ? 7 : 0;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("alone", ALONE)
@pytest.mark.parametrize("level", LEVELS)
def test_loops_replaced_by_library_functions_link_and_work(level: str, alone: str, tmp_path: Path) -> None:
    """The optimiser replaces loops and calls only by library functions that the library contains; such programs
    link."""
    assert status(IDIOMS, tmp_path, level, "-std=gnu11", "-w", "-Wl,--heap=64", *alone.split()) == 7


def test_the_middle_end_introduces_no_missing_library_function(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The driver derives the available functions from the library's symbols: with an empty list the program links
    too."""
    from toolchain.frontend import clang

    monkeypatch.setattr(clang, "ABSENT_FUNCTIONS", [])
    assert status(IDIOMS, tmp_path, "-O2", "-std=gnu11", "-w", "-Wl,--heap=64") == 7


POLLS = """
int flag, other, limit, counted; volatile int good; int table[10];
__attribute__((interrupt, no_auto_psv)) void _T1Interrupt(void) { flag = 1; other++; limit = 4; good = 1; }
void wait(void) { while (!flag) ; }
void waiting(void) { while (!flag) counted++; }
void f(void) { __asm__ volatile("nop"); }
void called(void) { do f(); while (other < 3); }
void wide(void) { while (other < 3 || other > 7) ; }
void careful(void) { while (!good) ; }
void bounded(void) { for (int i = 0; i < 100; i++) if (flag) break; }
int work(void) { int s = 0; for (int i = 0; i < limit; i++) s += table[i]; return s; }
int main(void) { wait(); waiting(); called(); wide(); careful(); bounded(); return work(); }
"""


@pytest.mark.parametrize("level", LEVELS)
def test_polled_flags_that_are_not_volatile_cause_a_warning(level: str, tmp_path: Path) -> None:
    """A polled flag that is not volatile causes a warning that names the loop."""
    source = tmp_path / "polls.c"
    source.write_text(POLLS)
    built = build([source], tmp_path / "polls.elf", level, "-g")
    assert built.status == 0
    named = [line.split("'")[1::2] for line in built.messages.splitlines() if "waited for" in line]
    expected = [["flag", "wait"], ["flag", "waiting"], ["other", "wide"], ["flag", "bounded"]]
    assert named == ([] if level == "-O0" else expected)
    assert level == "-O0" or f"{source}:4: warning: 'flag'" in built.messages
    assert build([source], tmp_path / "quiet.elf", level, "-w").messages == ""


@pytest.mark.parametrize("level", LEVELS)
def test_delay_loops_are_not_deleted(level: str, tmp_path: Path) -> None:
    """Delay loops are not removed, although C11 6.8.5p6 permits it."""
    source = tmp_path / "wait.c"
    source.write_text("int flag; int main(void) { while (!flag) ; return 0; }")
    image = tmp_path / "wait.elf"
    assert build([source], image, level, "-fno-lto").status == 0
    assert run(image, 10_000, engine="auto").why.startswith("limit")


def status(text: str, folder: Path, *options: str) -> int | None:
    """Return the exit status of a program."""
    source, image = folder / "program.c", folder / "program.elf"
    source.write_text(text)
    built = build([source], image, *options)
    assert built.status == 0, built.messages
    return run(image, 2_000_000, engine="auto").status
