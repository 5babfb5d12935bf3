"""Calls and interrupts before and during Sys_Start_Kernel, on the emulated robot."""

from __future__ import annotations

from functools import partial
from itertools import product
from pathlib import Path

import pytest

from emu import Machine
from emu.cli import main
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.kernel.test_kernel_on_target import FCY, check_each_from, load, words

SCHEDULERS = ["round robin", "fixed priority", "earliest deadline", "woken first"]
MOMENTS = ["never", "before the threads", "before the start", "after the start"]


@pytest.mark.slow
@pytest.mark.parametrize("ipl_slip", [0, 1])
def test_the_start_completes_under_every_scheduler(image: Build, ipl_slip: int) -> None:
    """Sys_Start_Kernel completes under every scheduler.

    A slice end that was forced before the start must not be served before both timers run: a thread that never
    yields would prevent their start.
    """
    machine = load(image("starts", TARGET_APPS), ipl_slip)
    check_each_from(machine, "begin", partial(check_start, machine), product(SCHEDULERS, MOMENTS))


def check_start(machine: Machine, scheduler: str, moment: str) -> None:
    """Run 100 ms from `begin` and check the threads' shares and the timers."""
    machine.poke("scheduler", SCHEDULERS.index(scheduler))
    machine.poke("moment", MOMENTS.index(moment))
    assert machine.run(cycles=FCY // 10).reason == "limit"
    rounds, periods = words(machine, "rounds", 2), machine.peek("periods")
    assert 98 <= machine.peek("now_ms") <= 100
    assert machine.peek("spins") > 0
    if scheduler == "fixed priority" and moment != "never":
        assert rounds[0] >= 45
        assert rounds[1] <= 1, "its priority is below the busy thread's"
        assert 18 <= periods <= 21, "every 5 ms in 100"
    elif scheduler == "earliest deadline" and moment != "never":
        assert 18 <= periods <= 21
        assert min(rounds) >= 4, "round robin beside it"
    else:
        assert min(*rounds, periods) >= 4
    assert machine.peek("T1CON") == 0x8000
    assert machine.peek("T2CON") == 0x8010


NEVER_STARTED = """
#include <openswarm.h>
#include <openswarm_io.h>
enum { ONCE, FOR_EVER, STARTED }; /* positions of the selector */
int main(void)
{
    Sys_Init_Kernel();
    uint8 way = Sys_Get_Selector();
    if (way == STARTED) {
        Sys_Start_Kernel();
    }
    do {
        Sys_Sleep(100);
        sys_event_data *data = Sys_Wait_for_Event(SYS_1ms_TIMER);
        Sys_Clear_EventData(&data);
        Sys_Yield();
    } while (way != ONCE);
    Sys_Run_SystemThread();
    return 0;
}
"""


@pytest.mark.slow
def test_calls_that_need_a_running_kernel_do_not_look_like_success(
    image: Build, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Blocking calls before Sys_Start_Kernel are refused; `emu run` reports the program and exits with status 1."""
    (tmp_path / "early").mkdir()
    (tmp_path / "early" / "main.c").write_text(NEVER_STARTED)
    path = str(image("early", tmp_path))
    for selector, refused in enumerate(("4 calls", "65,535 calls", "")):
        command = ["run", path, "--seconds", "0.5", "--selector", str(selector)]
        assert main(command) == (1 if refused else 0)
        said = capfd.readouterr().err
        if refused:
            assert f"firmware fault: the kernel was never started (Sys_Start_Kernel) and refused {refused}" in said
        assert main([*command, "--exit-code"]) == (125 if refused else 124)
