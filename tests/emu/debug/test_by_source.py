"""Variables, call stacks, function calls and UART expectations by source names, with compiled programs."""

from __future__ import annotations

import contextlib
import re

import pytest

import emu
from emu.debug.dwarf.location import Unavailable
from emu.debug.function_call import CallError
from emu.debug.history import History
from emu.peripherals.uart.expect import ExpectError
from toolchain.driver import driver

PROGRAM = """
#include <stdint.h>
#include <stdio.h>
enum colour { RED = 1, GREEN, BLUE };
struct point { int x; long y; unsigned char flags : 3, mode : 5; signed char low : 4; };
typedef struct robot { int speed[2]; struct point place, *target; enum colour colour; float gain; char name[8];
                       uint64_t big; union { int whole; char parts[2]; } u; } robot_type;
robot_type robot = {{-5, 300}, {7, -70000, 5, 17, -3}, &robot.place, BLUE, 0.5f, "epuck", 0x123456789ABCull, {0x4142}};
static int hidden[3][2] = {{1, 2}, {3, 4}, {5, 6}};
const int table[4] = {10, 20, 30, 40};
volatile unsigned char small = 200; volatile signed char negative = -3; volatile _Bool yes = 1; int *nothing;
uint16_t __attribute__((noinline, used)) crc16(const uint8_t *data, uint16_t size)
{
    uint16_t crc = 0xFFFF;
    while (size--) { crc ^= *data++; for (int i = 0; i < 8; i++) { crc = crc & 1 ? crc >> 1 ^ 0xA001 : crc >> 1; } }
    return crc;
}
int unused_one = 5;
int32_t __attribute__((noinline, used)) mixed(int8_t a, int32_t b, int16_t c, float d)
{ return a + b + c + (int32_t)d; }
void __attribute__((noinline, used)) forever(void) { for (;;) { } }
void __attribute__((noinline, used)) broken(void) { *(volatile int *)0x3001 = 1; }
int __attribute__((noinline)) inner(int depth, long wide)
{
    int local = depth * 2;
    if (depth > 0) { int block = local + 1; return inner(depth - 1, wide + block) + local; }
    printf("ready %d\\n", (int)wide);
    return hidden[1][1] + table[2];
}
const void *volatile keep[16];
int main(void)
{
    keep[0] = &robot; keep[1] = hidden; keep[2] = table; keep[3] = (void *)&small; keep[4] = (void *)&negative;
    keep[5] = (void *)&yes; keep[6] = &nothing;
    keep[7] = crc16; keep[8] = mixed; keep[9] = forever; keep[10] = broken;
    int result = inner(3, 100000L); printf("done %d\\n", result);
    return 0;
}
"""
GLOBALS = [
    ("robot.speed[1]", 300), ("robot.speed", [-5, 300]), ("robot.place.y", -70000), ("robot.place.flags", 5),
    ("robot.place.mode", 17), ("robot.place.low", -3), ("robot.target->x", 7),
    ("*robot.target", {"x": 7, "y": -70000, "flags": 5, "mode": 17, "low": -3}), ("(*robot.target).y + 1", -69999),
    ("robot.colour", 3), ("robot.colour == BLUE", 1), ("robot.gain", 0.5), ("robot.name[1]", ord("p")),
    ("robot.big", 0x123456789ABC), ("robot.u.parts[1]", 0x41), ("&robot.speed[1] - &robot.speed[0]", 1),
    ("*(robot.speed + 1)", 300), ("*(1 + &robot.speed[0])", 300), ("1[robot.speed]", 300),
    ("*(hidden + 2)", [5, 6]), ("*(hidden[1] + 1) - *(robot.name + 1)", 4 - ord("p")),
    ("&hidden[2][1] - hidden[0]", 5), ("small - 201 < 0 && robot.place.flags - 6 < 0", 1),
    ("U1MODE - 0x8001 == 0xFFFF && U1MODE - 0x8001 > 0", 1), ("~U1MODE", 0x7FFF), ("-U1MODE", 0x8000),
    ("negative < U1MODE", 0), ("0x8000 + 0x8001", 1), ("30000 + 30000", 60000),
    ("robot.big << 32", 0x56789ABC00000000), ("robot.big * 0x10000 / 0x10000", 0x123456789ABC),
    ("010 + 0b11 + 0x1fuL", 42), ("'\\a' + '\\x41' + '\\101'", 137), ("'\\xff'", -1), ("1.5e1 + .5 + 2.f", 17.5),
    ("*(&robot.speed[0] + 1)", 300), ("hidden[2][0]", 5), ("table[3]", 40), ("small", 200), ("negative", -3),
    ("yes", True), ("nothing == 0 && !nothing", 1), ("small > 100 ? RED : GREEN", 1), ("-7 / 2", -3),
    ("-7 % 3", -1), ("1 << 4 | 0x3 & ~1", 18), ("'a' + '\\n'", 107), ("U1MODE", 0x8000), ("U1MODE.UARTEN", 1),
    ("U1MODEbits.UARTEN", 1), ("(unsigned char)robot.speed[1]", 44), ("(int)(signed char)small", -56),
    ("(unsigned)negative == 0xFFFD && (unsigned long)negative == 0xFFFFFFFD", 1),
    ("(long)small * 1000 + (int)-1.9", 199999), ("(_Bool)robot.gain", True), ("(enum colour)2 == GREEN", 1),
    ("-(int)3 + (table[0]) - (1)", 6), ("*(unsigned *)&robot", 0xFFFB),
    ("((struct point *)robot.target)->x + ((robot_type *)&robot)->place.x", 14), ("*(int (*)[2])hidden", [1, 2]),
    ("((const volatile unsigned char *)hidden)[2]", 2), ("(uint8_t)0x1FF + (size_t)-1", 254),
    ("sizeof(struct point)", 8), ("sizeof(robot_type) - sizeof robot", 0),
    ("sizeof robot.speed / sizeof(int) + sizeof(hidden[9])", 6),
    ("sizeof(long) * 1000 + sizeof(long long) * 100 + sizeof(char *) * 10 + sizeof 'a'", 4822),
    ("sizeof *robot.target + sizeof nothing[0] + sizeof(1 / 0) + sizeof(hidden + 1)", 14),
    ("sizeof(small + 1) * 10 + sizeof(small)", 21), ("sizeof(1.5f) * 10 + sizeof(1.5)", 48),
    ("robot.gain * .1f == .05f && .1f * .1f != .1 * .1", 1), ("0.1f * 0.1f == (float)0.01", 0),
    ("1 ? -1 : 1u", 0xFFFF), ("0 && sizeof(unknown)", 0),
]  # fmt: skip


