"""Preemption at every instruction of every kernel call, and failing allocations: samples of the whole campaign."""

from __future__ import annotations

import re

import pytest

from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.contracts import legal_in_interrupts, refused_in_interrupts
from tests.firmware.injection import LEFT, MASKED, MODES, fail_every_allocation, sweep
from tests.firmware.kernel.test_kernel_on_target import load, place
from tests.fuzz.seeds import base_seed

STRIDE = 211


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_interrupts_at_every_instruction_change_nothing(image: Build, mode: str) -> None:
    """Interrupts injected into every kernel call lose no register, message or memory.

    The interrupts are the tick, UART, stepper, an IPL 6 interrupt and a 100 us device that makes every call. The
    test samples every 211th boundary, from an offset and with an IPL slip that the commit determines;
    tests/fuzz/kernel/fuzz_kernel.py runs all. Sources: kernel.md §4 `--ipl-slip`; bugs 7, 12, 13 of
    openswarm-original.md §7.
    """
    ipl_slip = (base_seed() + MODES.index(mode)) % 2
    phase = (base_seed() + 106 * MODES.index(mode)) % STRIDE  # a failure message names its boundary
    *_, (scenes, seen) = sweep(image("calls", TARGET_APPS), ipl_slip, mode, STRIDE, phase)
    assert scenes == 9
    assert seen.boundaries > 60
    assert seen.compared > seen.boundaries
    assert seen.stack_left >= LEFT
    assert seen.stepper_late <= MASKED + 20


def test_the_interrupt_makes_every_call_of_the_headers() -> None:
    """target/calls/isr_calls.c makes every call of the headers: a call added to a header must be added there."""
    source = (TARGET_APPS / "calls" / "isr_calls.c").read_text()
    legal, refused = source.split("/* ---- Calls that the kernel must refuse")
    assert set(re.findall(r"\bSys_\w+(?=\()", legal)) == legal_in_interrupts()
    assert set(re.findall(r"\bSys_\w+(?=\()", refused)) >= refused_in_interrupts()


@pytest.mark.slow
def test_every_allocation_may_fail(image: Build) -> None:
    """If the k-th allocation of a scene fails, for any k, the affected call fails and nothing else changes."""
    *_, (scenes, failures) = fail_every_allocation(image("calls", TARGET_APPS))
    assert scenes == 9
    assert failures >= 25


def test_a_register_lost_in_a_switch_is_seen(image: Build) -> None:
    """The sweep detects a lost register: it fails if the switch saves W10 and W11 twice instead of W12 and W13."""
    path = image("calls", TARGET_APPS)
    save = place(load(path), "_T2Interrupt") + 14  # PUSH.D W12
    with pytest.raises(AssertionError, match="register"):
        for _ in sweep(path, 0, "together", STRIDE, patch={save: 0xBE9F8A}):
            pass
