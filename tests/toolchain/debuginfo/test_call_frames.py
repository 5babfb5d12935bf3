"""Call frame information, used for unwinding at every instruction of programs on the emulator.

The unwound frames are compared with the executed calls, returns and interrupts: return addresses, W15 and the
registers of the callers.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import pytest
from elftools.dwarf.callframe import FDE, CFARule

import emu
from emu.debug.dwarf.location import pieces_of
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.flow import PC_MASK
from emu.machine.machine import Machine
from tests.cases import check_all
from tests.fuzz.seeds import base_seed
from tests.toolchain.c_programs import build
from tests.toolchain.debuginfo.dwarf_reader import dwarf_of
from tests.toolchain.exec.test_exec import FOLDER, cases_of

SP, RCOUNT, RETURN_ADDRESS = 15, 16, 37
RCOUNT_AT = 0x36  # address of RCOUNT (registers.csv)
DEEPEST = 40
STEPS = 12_000
"""Number of executed instructions per program."""
MAIN = """
int exec_failed_line;
{declarations}
int main(void)
{{
    {calls}
    return 0;
}}
"""
OWN = """
#include <dspic30f6014a.h>
volatile int sink, turns;
struct wide { int a[9]; };
__attribute__((noinline)) int last(int a, int b, int c, int d, int e, int f, int g, int h, int i, struct wide w)
{
    return a + b * c + d * e + f * g + h + i + w.a[8] + sink;
}
__attribute__((noinline)) int deep(int n)
{
    int kept[5] = {n, sink, n + 1, n + 2, n + 3};
    struct wide w = {{n, 2, 3, 4, 5, 6, 7, 8, sink}};
    if (n > 0)
        sink = deep(n - 1) + kept[n % 5];
    return last(n, 2, 3, kept[1], kept[2], 6, 7, 8, kept[4], w) + kept[3] + sink;
}
__attribute__((noinline)) int large(int n)
{
    int room[600];
    for (int i = 0; i < 20; i++)
        room[i * 30] = i + n;
    sink = room[n];
    return deep(1) + room[30];
}
__attribute__((noinline)) int dynamic(int n)
{
    int sum = 0;
    for (int i = 1; i < n; i++) {
        int *p = __builtin_alloca(2 * i), q[i];
        p[0] = q[i - 1] = i;
        sum += deep(0) + p[0] + q[i - 1];
    }
    return sum;
}
__attribute__((noinline)) void assembly(void)
{
    __asm__ volatile("push w8\\n mov #5,w8\\n push.d w2\\n nop\\n pop.d w2\\n"
                     "mov w8,[w15++]\\n nop\\n mov [--w15],w0\\n pop w8" ::: "w0");
}
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void) { IFS0bits.T1IF = 0; turns++; }
void __attribute__((interrupt, auto_psv, shadow)) _T2Interrupt(void) { IFS0bits.T2IF = 0; sink ^= turns * 3; }
void __attribute__((interrupt, auto_psv)) _T3Interrupt(void)
{
    int room[4] = {turns, 2, 3, 4};
    IFS0bits.T3IF = 0;
    sink = deep(room[turns & 3] & 1);
}
int main(void)
{
    PR1 = 97; PR2 = 211; PR3 = 1009;
    IPC0bits.T1IP = 6; IPC1bits.T2IP = 5; IPC1bits.T3IP = 3;
    IEC0bits.T1IE = IEC0bits.T2IE = IEC0bits.T3IE = 1;
    T1CON = T2CON = T3CON = 0x8000;
    for (int i = 0; i < 30; i++) {
        deep(3);
        large(7);
        dynamic(4);
        assembly();
    }
    return 0;
}
"""


@dataclass
class ExecutedCall:
    """An executed call or interrupt: its return address, and the caller's W0 to W15 and RCOUNT."""

    back: int
    registers: tuple[int, ...]


class FrameTable:
    """Rows of .debug_frame, indexed by address."""

    def __init__(self, image: Path) -> None:
        self.rows: list[tuple[int, int, dict]] = []
        for entry in dwarf_of(image).CFI_entries():
            if not isinstance(entry, FDE) or not entry.header["address_range"]:
                continue
            start = entry.header["initial_location"]
            end = start + entry.header["address_range"]
            lines = entry.get_decoded().table or entry.cie.get_decoded().table
            starts = [start, *(line["pc"] for line in lines[1:])]
            self.rows += [(a, b, line) for a, b, line in zip(starts, [*starts[1:], end], lines, strict=True)]
        self.rows.sort(key=lambda row: row[:2])
        self.starts = [row[0] for row in self.rows]

    def find(self, pc: int) -> dict | None:
        """Return the row that applies at address `pc`."""
        index = bisect_right(self.starts, pc) - 1
        return self.rows[index][2] if index >= 0 and pc < self.rows[index][1] else None

    def walk(self, machine: Machine) -> list[tuple[int, dict[int, int]]]:
        """Return the frames from the innermost one on: return address and known registers of the caller."""
        pc, registers = machine.pc, dict(enumerate(_registers(machine)))
        found = []
        while len(found) < DEEPEST and (row := self.find(pc)) is not None:
            cfa = _cfa(row["cfa"], registers)

            def word(at: int, cfa: int = cfa) -> int:
                return machine.record.u16[(cfa + at & 0xFFFF) >> 1]

            handler = row[RETURN_ADDRESS].type != "OFFSET"
            pc = (word(0) | word(2) << 16) & PC_MASK
            before, registers = registers, {SP: cfa}
            for r in (*range(SP), RCOUNT):
                rule = row.get(r)
                if rule is None or rule.type == "SAME_VALUE":
                    if r in before:
                        registers[r] = before[r]
                elif rule.type == "OFFSET":
                    registers[r] = word(rule.arg)
            found.append((pc, dict(registers)))
            pc -= 0 if handler else 1  # the return address of a call in last position is beyond the function
        return found


