"""Interrupts of the e-puck2 whose priority permits no kernel call: SYS_CHECK_LEVELS stops the system at the call."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmware.tools.simulated.machine import Symbols
from tests.firmware.ports.targets import make, said_in_qemu

RAISED = r"""
#include <openswarm.h>
#include <openswarm_io.h>
#include "registers.h"
enum { PRESSED = SYS_FIRST_USER_EVENT, EXTI0 = 6, VECTORS = 16 + 82 };
static void on_button(void) { CALL; }
static bool note(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event;
    return Sys_Write_UART1(data->value == 3 ? "sent\n" : "odd\n", 5);
}
int main(void)
{
    static uint32_t table[VECTORS] __attribute__((aligned(512)));
    const uint32_t *flash = (const uint32_t *)REGISTER(0xE000ED08); /* VTOR */
    Sys_Init_Kernel();
    for (uint16 i = 0; i < VECTORS; i++) {
        table[i] = flash[i];
    }
    table[16 + EXTI0] = (uint32_t)on_button;
    REGISTER(0xE000ED08) = (uint32_t)table;
    Sys_Register_Event(PRESSED);
    Sys_Subscribe_to_Event(PRESSED, 0, note, NULL);
    NVIC_IPR(EXTI0) = PRIORITY;
    NVIC_ISER(EXTI0) = NVIC_BIT(EXTI0);
    Sys_Start_Kernel();
    NVIC_ISPR(EXTI0) = NVIC_BIT(EXTI0);
    for (;;) {
        Sys_Write_UART1("on\n", 3);
        Sys_Sleep(20);
    }
}
"""
CHECK = "-DSYS_CHECK_LEVELS=1"
STOPPED = rb"kernel call at a wrong priority, exception:22 in thread 0\r\n"


def said(tmp_path: Path, priority: str, call: str, text: bytes) -> bytes:
    """Return what an e-puck2 says on UART1, up to a match of `text`, if an interrupt of a priority makes a call."""
    (tmp_path / "raised").mkdir()
    (tmp_path / "raised" / "main.c").write_text(RAISED.replace("CALL", call).replace("PRIORITY", priority))
    return said_in_qemu("epuck2", make("epuck2", "raised", tmp_path / "out", f"DEFINES={CHECK}", apps=tmp_path), text)


@pytest.mark.parametrize(
    ("priority", "call"),
    [
        ("0x40", "Sys_Send_IntEvent(PRESSED, 3)"),
        pytest.param("0x40", "Sys_Sleep(1)", marks=pytest.mark.slow),
        pytest.param("0", "(void)Sys_Set_LED(0, true)", marks=pytest.mark.slow),
        pytest.param("0xF0", "Sys_Send_IntEvent(PRESSED, 3)", marks=pytest.mark.slow),
    ],
)
def test_a_call_at_a_wrong_priority_stops_the_system(tmp_path: Path, priority: str, call: str) -> None:
    """A call above the kernel's locks, or at the level of the slice, is reported with the number of the exception."""
    assert b"sent" not in said(tmp_path, priority, call, STOPPED)


@pytest.mark.parametrize("priority", ["0x50", pytest.param("0xE0", marks=pytest.mark.slow)])
def test_a_call_at_a_permitted_priority_passes(tmp_path: Path, priority: str) -> None:
    assert b"sent" in said(tmp_path, priority, "Sys_Send_IntEvent(PRESSED, 3)", rb"sent\n(.|\n)*on\n(.|\n)*on\n")


def test_the_check_costs_nothing_where_it_is_not_built(tmp_path: Path) -> None:
    image = make("epuck2", "smallest", tmp_path)
    assert "cpu_check_level" not in Symbols(image)
