"""Fault reports name the cause: C programs with one mistake each, built with the project's compiler."""

from __future__ import annotations

import json

import pytest

import emu
from emu.cli import main
from toolchain.driver import driver

RECURSION = """
int depth(int n) { volatile char pad[20]; pad[0] = n; return depth(n + 1) + pad[0]; }
int main(void) { return depth(1); }
"""
WILD = """
typedef void (*function)(void);
volatile unsigned where = WHERE;
void caller(int parameter) { ((function)where)(); }
int main(void) { for (int i = 0; i < 50; i++) { where; } caller(77); return 0; }
"""
RETURN = """
volatile int i;
void smash(void) { int *top = (int *)__builtin_frame_address(0); for (i = -4; i < 2; i++) { top[i] = WHERE; } }
int main(void) { smash(); return 0; }
"""
STORE = """
struct point { int x; long y; } room;
struct point *volatile somewhere = (struct point *)0x3001;
static __attribute__((noinline)) void set(struct point *p, int value) { p->x = value; }
int main(void) { set(somewhere, 1234); return room.x; }
"""
LOST = """
volatile int seen;
void __attribute__((noinline)) use(void) { seen++; asm volatile("" ::: "w0", "w1", "w2", "w3", "w4", "w5", "w6"); }
void __attribute__((noinline)) set(int *p, int n) { int twice = 2 * n; seen = twice; use(); *p = 1; }
int main(void) { set((int *)0x3001, seen); return 0; }
"""
PAST_THE_END = """
        .global __reset
        .text
__reset: mov #0x800, w0
        mov #0x1234, w1
        mov w1, [w0]
        nop
"""
DIVISION = """
volatile int zero;
int quotient(int n) { return n / zero; }
int main(void) { return quotient(10); }
"""
CHECKS = {
    "volatile int a = 32767; int main(void) { return a + 1; }": "overflow in an addition",
    "volatile int a = -32767; int main(void) { return a - 2; }": "overflow in a subtraction",
    "volatile int a = 20000; int main(void) { return a * 2; }": "overflow in a multiplication",
    "volatile int a = -32767 - 1; int main(void) { return -a; }": "overflow in a negation",
    "volatile int a; int main(void) { return 5 / a; }": "division by zero",
    "volatile int a = 16; int main(void) { return 1 << a; }": "a shift by too many bits",
    "volatile int a = 3; int b[3]; int main(void) { return b[a]; }": "an index out of bounds",
    "int *volatile p; int main(void) { return *p; }": "a null or misaligned pointer",
    "volatile int a; int main(void) { if (!a) __builtin_unreachable(); return 0; }": "cannot be reached",
    "volatile int n = -1; int main(void) { int a[n]; a[0] = 1; return a[0]; }": "length is not positive",
    "volatile char c = 3; int main(void) { return *(_Bool *)&c; }": "a value that the type does not have",
}


@pytest.fixture
def build(tmp_path):
    """Return a function that compiles C source and returns the path of the image."""

    def make(source, *options):
        path = tmp_path / "program.c"
        path.write_text(source)
        image = tmp_path / "program.elf"
        assert driver.main(["-g", *(options or ["-O0"]), str(path), "-o", str(image)]) == 0
        return str(image)

    return make


def fault(path, **options):
    """Return the fault of a run through the Python API, after checking that the command line reports the same."""
    stop = emu.load(path).run(seconds=1, **options)
    assert stop.reason == "fault", stop
    assert stop.fault is not None
    return stop.fault


def functions(found):
    return [frame.function for frame in found.frames]


def test_a_division_by_zero_is_a_fault_in_python_too(build):
    found = fault(build(DIVISION))
    assert found.cause.startswith("math error trap")
    assert functions(found)[:2] == ["quotient", "main"]
    assert found.line.endswith("program.c:3")
    assert dict(found.frames[0].variables) == {"n": "10"}


def test_command_line_json_and_python_report_the_same(build, capfd):
    path = build(DIVISION)
    found = fault(path)
    assert main(["run", path, "--json"]) == 1
    facts = json.loads(capfd.readouterr().out)
    assert facts["reason"] == "fault"
    assert facts["fault"] == json.loads(json.dumps(found.facts()))
    assert main(["run", path]) == 1
    assert found.report() in capfd.readouterr().err


@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_endless_recursion_is_a_stack_overflow_in_the_recursive_function(build, level):
    found = fault(build(RECURSION, level))
    assert found.cause.startswith("stack overflow: W15 is 0x2")
    assert "the limit 0x27f0" in found.cause
    assert found.function == "depth"
    assert functions(found)[:5] == ["depth"] * 5


@pytest.mark.slow
@pytest.mark.parametrize("level", ["-O0", "-Os"])
@pytest.mark.parametrize("where", [0x9876, 0x17F00])
def test_a_wild_jump_is_reported_with_its_origin(build, level, where):
    found = fault(
        build(
            WILD.replace("volatile unsigned where", "volatile unsigned long where").replace("WHERE", f"{where}ul"),
            level,
        )
    )
    target = where & 0xFFFF  # a function pointer has 16 bits
    assert found.cause.startswith(f"call to {target:#08x}, where there is erased flash")
    assert found.branches[-1].target == target
    assert found.branches[-1].source == found.pc
    assert ("caller" if level == "-O0" else "main") in functions(found)[:2]
    assert len(found.branches) == 20


@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_a_call_to_address_0_is_reported_at_the_call(build, level):
    found = fault(build(WILD.replace("WHERE", "0"), level))
    assert found.cause == "call to address 0 (a null function pointer?)"
    assert found.branches[-1].source == found.pc
    assert found.line.endswith("program.c:4")


