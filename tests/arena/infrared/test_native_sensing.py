"""Native code handles infrared edges and begins quanta as Python does (light.c, ring.c, lockstep.c)."""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Callable
from ctypes import CFUNCTYPE, c_double, c_int64, c_void_p
from pathlib import Path
from typing import Any

import pytest

from arena.infrared.channel import OpticalChannel
from arena.infrared.ring import InfraredRing
from arena.lockstep.scheduler import LockStep
from arena.robots.firmware_controller import FirmwareController
from arena.scene.loader import Scene, load_scene
from arena.world.physics import World
from arena.world.poses import Poses
from emu.boards.epuck.analog import RESPONSE, Infrared, reflection_at
from emu.boards.epuck.board import Epuck
from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.jit.engine import JitEngine
from emu.machine.machine import Machine

QUANTA = 40
SCANNER = """
        .include "p30F6014A.inc"
        .bss
        .global _sum
_sum:   .space  2
        .text
        .global _main, __ADCInterrupt
_main:  mov     #0x00FF, w0
        mov     w0, ADPCFG
        mov     #0xFF00, w0
        mov     w0, ADCSSL
        mov     #{con2:#x}, w0          ; scan, interrupt after all results
        mov     w0, ADCON2
        mov     #{con3:#x}, w0
        mov     w0, ADCON3
        bclr    TRISF, #7
        bclr    TRISF, #8
        bclr    TRISG, #0
        bclr    TRISG, #1
        mov     #0x8000, w0             ; the port also has pins of a UART
        mov     w0, U1MODE
        bset    U1STA, #10
        bset    IEC0, #11
        mov     #{con1:#x}, w0
        mov     w0, ADCON1
        mov     #0x1234, w2
1:      mov     #0xB400, w3             ; the next number of a shift register
        lsr     w2, w2
        btsc    SR, #0
        xor     w2, w3, w2
        mov     #0x0180, w0             ; toggle some pulse lines, often two of a port at once
        and     w2, w0, w0
        xor     LATF
        and     w2, #3, w0
        mov     #LATG, w8
        xor     w0, [w8], [w8]
        mov     #{wait}, w0
        and     w2, w0, w0
        repeat  w0
        nop
        bra     1b
__ADCInterrupt:
        bclr    IFS0, #11
        mov     #ADCBUF0, w6
        mov     _sum, w7
        repeat  #15
        add     w7, [w6++], w7
        mov     w7, _sum
        retfie
"""

SELDOM = """
        .include "p30F6014A.inc"
        .bss
        .global _sum
_sum:   .space  2
        .text
        .global _main
_main:  mov     #0x00FF, w0
        mov     w0, ADPCFG
        mov     #0x1F3F, w0
        mov     w0, ADCON3
        mov     #0x80E0, w0             ; a conversion begins by software and ends by itself
        mov     w0, ADCON1
        mov     #0xFF00, w0
        mov     w0, TRISD
        bclr    TRISF, #7
        bset    LATF, #7
1:      mov     #8, w0                  ; sensors 0 and 4 in turn
        btg     w5, #2
        ior     w5, w0, w0
        mov     w0, ADCHS
        bset    ADCON1, #1
2:      btss    ADCON1, #0
        bra     2b
        mov     ADCBUF0, w0
        add     _sum
        bclr    ADCON1, #0
        mov     #6, w6                  ; 24 motor steps in 24 quanta until the next conversion
3:      mov     #0x5A, w1
        rcall   4f
        mov     #0x69, w1
        rcall   4f
        mov     #0xA5, w1
        rcall   4f
        mov     #0x96, w1
        rcall   4f
        dec     w6, w6
        bra     nz, 3b
        bra     1b
4:      mov     w1, LATD
        repeat  #14700
        nop
        return
"""


def test_native_reflections_equal_those_of_python() -> None:
    """The C function `reflect` gives the counts of `reflection_at` for all distances and shares."""
    board, draw = Machine(DSPIC30F6014A, board=Epuck).board, random.Random(1)
    _, reflect, record, ring = board.ir.native_handle()
    native = CFUNCTYPE(None, c_void_p, c_void_p, c_int64, c_double, c_double)(reflect)
    points = [near for near, _ in RESPONSE]
    beyond = [math.nextafter(near, math.inf) for near in points]
    for millimetres in (*points, *beyond, math.inf, *(draw.uniform(0, 110) for _ in range(500))):
        share = draw.random()
        native(record, ring, 3, millimetres, share)
        assert board.ir.reflection[3] == round(reflection_at(millimetres) * share)