@pytest.fixture(scope="module")
def build(tmp_path_factory):
    built = {}

    def make(*options, source=PROGRAM):
        if (options, source) not in built:
            folder = tmp_path_factory.mktemp("c")
            (folder / "p.c").write_text(source)
            image = folder / "p.elf"
            assert driver.main(["-g", *options, str(folder / "p.c"), "-o", str(image)]) == 0
            built[options, source] = str(image)
        return built[options, source]

    return make


ASSIGNED = [
    ("robot.speed[1]", -9), ("robot.place.mode", 30), ("robot.place.low", -8), ("small", 7), ("robot.gain", 1.25),
    ("robot.big", 1 << 60), ("robot.u.parts[0]", 1), ("LATB", 0x1234),
]  # fmt: skip
INVALID = [
    ("unknown", "nothing called 'unknown'"), ("robot.weight", "no member 'weight'"), ("robot +", "ends too early"),
    ("robot * 2", "is no number"), ("hidden[3]", "elements 0 to 2"), ("1 / 0", "zero"), ("small small", "too much"),
    ("", "empty"), ("a ` b", "not understood"), ("&5", "no address"),
    ("&robot.place.mode", "no address"), ("09", "no number of C"), ("9" * 5000, "no number of C"),
    ("'\\q'", "no char"),
    ("1?" * 4000 + "1" + ":1" * 4000, "inside one another"), ("robot.speed + 1.5", "needs whole numbers"),
    ("robot.speed[1e0]", "needs whole numbers"),
    ("(struct unknown *)0x800", "nothing called 'struct unknown'"), ("(long char)1", "'long char' is no type"),
    ("(int", "expected ')'"), ("(struct point)1", "no struct point"), ("(int)robot", "no int"),
    ("*(void *)0x800", "has no value"), ("sizeof robot.place.mode", "bit field has no size"),
    ("sizeof(void)", "size of void is not known"), ("(int)(1e308 * 10)", "inf is no whole"),
    ("(int[0])1", "number of elements"), ("sizeof unknown", "nothing called 'unknown'"),
    ("(int)" * 99 + "1", "inside"),
    ("5", "names no object"),
]  # fmt: skip


@pytest.fixture(params=["-O0", "-Os"], scope="module")
def paused(build, request):
    """Return a machine paused in the deepest call of `inner`, and its snapshot."""
    made = emu.load(build(request.param))
    made.run(until="main")
    made.uart[1].expect("ready", within=20)
    return made, made.snapshot()