def test_a_return_through_a_smashed_stack_is_reported(build):
    found = fault(build(RETURN.replace("WHERE", "0x7A")))
    assert "return to 0x7a007a" in found.cause
    assert found.function == "smash"


@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_a_bad_store_is_reported_with_address_and_variables(build, level):
    found = fault(build(STORE, level))
    assert found.cause.startswith("address error trap: writing 2 bytes at 0x3001, an odd address")
    assert functions(found)[:2] == ["set", "main"]
    known = dict(found.frames[0].variables)
    assert known["p"] == "0x3001"
    assert known["value"] in ("1234",) if level == "-O0" else ("1234", "<optimised out>")


def test_a_report_names_variables_without_a_value(build):
    """A variable that optimised code no longer keeps at the fault is listed without a value."""
    found = fault(build(LOST, "-Os"))
    assert dict(found.frames[0].variables) == {"p": "0x3001", "n": "<optimised out>", "twice": "<optimised out>"}


@pytest.mark.slow
@pytest.mark.parametrize(("source", "cause"), CHECKS.items())
@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_a_check_of_the_sanitizer_that_fails_is_a_fault(build, capfd, level, source, cause):
    path = build(source, level, "-fsanitize=undefined")
    found = fault(path)
    assert found.cause.startswith("undefined behaviour: ")
    assert cause in found.cause
    assert found.function == "main"
    assert main(["run", path]) == 1
    assert main(["run", path, "--exit-code"]) == 125
    assert "undefined behaviour" in capfd.readouterr().err


def test_builtin_trap_is_a_fault_and_a_software_breakpoint_is_none(build):
    assert fault(build("int main(void) { __builtin_trap(); }")).cause == "__builtin_trap(),"
    stop = emu.load(build("int main(void) { __builtin_software_breakpoint(); return 0; }")).run(seconds=1)
    assert (stop.reason, stop.fault) == ("breakpoint", None)


def test_a_trap_in_an_interrupt_shows_the_interrupted_function(build):
    found = fault(build("""
#include <p30F6014A.h>
volatile int zero, seconds;
static __attribute__((noinline)) int broken(int n) { return n / zero; }
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void) { IFS0bits.T1IF = 0; seconds = broken(5); }
static __attribute__((noinline)) void wait(int inside) { for (;;) { seconds += inside; } }
int main(void) { PR1 = 1000; IEC0bits.T1IE = 1; T1CON = 0x8000; wait(0); }
""", "-Os"))  # fmt: skip
    assert functions(found)[:4] == ["broken", "_T1Interrupt", "wait", "main"]
    assert [frame.kind for frame in found.frames[:3]] == ["call", "interrupt", "call"]
    assert any(branch.kind == "exception" for branch in found.branches)


@pytest.mark.parametrize("engine", ["plain", "jit"])
def test_the_report_depends_on_neither_engine_nor_slices(build, engine):
    """The report is the same for any engine and any division of the run, and making it does not change the machine."""
    path = build(DIVISION)
    whole = emu.load(path)
    expected = whole.run(seconds=1)
    machine = emu.load(path, engine=engine)
    while (stop := machine.run(cycles=7)).reason == "limit":
        pass
    assert stop == expected
    assert machine.snapshot() == whole.snapshot()
    undiagnosed = emu.load(path, engine=engine)
    undiagnosed.diagnose = None
    undiagnosed.run(seconds=1)
    assert machine.snapshot() == undiagnosed.snapshot()


def test_the_diagnosis_calls_no_observer(build):
    machine = emu.load(build("""
#include <stdio.h>
volatile int zero;
int main(void) { printf("before\\n"); for (volatile int i = 0; i < 3000; i++) { } return 1 / zero; }
"""))  # fmt: skip
    said, calls, writes = bytearray(), [], []
    machine.uart[1].listen(lambda byte, _cycle: said.append(byte))
    machine.hook_pc("main", lambda: calls.append(machine.cycle))
    machine.hook_sfr("U1TXREG", lambda _write, word: writes.append(word))
    assert machine.run(seconds=1).reason == "fault"
    assert said == b"before\n"
    assert (len(calls), bytes(writes)) == (1, b"before\n")


def test_input_from_a_callback_leaves_a_report_without_branches(build):
    """A replay cannot repeat input that a callback feeds during a run, so the report omits the branches and has all
    other parts."""
    machine = emu.load(build("""
#include <p30F6014A.h>
#include <stdio.h>
volatile int zero;
int main(void) { printf("?"); while (!U1STAbits.URXDA) { } return 1 / zero; }
"""))  # fmt: skip
    machine.uart[1].listen(lambda _byte, _cycle: machine.uart[1].feed(b"x"))
    stop = machine.run(seconds=1)
    assert stop.fault is not None
    assert stop.fault.function == "main"
    assert stop.fault.branches == ()


def test_no_jump_is_blamed_when_execution_runs_through_erased_flash(tmp_path):
    """If execution runs through erased flash, the fault is the fetch beyond flash, and no jump is named as its cause,
    because the last branch led into the program."""
    source = tmp_path / "off.s"
    source.write_text(PAST_THE_END)
    image = emu.build(source, flags=("-nostdlib", "-nostartfiles"), output=tmp_path / "off.elf")
    stop = emu.load(image, board=None).run(cycles=200_000)
    assert stop.fault is not None
    assert "jump to" not in stop.fault.cause
    assert stop.fault.cause.startswith("address error trap")
    assert stop.fault.pc >= 0x018000 - 2