def run(scene: Scene, image: Path, mode: str, monkeypatch: pytest.MonkeyPatch) -> tuple[list[Any], Counter[str]]:
    """Run three robots with an image in a mode: "stepwise", "Python" or "native".

    Return their states, and how often Python handled an edge or began a quantum.
    """
    calls, channel, world = Counter[str](), OpticalChannel.of(scene), World(scene, 1)

    def count(owner: type, name: str) -> None:
        function = getattr(owner, name)

        def counted(*arguments: Any) -> Any:
            calls[name] += 1
            return function(*arguments)

        monkeypatch.setattr(owner, name, counted)

    count(Infrared, "_switched")
    count(InfraredRing, "begin_quantum")
    robots = [FirmwareController(scene, 1, number, image, 0, channel) for number in range(scene.robots.count)]
    for robot in robots:
        assert isinstance(robot.machine.runner, JitEngine)
        robot.machine.runner.wait = True
    if mode == "stepwise":
        for robot in robots:
            robot.machine.board.ir.emit_in_python()
    lockstep = LockStep(world, robots, channel, is_native=mode == "native", threads=2) if mode != "stepwise" else None
    seen: list[Any] = []
    for until in range(20, QUANTA + 1, 20):
        if lockstep is not None:
            lockstep.advance(until)
        while world.ticks < until:
            world.step([robot.control_step(world.ticks, world.poses) for robot in robots])
        for robot in robots:
            machine = robot.machine
            machine.peripherals.adc.catch_up(machine.cycle)
            memory = bytes(machine.record.bytes[: machine.record.data_end])
            emitter = channel.emitter(robots.index(robot))
            latest = emitter._since(max(emitter.count - 100, 0))
            seen.append((until, machine.cycle, machine.pc, memory, robot.reading(), latest))
    monkeypatch.undo()
    return seen, calls


@pytest.mark.parametrize(("con1", "con2", "con3", "wait"), [
    (0x80E4, 0x041C, 0x1F13, 0x07FF),  # eight results in 4 ms: longer than a quantum
    (0x80E4, 0x0400, 0x1F3F, 0x1FFF),  # an interrupt after each result of 98 us, few edges
    pytest.param(0x80E4, 0x041C, 0x0201, 0x00FF, marks=pytest.mark.slow),  # a hundred edges in a quantum
    (0x80E4, 0x0000, 0x1F3F, 0x03FF),  # no scan
    (0x00E4, 0x0000, 0x1F3F, 0x03FF),  # no conversions, which would take in the waiting edges
])  # fmt: skip
def test_native_code_equals_python(
    con1: int, con2: int, con3: int, wait: int, assembled: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Robots that toggle their pulse lines at random have equal memories, readings and emitter histories, whether
    Python or native code handles edges and begins quanta. Native code does nearly all of this itself."""
    scene = load_scene("clustering").with_values(robots__count=3, objects__count=3, arena__width_cm=110.0,
                                                 arena__height_cm=90.0, infrared__lost_share=0.2)  # fmt: skip
    image = assembled(SCANNER.format(con1=con1, con2=con2, con3=con3, wait=wait))
    expected, in_python = run(scene, image, "stepwise", monkeypatch)
    assert len({seen[3] for seen in expected}) > len(expected) // 2
    for mode in ("Python", "native"):
        seen, calls = run(scene, image, mode, monkeypatch)
        assert seen == expected
    assert in_python["_switched"] > 100
    assert calls["_switched"] < 0.1 * in_python["_switched"]
    assert calls["begin_quantum"] < 0.5 * in_python["begin_quantum"]


@pytest.mark.slow
def test_rare_conversions_read_the_present_surfaces(
    assembled: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Robots that drive and read a sensor only every 24 quanta see what is near at that time. Between two readings
    native code begins the quanta."""
    scene = load_scene("clustering").with_values(
        robots__count=2, objects__count=0, infrared__side_rays=1, start__spread_tcy=1,
        start__robot_poses=[[5.0, 150, 17], [12.0, 150, 40]],
    )  # fmt: skip
    image = assembled(SELDOM)
    expected, in_python = run(scene, image, "stepwise", monkeypatch)
    for mode in ("Python", "native"):
        seen, calls = run(scene, image, mode, monkeypatch)
        assert [one[4].infrared for one in seen] == [one[4].infrared for one in expected]
        assert seen == expected
    assert expected[0][4].infrared != expected[-2][4].infrared
    assert calls["begin_quantum"] < 0.5 * in_python["begin_quantum"]


@pytest.mark.slow
def test_a_conversion_read_in_the_next_quantum_sampled_the_surfaces_of_its_own(
    assembled: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A conversion that samples in one quantum and is read in the next has the result of one that is computed in its
    own quantum, though no conversion of the quanta before it was computed."""
    scene = load_scene("clustering").with_values(
        robots__count=2, objects__count=0, start__spread_tcy=1,
        start__robot_poses=[[5.0, 150, 17], [12.0, 150, 40]],
    )  # fmt: skip
    polling, begins = "2:      btss    ADCON1, #0\n        bra     2b\n", "1:      mov "
    assert polling in SELDOM
    # The second conversion therefore samples before the end of quantum 24 and ends, by its event, after it.
    late = SELDOM.replace(begins, f"        repeat  #12700\n        nop\n{begins}")
    image = assembled(late.replace(polling, "        repeat  #1500\n        nop\n"))
    step = FirmwareController.control_step

    def computed_at_once(robot: FirmwareController, tick: int, poses: Poses) -> tuple[float, float]:
        speeds = step(robot, tick, poses)
        robot.machine.peripherals.adc.catch_up(robot.machine.cycle)
        return speeds

    late, _ = run(scene, image, "stepwise", monkeypatch)
    native, _ = run(scene, image, "native", monkeypatch)
    monkeypatch.setattr(FirmwareController, "control_step", computed_at_once)
    at_once, _ = run(scene, image, "stepwise", monkeypatch)
    assert late == at_once
    assert native == at_once
    assert at_once[0][4].infrared != at_once[-2][4].infrared
