"""Stacks and requests to switch on the ports: overflows, faults before the kernel, superfluous requests."""

from __future__ import annotations

from pathlib import Path

import pytest

import emu
from emu.avr.image import load_avr_image
from emu.boards.kilobot.swarm import KilobotFaultError, KilobotSetup, KilobotSwarm
from emu.cli import main
from firmware.tools.simulated import qemu
from firmware.tools.simulated.kilobot import HZ
from firmware.tools.simulated.machine import NotInstalled, Stopped
from tests.firmware.conftest import Build
from tests.firmware.ports.targets import BOARDS, kilobot, make, said_by_kilobot, said_in_qemu

# ---- Stack limits ---------------------------------------------------------------------------------------------------

OVERFLOW = r"""
#include <openswarm.h>
#include <openswarm_io.h>
static volatile uint16 depth;
static uint16 recurse(uint16 n)
{
    volatile uint8 room[16];
    room[0] = (uint8)n;
    if (n == SYS_DEFAULT_STACK / 16) {
        Sys_Sleep(5);
        return depth;
    }
    return (uint16)(recurse((uint16)(n + 1u)) + room[0] + depth);
}
static void greedy(void) { Sys_Sleep(20); depth = recurse(0); }
static void modest(void) { for (;;) { Sys_Sleep(100); Sys_Write_UART1("on\n", 3); } }
int main(void)
{
    Sys_Init_Kernel();
    Sys_Start_Process(modest);
    Sys_Start_Process(greedy);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
"""


@pytest.fixture
def overflowing(tmp_path: Path) -> Path:
    """Return a folder of applications, one of which has a second thread that overflows its stack."""
    (tmp_path / "overflowing").mkdir()
    (tmp_path / "overflowing" / "main.c").write_text(OVERFLOW)
    return tmp_path


DROPS = "DEFINES=-DSYS_ON_OVERFLOW=SYS_DROP_THREAD"