@pytest.fixture
def machine(paused):
    """Return the machine paused in the deepest call of `inner`, in the state of its snapshot."""
    made, state = paused
    made.restore(state)
    return made


def test_expressions_of_c(machine):
    got = [(expression, machine.var(expression), value) for expression, value in GLOBALS]
    assert [one for one in got if one[1] != one[2]] == []


def test_an_assignment_changes_one_object_only(machine, paused):
    for expression, value in ASSIGNED:
        machine.restore(paused[1])
        place = machine.value(expression)
        before = machine.peek_bytes(place.address - 2, 20) if place.address >= 0x800 else None
        machine.set_var(expression, value)
        assert machine.var(expression) == value, expression
        if before is not None:
            size = place.type.bytes
            after = machine.peek_bytes(place.address - 2, 20)
            assert (after[:2], after[2 + size :]) == (before[:2], before[2 + size :]), expression
        if "mode" in expression:
            assert (machine.var("robot.place.flags"), machine.var("robot.place.x")) == (5, 7)


def test_invalid_expressions_are_refused(machine):
    wrong = []
    for expression, words in INVALID:
        try:
            wrong.append((expression[:80], machine.value(expression)))
        except ValueError as error:
            if words not in str(error):
                wrong.append((expression[:80], str(error)))
    assert wrong == []


def test_a_variable_removed_by_the_linker_is_reported(build):
    machine = emu.load(build("-O0"))
    with pytest.raises(Unavailable, match="nothing uses it"):
        machine.var("unused_one")


def test_values_that_do_not_fit_are_refused(machine):
    long = [("small", 256), ("robot.speed[0]", -40000), ("robot.place.flags", 9), ("robot.place.low", 16)]
    for expression, value in long:
        with pytest.raises(ValueError, match="does not fit"):
            machine.set_var(expression, value)
    with pytest.raises(TypeError, match="only numbers"):
        machine.set_var("robot", 1)


INTERRUPTED = """
extern volatile unsigned T1CON, PR1, IFS0, IEC0; volatile unsigned seen, sink, one = 1;
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void) { IFS0 = 0; PR1 = 60 + (seen++ & 15); }
int main(void)
{
    PR1 = 60; IEC0 = 8; T1CON = 0x8000;
    for (unsigned n = 0;; n++) {
        unsigned a = n * 3 + one, b = a ^ 0x55, c = b + n;
        sink = a; sink = b; if (c & one) { sink = c * a; } sink = c;
    }
}
"""


def test_an_interrupted_frame_keeps_its_locals(build):
    """The frame of an interrupted function has its locals, also if a variable moves at the interrupted instruction,
    because the instruction is no call."""
    machine = emu.load(build("-Os", source=INTERRUPTED), board=None)
    machine.run(until="main")
    inspector = machine.inspector

    def locals_of(frame):
        return [(one.name, shown(one, frame)) for one in inspector.variables(frame)]

    def shown(one, frame):
        with contextlib.suppress(Unavailable):
            return inspector.value(one, frame).get()
        return None

    handler, history = machine.program_address("_T1Interrupt"), History(machine)
    interrupted: set[int] = set()
    before: list[tuple[str, int | None]] = []
    for _ in range(3000):  # the timer's period changes, so that it interrupts every instruction at some time
        pc = machine.pc
        history.step()
        top, *callers = machine.backtrace()
        if machine.pc == handler:
            assert callers[0].pc == pc
            assert locals_of(callers[0]) == before, hex(pc)
            interrupted.add(pc)
        elif top.function == "main":
            before = locals_of(top)
    assert len(interrupted) >= 12


def test_locals_of_every_frame_at_O0(build):
    machine = emu.load(build("-O0"))
    machine.run(until="main")
    remove = machine.hook_pc("printf", lambda: True)
    assert machine.run(seconds=0.1).reason == "breakpoint"
    remove()
    frames = machine.backtrace()
    assert [frame.function for frame in frames] == ["printf", *["inner"] * 4, "main", "_resetPRI"]
    wide = 100000
    for depth, frame in zip(range(3, -1, -1), reversed(frames[1:5]), strict=True):
        known = {one.name: machine.inspector.value(one, frame).get() for one in machine.inspector.variables(frame)}
        assert known["depth"] == depth
        assert known["local"] == 2 * depth
        assert known["wide"] == wide
        wide += 2 * depth + 1


