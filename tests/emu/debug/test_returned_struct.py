"""A local struct that a function returns is the caller's object; the debugger shows it there."""

from __future__ import annotations

from pathlib import Path

import pytest

import emu
from toolchain.driver import driver

SOURCE = """
typedef struct { int kind; unsigned value; } command;
typedef struct { int a, b, c, d; } big;
volatile int sink;
static void __attribute__((noinline)) mark(void) { sink++; }
static command __attribute__((noinline)) parse(int n)
{
    command c = {0, 0};
    if (n == 3) { c.kind = 7; c.value = 9; }
    mark();
    sink = c.kind;
    return c;
}
static big __attribute__((noinline)) make(int n)
{
    big g = {n, 2, 3, 4};
    mark();
    g.b = n + 5;
    mark();
    sink = g.b;
    return g;
}
int main(void)
{
    command r = parse(3);
    big h = make(4);
    sink = r.kind + h.b;
    return 0;
}
"""


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("returned")
    (folder / "p.c").write_text(SOURCE)
    assert driver.main(["-O0", "-g", str(folder / "p.c"), "-o", str(folder / "p.elf")]) == 0
    return folder / "p.elf"


def test_the_object_is_shown_while_the_function_fills_it(image: Path) -> None:
    """The struct's location is the address that the caller passed, as long as the function needs that address."""
    machine = emu.load(image, board=None)
    shown = []
    for _ in range(3):
        machine.run(until="mark")
        inspector = machine.inspector
        frame = inspector.frames()[1]
        named = [inspector.variable(name, frame) for name in ("c", "g")]
        shown.append({one.name: inspector.value(one, frame).get() for one in named if one is not None})
    assert shown == [
        {"c": {"kind": 7, "value": 9}},
        {"g": {"a": 4, "b": 2, "c": 3, "d": 4}},
        {"g": {"a": 4, "b": 9, "c": 3, "d": 4}},
    ]
