"""Application interrupts in C (openswarm_interrupt.h): they work, and violated rules break the build."""

from __future__ import annotations

import re
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
    "by the compiler": (
        "SYS_INTERRUPT(INT1, 3, on_button)\nSYS_INTERRUPT(INT2, 7, on_button)\nSYS_INTERRUPT(INT9, 4, on_button)\n"
        "SYS_INTERRUPT(INT3, 4, on_button)\nSYS_INTERRUPT(INT3, 5, on_button)\n",
        "",
        ["sys_level_of_INT1_is_4_5_or_6", "sys_level_of_INT2_is_4_5_or_6", "_INT9I", "redefinition of 'sys_isr_INT3'"],
    ),
    "by the linker, a vector of the kernel": ("SYS_INTERRUPT(T1, 4, on_button)\n", "", ["__T1Interrupt"]),
    "by the linker, a vector of a driver": ("SYS_INTERRUPT(MI2C, 4, on_button)\n", "i2c", ["symbol 'sys_isr_MI2C'"]),
    "by the linker, code of a lower level": (
        "static void light(void) { Sys_Toggle_LED(2); }\n"
        "static __attribute__((noinline)) void deeper(void) { edges++; Sys_Yield(); }\n"
        "static void on_edge(void) { deeper(); edges++; }\n"
        "void (*volatile wherever)(void) = on_button;\nstatic void jump(void) { wherever(); edges++; }\n"
        "SYS_INTERRUPT(INT1, 5, on_button)\nSYS_INTERRUPT(INT2, 6, light)\n"
        "SYS_INTERRUPT(INT3, 5, on_edge)\nSYS_INTERRUPT(INT4, 5, jump)\n",
        "",
        [
            "INT1 -> .*: level 5 may not run firmware/openswarm/kernel/event.c:.*, whose highest level is 4",
            "INT2 -> .*: level 6 may not run firmware/openswarm/",
            "INT3 -> .*deeper -> Sys_Yield: level 5",
            "INT4 -> .*: level 5 calls through a pointer",
        ],
    ),
    "by the linker, the level of the camera": (
        "static void on_edge(void) { edges++; }\nSYS_INTERRUPT(INT1, 6, on_edge)\n",
        "camera i2c",
        ["INT1: level 6 belongs to T4 and T5"],
    ),
}
"""Source, drivers and messages of each violated rule, by the program that refuses it."""


@pytest.mark.slow
@pytest.mark.parametrize("rules", REFUSED)
def test_a_broken_rule_breaks_the_build(image: Build, tmp_path: Path, rules: str) -> None:
    """Each violated rule of openswarm_interrupt.h fails the build, in the compiler or the linker."""
    text, devices, messages = REFUSED[rules]
    start = "extern bool Sys_Start_Camera(void); Sys_Start_Camera();" if "camera" in devices else ""
    with pytest.raises(AssertionError) as refused:
        image("own", source(tmp_path, text, start, devices), f"CASE={rules}")
    said = str(refused.value)
    assert [message for message in messages if not re.search(message, said)] == [], said


POINTER = """typedef void (*on_press)(void);
static void quiet(void) { edges++; }
volatile on_press wherever = quiet;
static void jump(void) { CALL_TARGETS(GOALS); wherever(); edges++; }
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("target", "refused"),
    [("quiet", None), ("quiet, calls_on_button", "calls_on_button"), ("on_press", "calls_on_button")],
)
def test_the_level_check_follows_pointers_by_their_annotation(
    image: Build, tmp_path: Path, target: str, refused: str | None
) -> None:
    """A pointer call of a high level passes if no annotated target calls the kernel; a type means its functions.

    SYS_INTERRUPT is in a header outside the application's folder.
    """
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared" / "own.h").write_text("SYS_INTERRUPT(INT1, 5, jump)\n")
    other = (
        "static void calls_on_button(void) { on_button(); }\n"
        "on_press volatile other __attribute__((used)) = calls_on_button;\n"
    )
    text = POINTER.replace("GOALS", target) + (other if refused else "")
    folder = source(tmp_path, text + '#include "../shared/own.h"\n', "Sys_Enable_Interrupt(INT1);")
    if refused is None:
        assert image("own", folder, "CASE=pointers").exists()
        return
    with pytest.raises(AssertionError, match=rf"INT1 -> .*{refused}.*: level 5 may not run"):
        image("own", folder, f"CASE={target}")
