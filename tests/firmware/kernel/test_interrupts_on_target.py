"""Application interrupts in C (openswarm_interrupt.h): they work, and violated rules break the build."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.firmware.conftest import Build
from tests.firmware.kernel.test_kernel_on_target import load, place

HEAD = """#include <openswarm.h>
#include <openswarm_interrupt.h>
#include <openswarm_io.h>
enum { PRESSED = SYS_FIRST_USER_EVENT };
volatile uint16 pressed __attribute__((used)), edges __attribute__((used)), seen __attribute__((used));
static void __attribute__((unused)) on_button(void) { pressed++; Sys_Send_IntEvent(PRESSED, pressed); }
static bool note(uint16 pid, uint16 event, sys_event_data *data)
{ (void)pid; (void)event; seen = data->value; return true; }
int main(void) {
    Sys_Init_Kernel();
    Sys_Register_Event(PRESSED);
    Sys_Subscribe_to_Event(PRESSED, 0, note, NULL);
    ENABLE
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
"""
ENABLE = "Sys_Enable_Interrupt(INT1); Sys_Enable_Interrupt(INT2);"


def source(tmp_path: Path, text: str, enable: str = ENABLE, devices: str = "") -> Path:
    """Return a folder with the application "own", which defines interrupts in C."""
    app = tmp_path / "own"
    app.mkdir()
    (app / "main.c").write_text(HEAD.replace("ENABLE", enable) + text)
    (app / "app.mk").write_text(f"DEVICES := {devices}\n")
    return tmp_path


@pytest.mark.slow
def test_functions_in_c_run_at_their_levels_on_the_kernel_stack(image: Build, tmp_path: Path) -> None:
    """Interrupt functions in C run at their levels on the kernel stack.

    INT2 at level 6 raises INT1 at level 4, which sends an event, at each of 100 instants.
    """
    machine = load(
        image(
            "own",
            source(
                tmp_path,
                """static void on_edge(void) { edges++; Sys_Raise_Interrupt(INT1); }
SYS_INTERRUPT(INT1, 4, on_button)
SYS_INTERRUPT(INT2, 6, on_edge)
""",
            ),
        )
    )
    levels: dict[str, set[int]] = {"INT1": set(), "INT2": set()}
    stacks: set[bool] = set()
    end = machine.address_of("os_memory") + 224  # HAL_KERNEL_STACK

    def look(vector: str) -> None:
        levels[vector].add(machine.peek("SR") >> 5 & 7)
        stacks.add(machine.address_of("os_memory") <= machine.w[15] < end)

    for vector in levels:
        machine.hook_pc(place(machine, f"sys_isr_{vector}"), lambda vector=vector: look(vector))
    machine.run(cycles=20_000)
    for moment in range(100):
        machine.write("IFS1", machine.peek("IFS1") | 1 << 7)  # INT2IF
        machine.run(cycles=3_000 + moment)
    assert levels == {"INT1": {4}, "INT2": {6}}
    assert stacks == {True}
    assert [machine.peek(n) for n in ("edges", "pressed", "seen")] == [100] * 3


REFUSED = {
    "level 3": ("SYS_INTERRUPT(INT1, 3, on_button)\n", "", "sys_level_of_INT1_is_4_5_or_6"),
    "level 7": ("SYS_INTERRUPT(INT1, 7, on_button)\n", "", "sys_level_of_INT1_is_4_5_or_6"),
    "a vector that does not exist": ("SYS_INTERRUPT(INT9, 4, on_button)\n", "", "_INT9I"),
    "a vector of the kernel": ("SYS_INTERRUPT(T1, 4, on_button)\n", "", "__T1Interrupt"),
    "a vector of a driver": ("SYS_INTERRUPT(MI2C, 4, on_button)\n", "i2c", "MI2C"),
    "a vector twice": ("SYS_INTERRUPT(INT1, 4, on_button)\nSYS_INTERRUPT(INT1, 5, on_button)\n", "", "INT1"),
    "the kernel from level 5": ("SYS_INTERRUPT(INT1, 5, on_button)\n", "", "INT1.*level 5 may not call the kernel"),
    "a device from level 6": (
        "static void light(void) { Sys_Toggle_LED(2); }\nSYS_INTERRUPT(INT1, 6, light)\n",
        "",
        "level 6 may not call the kernel or a device",
    ),
    "the kernel, behind another function": (
        "static __attribute__((noinline)) void deeper(void) { edges++; Sys_Yield(); }\n"
        "static void on_edge(void) { deeper(); edges++; }\nSYS_INTERRUPT(INT1, 5, on_edge)\n",
        "",
        "INT1 -> deeper -> Sys_Yield: level 5",
    ),
    "a pointer from level 5": (
        "void (*volatile wherever)(void) = on_button;\nstatic void jump(void) { wherever(); edges++; }\n"
        "SYS_INTERRUPT(INT1, 5, jump)\n",
        "",
        "calls through a pointer",
    ),
    "the camera's level": (
        "static void on_edge(void) { edges++; }\nSYS_INTERRUPT(INT1, 6, on_edge)\n",
        "camera i2c",
        "belongs to the camera",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("rule", REFUSED)
def test_a_broken_rule_breaks_the_build(image: Build, tmp_path: Path, rule: str) -> None:
    """Each violated rule of openswarm_interrupt.h fails the build in the compiler, the linker or interrupts.py."""
    text, devices, message = REFUSED[rule]
    start = "extern bool Sys_Start_Camera(void); Sys_Start_Camera();" if "camera" in devices else ""
    with pytest.raises(AssertionError, match=message):
        image("own", source(tmp_path, text, start, devices), f"CASE={rule}")
