"""Faults on the RISC-V: each is reported with its program counter and thread, stops the motors and ends QEMU with 1."""

from __future__ import annotations

import re
import subprocess
from contextlib import closing
from pathlib import Path

import pytest

from firmware.tools.simulated import qemu
from firmware.tools.simulated.machine import Symbols, peek, poke_words
from tests.cases import check_all
from tests.firmware.ports.targets import BOARDS, in_qemu, make

TARGET = "qemu_virt"
FAULTY = r"""
#include <openswarm.h>
#include <openswarm_io.h>
volatile uint16 kind, place; /* set by the test */
volatile uint32 zero;
static volatile bool working;
enum { ILLEGAL = 1, MISALIGNED, JUMP, LOAD, STORE, BREAK, CALL, STACK };
enum { BEFORE_INIT = 1, BEFORE_START, THREAD, SECTION, HANDLER, INTERRUPT, REPORT };
static __attribute__((noinline)) void fault_in(uint16 here)
{
    if (place != here) {
        return;
    }
    switch (kind) {
    case ILLEGAL: __asm__ volatile("at_illegal: .4byte 0"); break;
    case MISALIGNED: __asm__ volatile("at_misaligned: lr.w t0, (%0)" ::"r"((uint32)&zero + 1) : "t0"); break;
    case JUMP: __asm__ volatile("jr %0" ::"r"(zero)); break;
    case LOAD: __asm__ volatile("at_load: lw t0, (%0)" ::"r"(zero) : "t0"); break;
    case STORE: __asm__ volatile("at_store: sw t0, (%0)" ::"r"(zero)); break;
    case BREAK: __asm__ volatile("at_break: ebreak"); break;
    case CALL: __asm__ volatile("at_call: ecall"); break;
    case STACK: __asm__ volatile("mv sp, %0\n1: j 1b" ::"r"(zero)); break; /* the next interrupt stores there */
    default: break;
    }
}
static bool handler(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    if (working) {
        fault_in(HANDLER);
    }
    return true;
}
void __real_board_tick(void);
void __wrap_board_tick(void);
void __wrap_board_tick(void)
{
    __real_board_tick();
    if (working) {
        fault_in(INTERRUPT);
    }
}
void __real_board_failsafe(void);
void __wrap_board_failsafe(void);
void __wrap_board_failsafe(void)
{
    __real_board_failsafe();
    fault_in(REPORT);
}
static void worker(void)
{
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 100);
    Sys_Sleep(2);
    fault_in(THREAD);
    if (place == REPORT) {
        Sys_Assertion_Failed("here", 1);
    }
    if (place == SECTION) {
        Sys_Start_CriticalSection();
        fault_in(SECTION);
    }
    working = true;
    for (;;) { /* interrupts come while it runs */
    }
}
int main(void)
{
    fault_in(BEFORE_INIT);
    Sys_Init_Kernel();
    fault_in(BEFORE_START);
    Sys_Start_Process(worker);
    Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, handler, NULL);
    Sys_Start_Kernel();
    Sys_Sleep(1000);
    return 0;
}
"""
KINDS = ("illegal", "misaligned", "jump", "load", "store", "break", "call", "stack")
PLACES = {"before init": 0, "before start": 0, "thread": 1, "section": 1, "handler": 1, "interrupt": 1}
"""Places of the fault, with the reported PID: in a handler or interrupt that of the interrupted thread."""
WRAPPED = "DEFINES=-Wl,--wrap=board_tick,--wrap=board_failsafe"


@pytest.fixture(scope="module")
def faulty(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Symbols]:
    """Build a program that makes a chosen fault at a chosen place."""
    folder = tmp_path_factory.mktemp("faulty")
    (folder / "faulty").mkdir()
    (folder / "faulty" / "main.c").write_text(FAULTY)
    image = make(TARGET, "faulty", folder / "out", WRAPPED, apps=folder)
    in_qemu(TARGET, image).close()  # skips if QEMU is missing
    return image, Symbols(image)


def report(faulty: tuple[Path, Symbols], kind: int, place: int) -> str:
    """Return what the program reports about a fault, after the motors have stopped and QEMU has ended with status 1."""
    with closing(qemu.Qemu(BOARDS[TARGET], *faulty)) as machine:
        machine.run_to("main")
        poke_words(machine, "kind", (kind,))
        poke_words(machine, "place", (place,))
        machine.run_to("hal_stop")
        assert peek(machine, "board_left") == 0
        assert machine.run_to_end() == 1
        return machine.uart().decode()


@pytest.mark.slow
def test_a_fault_is_reported_wherever_it_comes(faulty: tuple[Path, Symbols]) -> None:
    """Every exception is an address trap with its program counter, also before the kernel knows a thread."""
    _, symbols = faulty

    def check(kind: str, place: str) -> None:
        said = report(faulty, KINDS.index(kind) + 1, list(PLACES).index(place) + 1)
        match = re.fullmatch(r"address trap at 0x(\w+):(\w+) in thread (\d+)\r\n", said)
        assert match, said
        pc = int(match[1], 16) << 16 | int(match[2], 16)
        assert int(match[3]) == PLACES[place]
        if kind == "stack":
            assert pc in {*symbols.span("clock_interrupt"), *symbols.span("slice_interrupt")}
        else:
            assert pc == (0 if kind == "jump" else symbols[f"at_{kind}"])

    def is_taken(kind: str, place: str) -> bool:
        """Whether an interrupt can occur at this place."""
        return kind != "stack" or place in ("thread", "section", "handler")

    check_all(check, [(kind, place) for kind in KINDS for place in PLACES if is_taken(kind, place)])


def test_a_fault_of_the_report_ends_the_system(faulty: tuple[Path, Symbols]) -> None:
    """A board whose safe state faults again prints nothing and stops."""
    assert report(faulty, KINDS.index("load") + 1, len(PLACES) + 1) == ""


def test_an_interrupt_withdraws_a_reservation(faulty: tuple[Path, Symbols]) -> None:
    """Each return from an interrupt follows an SC: else an SC of the interrupted code might succeed after a store.

    QEMU withdraws the reservation by itself, so the image is checked. Source: RISC-V unprivileged architecture
    20191213, 8.2.
    """
    image, _ = faulty
    command = ["riscv64-unknown-elf-objdump", "-d", "--no-show-raw-insn", str(image)]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    code = [line.split("\t")[1] for line in lines if line.count("\t") >= 1]
    returns = [at for at, name in enumerate(code) if name.strip() == "mret"]
    assert len(returns) == 2
    assert all("sc.w" in code[at - 2] for at in returns)