SLOW_BOARDS = [pytest.param(board, marks=pytest.mark.slow) for board in BOARDS]
"""QEMU's targets in tests that also run on the Kilobot: each builds a kernel of its own."""
"""Make variable by which a stack overflow ends only its thread."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "reported"), [((), b"stack trap at 0x0:0 in thread 2"), ((DROPS,), b"overflow: thread 2")]
)
def test_the_epuck2_stops_at_a_stack_overflow_or_drops_the_thread(
    overflowing: Path, words: tuple[str, ...], reported: bytes
) -> None:
    """The MPU of the e-puck2 stops a thread that overflows: the end of the system, or of the thread.

    Source: port/cortex_m/README.md.
    """
    image = make("epuck2", "overflowing", overflowing / "out", *words, apps=overflowing)
    said = said_in_qemu("epuck2", image, rb"(on\n){3}" if words else rb"thread 2\r\n")
    assert reported + b"\r\n" in said
    assert words or b"on\n" not in said


@pytest.mark.parametrize("target", ["kilobot", "qemu_virt"])
def test_a_cpu_without_a_limit_stops_when_a_stack_has_overflown(target: str, overflowing: Path) -> None:
    """On an AVR and a RISC-V the next switch detects a stack overflow and stops the system (port/avr/README.md).

    Nothing stops the thread itself. Here unused memory lies below the stack; another thread there would have been
    damaged.
    """
    image = make(target, "overflowing", overflowing / "out", apps=overflowing)
    assert last_words(target, image).startswith(b"stack trap at 0x0:0 in thread 2")


def last_words(target: str, image: Path) -> bytes:
    """Return the UART output of a system that stops by itself."""
    if target == "qemu_virt":
        try:
            status, said = qemu.run(BOARDS[target], image)
        except NotInstalled as missing:
            pytest.skip(str(missing))
        assert status == 1
        return said
    machine = kilobot(image)
    with pytest.raises(Stopped):
        machine.run(HZ)
    return machine.uart()


WITHOUT_A_SWITCH = r"""
#include <openswarm.h>
static volatile uint8 sum;
static void greedy(void)
{
    volatile uint8 room[SYS_DEFAULT_STACK];
    for (uint16 i = 0; i < sizeof room; i++) {
        room[i] = 1;
    }
    sum += room[0];
}
static void modest(void)
{
    for (;;) {
        Sys_Sleep(1);
    }
}
int main(void)
{
    Sys_Init_Kernel();
    Sys_Start_Process(greedy);
    Sys_Start_Process(modest);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
"""


def test_a_thread_that_ends_after_an_overflow_is_reported(tmp_path: Path) -> None:
    """The RISC-V port detects an overflow when a thread ends before any switch checks it (port/riscv/README.md).

    The overflow damages the control block of the next thread.
    """
    (tmp_path / "ending").mkdir()
    (tmp_path / "ending" / "main.c").write_text(WITHOUT_A_SWITCH)
    image = make("qemu_virt", "ending", tmp_path / "out", apps=tmp_path)
    assert last_words("qemu_virt", image) == b"stack trap at 0x0:0 in thread 1\r\n"


IN_A_HANDLER = r"""
#include <openswarm.h>
static volatile uint8 sum;
static bool handler(uint16 pid, uint16 event, sys_event_data *data)
{
    volatile uint8 room[BYTES];
    (void)pid, (void)event;
    for (uint16 i = BYTES; data->value == 25 && i-- != 0;) {
        room[i] = (uint8)i;
        sum += room[i];
    }
    return true;
}
int main(void)
{
    Sys_Init_Kernel();
    Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, handler, NULL);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
"""


@pytest.mark.parametrize("target", ["kilobot", *SLOW_BOARDS])
def test_an_overflow_of_the_kernel_stack_stops_the_system(target: str, tmp_path: Path) -> None:
    """An overflow of the kernel stack stops the system: at once with an MPU, on AVR and RISC-V after the handlers.

    AVR and RISC-V detect it by the fill pattern in the last byte of the stack, so the memory below must survive. On the
    AVR the kernel's variables are below, so the handler leaves the last bytes of the stack for the tick, which
    interrupts it (port/avr/README.md).
    """
    (tmp_path / "handler").mkdir()
    (tmp_path / "handler" / "main.c").write_text(IN_A_HANDLER)
    bytes_ = "(SYS_KERNEL_STACK-28)" if target == "kilobot" else "SYS_KERNEL_STACK"
    image = make(target, "handler", tmp_path / "out", f"DEFINES=-DBYTES='{bytes_}'", apps=tmp_path)
    if target == "epuck2":
        assert said_in_qemu(target, image, rb" in thread \d+\r\n").startswith(b"stack trap at 0x")
    else:
        assert last_words(target, image).startswith(b"stack trap at 0x0:0 in thread ")


EARLY = r"""
#include <openswarm.h>
int main(void)
{
    Sys_Assertion_Failed("early.c", 7);
    return 0;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("target", BOARDS)
def test_a_fault_before_the_kernel_names_main(target: str, tmp_path: Path) -> None:
    """A report before Sys_Init_Kernel() names thread 0, although no thread exists yet."""
    (tmp_path / "early").mkdir()
    (tmp_path / "early" / "main.c").write_text(EARLY)
    image = make(target, "early", tmp_path / "out", apps=tmp_path)
    assert said_in_qemu(target, image, rb"thread \d+\r\n") == b"early.c:7 in thread 0\r\n"


def test_a_failed_assertion_on_a_kilobot_is_a_fault(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A fatal stop of the kernel on a Kilobot is a fault of `emu run` and of a swarm, which names the robot once."""
    (tmp_path / "early").mkdir()
    (tmp_path / "early" / "main.c").write_text(EARLY)
    image = make("kilobot", "early", tmp_path / "out", apps=tmp_path)
    assert main(["run", str(image), "--board", "kilobot", "--seconds", "1"]) == 1
    told = capsys.readouterr().err
    assert "emu run: fault: the kernel stopped the system" in told
    assert "hal_stop" in told
    swarm = KilobotSwarm([KilobotSetup(load_avr_image(image), number=number) for number in range(2)])
    for robot in range(2):
        with pytest.raises(KilobotFaultError, match=r"the kernel stopped the system at .*hal_stop") as caught:
            swarm.run(0.1)
        assert caught.value.robot == robot
        swarm.stop(robot)
    swarm.run(0.1)


# ---- Requests -------------------------------------------------------------------------------------------------------

SUPERFLUOUS = r"""
#include "kernel.h"
#include <openswarm_io.h>
static void request(void)
{
    hal_slice_force();
    Sys_Start_CriticalSection(); /* an AVR takes the request at the next unlock */
    Sys_End_CriticalSection();
    Sys_Write_UART1("on\n", 3);
    Sys_Sleep(1000);
}
int main(void)
{
    Sys_Init_Kernel();
    Sys_Start_Process(request);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
"""


@pytest.mark.parametrize("target", ["epuck", "kilobot", *SLOW_BOARDS])
def test_a_superfluous_request_to_switch_is_harmless(target: str, image: Build, tmp_path: Path) -> None:
    """A thread continues after a superfluous request to switch (hal_cpu.h: hal_slice_force).

    An interrupt that sets round robin while the kernel requests a switch leaves such a request.
    """
    (tmp_path / "superfluous").mkdir()
    (tmp_path / "superfluous" / "main.c").write_text(SUPERFLUOUS)
    if target == "epuck":
        machine = emu.load(image("superfluous", tmp_path))
        said = bytearray()
        machine.uart[1].on_byte = lambda byte, _: said.append(byte)
        machine.run(seconds=0.02)
        assert said == b"on\n"
        return
    built = make(target, "superfluous", tmp_path / "out", apps=tmp_path)
    said_then = said_by_kilobot(built, 0.02) if target == "kilobot" else said_in_qemu(target, built, b"on\n")
    assert said_then == b"on\n"