def _cfa(rule: CFARule, registers: dict[int, int]) -> int:
    """Return the value of a CFA rule: register and offset, or an expression (a push under REPEAT)."""
    if rule.expr is None:
        return registers[rule.reg] + rule.offset & 0xFFFF
    view = SimpleNamespace(register=registers.get, address_in=registers.get)
    return pieces_of(bytes(rule.expr), view, lambda: 0)[0].at & 0xFFFF


def _registers(machine: Machine) -> tuple[int, ...]:
    """Return W0 to W15 and RCOUNT."""
    return (*(machine.w[r] for r in range(16)), machine.record.u16[RCOUNT_AT >> 1])


def compare_frames(image: Path) -> tuple[int, int]:
    """Unwind at every instruction from `main` on and compare; return the numbers of instructions and of frames."""
    machine, table = emu.load(image, engine="auto"), FrameTable(image)
    machine.run(until="main", cycles=1_000_000)
    calls: list[ExecutedCall] = []
    instructions = frames = 0
    for _ in range(STEPS):
        pc, registers = machine.pc, _registers(machine)
        machine.service_boundary(machine.cycle + 1)
        while registers[SP] != machine.w[SP]:  # an exception, possibly with a second one before its handler starts
            calls.append(ExecutedCall(pc, registers))
            top = registers[SP] >> 1
            pc = (machine.record.u16[top + 2] | machine.record.u16[top + 3] << 16) & PC_MASK
            registers = (*registers[:SP], registers[SP] + 4, registers[RCOUNT])
        pc = machine.pc
        found = table.walk(machine)
        if found:
            instructions += 1
            for (back, known), call in zip(found, reversed(calls), strict=False):
                assert (back, known[SP]) == (call.back, call.registers[SP]), f"{pc:#x}"
                assert known == {r: call.registers[r] for r in known}, f"{pc:#x}"
                frames += 1
        insn = decode_for_execution(machine.program.word(pc), machine.program.word(pc + 2))
        assert insn is not None
        if insn.row.mnemonic in ("CALL", "RCALL"):
            calls.append(ExecutedCall(pc + 2 * insn.words, registers))
        elif insn.row.mnemonic in ("RETURN", "RETLW", "RETFIE"):
            if not calls:
                break
            calls.pop()
        if machine.step() is not None:
            break
    return instructions, frames


LEVELS = ("-O0", "-O1", "-Os", "-O2 -fno-lto")


@pytest.mark.slow
@pytest.mark.parametrize("level", LEVELS)
def test_frames_of_a_program_with_nested_interrupts(tmp_path: Path, level: str) -> None:
    """A program with nested interrupts is unwound correctly at every instruction.

    It has frames with and without W14, arguments on the stack, VLAs, inline assembly that pushes, and handlers of
    each kind.
    """
    (tmp_path / "own.c").write_text(OWN)
    built = build([tmp_path / "own.c"], tmp_path / "own.elf", "-g", *level.split())
    assert built.status == 0, built.messages
    instructions, frames = compare_frames(tmp_path / "own.elf")
    assert instructions > STEPS * 3 // 4
    assert frames > 2 * instructions


@pytest.mark.slow
def test_frames_of_the_execution_tests(tmp_path: Path) -> None:
    """Programs of the execution tests are unwound correctly at every instruction.

    The commit selects the optimisation levels of each file.
    """

    def check(name: str, level: str) -> None:
        source, image = FOLDER / f"{name}.c", tmp_path / "image.elf"
        cases = cases_of(source)
        declarations = "".join(f"void test_{case}(void);" for case in cases)
        calls = " ".join(f"test_{case}();" for case in cases)
        (tmp_path / "main.c").write_text(MAIN.format(declarations=declarations, calls=calls))
        options = ["-g", "-std=gnu11", f"-I{FOLDER}", *level.split()]
        built = build([source, tmp_path / "main.c"], image, *options)
        assert built.status == 0, built.messages
        instructions, frames = compare_frames(image)
        assert instructions > 250
        assert frames > 100

    pairs = product(["frames", "interrupts", "varargs", "structs"], LEVELS)
    check_all(check, [pair for n, pair in enumerate(pairs) if (n + n // len(LEVELS) + base_seed()) % 2])