def test_a_local_is_correct_or_optimised_out(build):
    machine = emu.load(build("-Os"))
    machine.run(until="inner")
    start = machine.inspector.debug.function(machine.pc)
    known = 0
    for _step in range(8):
        for name, values in (("depth", {3, 2}), ("wide", {100000, 100007}), ("local", {6, 4})):
            with contextlib.suppress(Unavailable):
                assert machine.var(name) in values
                known += 1
        machine.step()
        assert machine.inspector.debug.function(machine.pc) is start
    assert known >= 4  # the parameters are known at least before the first call


@pytest.mark.parametrize("level", ["-O0", "-Os"])
@pytest.mark.parametrize("engine", ["plain", "jit"])
def test_a_call_leaves_the_program_undisturbed(build, level, engine):
    machine = emu.load(build(level), engine=engine)
    machine.run(until="inner")
    assert machine.call("crc16", b"123456789", 9) == 0x4B37
    assert machine.call("mixed", -1, 100000, 10, 2.9) == 100011
    with pytest.raises(ValueError, match="takes 2 arguments"):
        machine.call("crc16", 1)
    with pytest.raises(ValueError, match="does not fit"):
        machine.call("mixed", 1000, 0, 0, 0)
    with pytest.raises(KeyError, match="unknown"):
        machine.call("unknown")
    assert machine.uart[1].expect(re.compile(rb"done (\d+)\n"), within=50)[1] == b"46"


def test_a_function_that_does_not_return_is_an_error(build):
    machine = emu.load(build("-Os"))
    machine.run(until="main")
    with pytest.raises(CallError, match="did not return: Stop\\(reason='limit'"):
        machine.call("forever", cycles=1000)
    machine = emu.load(build("-Os"))
    machine.run(until="main")
    with pytest.raises(CallError, match="writing 2 bytes at 0x3001"):
        machine.call("broken")


def test_expect_continues_after_the_last_match_and_stops_at_the_byte(build):
    machine = emu.load(build("-Os"))
    ends = []
    machine.uart[1].listen(lambda byte, start: ends.append((chr(byte), start)))
    assert machine.uart[1].expect("rea", within=50).group() == b"rea"
    assert "".join(letter for letter, _ in ends) == "rea"
    assert machine.cycle >= ends[-1][1] + 10 * 16  # ten bits of 16 Tcy: U1BRG is 0
    assert machine.cycle < ends[-1][1] + 10 * 16 + 20
    with pytest.raises(ExpectError, match=r"UART1 did not send b'ready' within 5 ms; it sent 'dy -31057"):
        machine.uart[1].expect("ready", within=5)
    machine.uart[1].expect("done", within=5)
    with pytest.raises(ExpectError, match=r"did not send b'a b\.\\r\\n' within"):  # the text as the caller wrote it
        machine.uart[1].expect("a b.\r\n", within=1)
    with pytest.raises(ExpectError, match="the run ended: halt"):
        machine.uart[1].expect("never", within=50)


SLEEPER = """
#include <p30F6014A.h>
volatile unsigned n;
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void)
{ IFS0bits.T1IF = 0; if (++n % 8 == 0) U1TXREG = 'A' + n / 8 % 26; }
int main(void) { U1BRG = 7; U1MODE = 0x8000; U1STA = 0x400; PR1 = 9999; IEC0bits.T1IE = 1; T1CON = 0x8000;
    for (;;) __asm__ volatile("pwrsav #1"); }
"""


@pytest.mark.parametrize("engine", ["jit", "plain"])
def test_expect_stops_at_the_byte_while_the_firmware_sleeps(build, engine):
    """`expect` stops a sleeping firmware at the cycle of the byte, because native code does not run past it."""
    machine = emu.load(build("-Os", source=SLEEPER), engine=engine)
    said = []
    machine.uart[1].listen(lambda byte, start: said.append(start))
    for letter in "BCDEFGHIJKLM":
        machine.uart[1].expect(letter, within=1000)
        assert machine.cycle - said[-1] == 10 * 16 * 8  # ten bits of 16 (U1BRG + 1) Tcy


def test_expect_reports_a_fault(build):
    machine = emu.load(build("-O0", source="int main(void) { *(volatile int *)0x3001 = 1; return 0; }"))
    with pytest.raises(ExpectError, match=r"(?s)writing 2 bytes at 0x3001.*#0 main"):
        machine.uart[1].expect("anything", within=5)


def test_inspection_changes_nothing(machine):
    before = machine.snapshot()
    machine.backtrace()
    machine.var("robot")
    machine.threads()
    assert machine.snapshot() == before
