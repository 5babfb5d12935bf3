"""Listing 1 of the paper: its text compiles, and its robot reacts to the camera (firmware/apps/listing1/README.md)."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from arena.robots.firmware_controller import FirmwareController
from arena.scene.loader import load_scene
from arena.world.physics import World
from tests.firmware.conftest import Build
from tests.firmware.drivers.test_drivers_on_target import SCENES, plain, robot
from tests.firmware.kernel.test_kernel_on_target import load, place

FCY = 14_745_600
ONE_PIXEL = 0x04
"""Event identifier SYS_IO_1PXSENSOR, the one-pixel line-of-sight sensor."""

MISSING = """#include <openswarm_compat.h>
#include <stdio.h>
#define ROBOT_SPEED_L 114
#define ROBOT_SPEED_R 68
#define OBJECT_SPEED_L 126
#define OBJECT_SPEED_R 64
#define NOTHING_SPEED_L 70
#define NOTHING_SPEED_R 127
"""
"""Declarations that the listing uses without defining them."""

PRINTED = r"""
void loggingThread();
bool wait250times(sys_event_data *data); /* corrected: void wait250time */
bool object_clustering(uint16 pid, uint16 eventID, sys_event_data *data);

int main(void)
{
    Sys_Init_Kernel();
    Sys_Subscribe_to_Event(SYS_IO_1PXSENSOR, 0, object_clustering, 0);
    System_Start_Process(loggingThread);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
}

bool wait250times(sys_event_data *data) /* corrected: void */
{
    static uint16 counter = 0;
    if (counter++ < 250) return false;
    counter = 0;
    return true;
}

void loggingThread()
{
    char message[24];
    while (true) {
        sprintf(message, "\%u:(\%u,\%u)\r\n", Sys_Get_SystemTime(),
            Sys_Get_MotorSpeed_Left(), Sys_Get_MotorSpeed_Right());
        Sys_Send_Event(SYS_SEND_UART1, message, 24);
        Sys_event_data *data = Sys_Wait_for_Condition(SYS_1ms_TIMER, wait250times); /* corrected: without the * */
        Sys_Clear_EventData(&data);
    }
}

bool object_clustering(uint16 pid, uint16 eventID, sys_event_data *data)
{
    switch (data->value) {
    case GREEN:
        Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, ROBOT_SPEED_L);
        Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, ROBOT_SPEED_R);
        break;
    case RED:
        Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, OBJECT_SPEED_L);
        Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, OBJECT_SPEED_R);
        break;
    case WHITE:
        Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, NOTHING_SPEED_L);
        Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, NOTHING_SPEED_R);
        break;
    }
}
"""
"""Text of the listing in its original order, with its original names and known misprints."""

ALONE = load_scene("clustering").with_values(robots__count=1, robots__wheel_noise=0.0)


@pytest.mark.slow
def test_the_listing_with_two_corrections_compiles(image: Build, tmp_path: Path) -> None:
    """With two corrections the listing compiles, although with warnings; the headers declare every name it uses."""
    app = tmp_path / "printed"
    app.mkdir()
    (app / "main.c").write_text(MISSING + PRINTED)
    path = image(
        "printed", tmp_path, "DEFINES=-Wno-error -DSYS_DEFAULT_STACK=320 -DSYS_1PXSENSOR=1", "DEVICES=camera i2c"
    )
    machine = robot(path)
    machine.board.camera.show(plain(SCENES["object"]))
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _cycle: said.append(byte)
    machine.run(cycles=FCY // 2)
    assert said[:10] == b"0:(0,0)\r\n\0", "24 bytes whatever the length"
    assert said[24:].startswith(b"0:(251,126)\r\n\0"), "251st call; %u for 32 bits shifts what follows"
    assert (machine.peek("speeds"), machine.peek(machine.address_of("speeds") + 2)) == (126, 64)


def test_the_system_registers_the_one_pixel_sensor(image: Build) -> None:
    """The system registers the event of the one-pixel sensor even without a camera.

    Applications that do not use the event do not link the camera driver.
    """
    for app, registered in (("listing1", True), ("hello", False)):
        machine = load(image(app))
        machine.run(cycles=FCY // 20)
        found: set[int] = set()
        for bucket in range(8):
            event = machine.peek(machine.address_of("events") + 2 * bucket)
            while event:
                found.add(machine.peek(event))
                event = machine.peek(event + 2)
        assert (ONE_PIXEL in found) is registered, app


@pytest.mark.parametrize(("scene", "speeds"), [("nothing", (70, 127)), ("object", (126, 64)), ("robot", (114, 68))])
def test_the_controller_drives_as_its_table_says(image: Build, scene: str, speeds: tuple[int, int]) -> None:
    """The controller sets the wheel speeds of its table, in percent of 129 mm/s, and logs the same values.

    Source: openswarm-original.md §8.
    """
    machine = robot(image("listing1"))
    machine.board.camera.show(plain(SCENES[scene]))
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _cycle: said.append(byte)
    machine.run(cycles=FCY)
    assert said.decode().splitlines()[-1].endswith(":({},{})".format(*speeds))


@pytest.mark.parametrize(("objects", "turn"), [([], 1), ([(240.0, 150.0)], -1)], ids=["nothing", "object"])
def test_in_the_arena_its_robot_turns_at_an_object(image: Build, objects: list[tuple[float, float]], turn: int) -> None:
    """The robot drives a curve to the left; if an object is ahead, it turns right (paper §IV)."""
    scene = ALONE.with_values(objects__count=len(objects))
    controller = FirmwareController(scene, 1, 0, image("listing1"), 0)
    world = World.of(scene, 1, [(200.0, 150.0, 0.0)], objects)
    angles = []
    for tick in range(1000):
        world.step([controller.control_step(tick, world.poses)])
        angles.append(world.poses.robots[0][2])
    moved = math.hypot(world.poses.robots[0][0] - 200, world.poses.robots[0][1] - 150)
    assert moved > 2
    turned = min(angles) if turn < 0 else max(angles)
    assert turned * turn > 0.1, "radians"
    assert place(controller.machine, "object_clustering")
