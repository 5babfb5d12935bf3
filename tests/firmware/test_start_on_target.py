"""What happens around Sys_Start_Kernel on the emulated robot."""

from __future__ import annotations

import pytest

from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.test_on_target import FCY, load, run_to, words

SCHEDULERS = ["round robin", "fixed priority", "earliest deadline"]
MOMENTS = ["never", "before the threads", "before the start", "after the start"]


@pytest.mark.parametrize("moment", range(len(MOMENTS)), ids=MOMENTS)
@pytest.mark.parametrize("scheduler", range(len(SCHEDULERS)), ids=SCHEDULERS)
@pytest.mark.parametrize("ipl_slip", [0, 1])
def test_the_start_completes_under_every_scheduler(image: Build, scheduler: int, moment: int, ipl_slip: int) -> None:
    """An end of the slice that was forced before the start must not come before both timers run: beside a thread that
    never yields nothing would ever switch them on."""
    machine = load(image("starts", TARGET_APPS), ipl_slip)
    run_to(machine, "begin")
    machine.poke("scheduler", scheduler)
    machine.poke("moment", moment)
    assert machine.run(cycles=FCY // 10).reason == "limit"
    rounds, periods = words(machine, "rounds", 2), machine.peek("periods")
    assert 98 <= machine.peek("now_ms") <= 100
    assert machine.peek("spins") > 0
    if SCHEDULERS[scheduler] == "fixed priority" and moment != 0:
        assert rounds[0] >= 45
        assert rounds[1] <= 1, "its priority is below the busy thread's"
        assert 18 <= periods <= 21, "every 5 ms in 100"
    elif moment != 0 and SCHEDULERS[scheduler] == "earliest deadline":
        assert 18 <= periods <= 21
        assert min(rounds) >= 4, "round robin beside it"
    else:
        assert min(*rounds, periods) >= 4
    assert machine.peek("T1CON") == 0x8000
    assert machine.peek("T2CON") == 0x8010
