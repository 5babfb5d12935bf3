"""Debugger on one Kilobot of a trial: the crowd pauses with it, and the record is that of an undebugged trial."""

from __future__ import annotations

import io
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from arena.campaign.campaign import Plan, run_one
from arena.cli import main
from arena.debug.controlled_robot import ControlledRobot
from arena.debug.trial_client import DebugSession
from arena.robots.images import image_for
from arena.scene.loader import scene_of
from tests.arena.debug.test_attach import attached_client
from tests.arena.debug.test_rewind import Debugger
from tests.arena.studio.test_studio import do, studio_of, wait_for_state
from tests.emu.avr.conftest import compiled, needs

HITS = 100
FAULTY = """
#include <avr/io.h>
volatile unsigned int rounds;
int main(void)
{
    DDRC = 8, PORTC = 0;
    for (;;) {
        __builtin_avr_delay_cycles(80000);
        if (++rounds == 5)
            __asm__ volatile (".word 0x9419");
    }
}
"""
Scene = dict[str, Any]


def crowd(image: str, count: int, **more: Any) -> Scene:
    """Return a scene with a row of Kilobots that hear their neighbours; a quantum has more inputs than a log holds."""
    group = {"kind": "kilobot", "image": image, "place": "poses", "poses": [[100 + 4 * n, 100] for n in range(count)]}
    return {"name": "crowd", "clock": {"quantum_ms": 20.0}, "robots": [group, *more.pop("robots", [])]} | more


def plan_of(scene: Scene, seconds: float, **images: Path) -> Plan:
    """Return a trial of programs of firmware/kilobot, and of other images."""
    needs("avr-gcc")
    names = {one["image"] for one in scene["robots"] if "image" in one}
    found = tuple((name, images.get(name) or image_for(name, kind="kilobot")) for name in sorted(names))
    return Plan(scene_of(scene), "own", "A", None, 1, seconds, 3, images=found)


def record(plan: Plan, folder: Path, controlled: ControlledRobot | None = None) -> bytes:
    """Run the trial, with a debugger if there is one, and return the bytes of its record."""
    folder.mkdir()
    run_one(plan, 1, folder, on_start=controlled.attach if controlled else None)
    return (folder / "trial-0001.parquet").read_bytes()


@pytest.mark.parametrize("count", [1, 5])
def test_breakpoints_change_no_robot(tmp_path: Path, count: int) -> None:
    """A hundred hits of a breakpoint, single steps, a watched range and a detachment leave the record as it is."""
    plan = plan_of(crowd("gradient", count), 2.0)
    hits: list[int] = []

    def debugger(controlled: ControlledRobot) -> bool:
        machine: Any = controlled.machine
        history = controlled.record(machine)
        assert (machine.pc, machine.cycle) == (0, 0)
        remove = machine.hook_pc(machine.program_address("set_color"), lambda: True)
        while len(hits) < HITS:
            stop = history.advance(machine.cycle + 3_000_000)
            hits.append(machine.cycle)
            assert stop is not None
            assert stop.reason == "breakpoint"
            for _ in range(len(hits) % 5):
                assert history.step() is None
        remove()
        with machine.watching(machine.image.symbols.find("kilo_ticks").address, 1):
            stop = history.advance(machine.cycle + 3_000_000)
        assert stop is not None
        assert stop.detail == "a watched byte has changed"
        return True

    controlled = ControlledRobot(count // 2, debugger, is_recorded=True)
    assert record(plan, tmp_path / "debugged", controlled) == record(plan, tmp_path / "alone")
    assert controlled.finish()
    assert len(set(hits)) == HITS


def test_the_past_is_that_of_the_crowd(tmp_path: Path) -> None:
    """The robot alone reaches the states that it had in its crowd: moving robots, messages, a lamp, an e-puck."""
    scene = crowd("orbit", 2, lamps=[{"x_cm": 90, "y_cm": 100, "counts": 300}],
                  robots=[{"place": "poses", "poses": [[100, 140]]}])  # fmt: skip
    scene["clock"]["quantum_ms"] = 1.0
    rng, is_equal = random.Random(4), []
    plan = plan_of(scene, 2.5)

    def debugger(controlled: ControlledRobot) -> bool:
        machine: Any = controlled.machine

        def state() -> tuple[Any, ...]:
            return machine.pc, machine.peek_bytes(0, 0x900), machine._machine.state.random

        history = controlled.record(machine)
        states = {}
        for _ in range(60):
            history.advance(machine.cycle + rng.randrange(400_000))
            for _ in range(rng.randrange(3)):
                history.step()
            states[machine.cycle] = state()
        end = history.end
        for cycle in rng.sample(sorted(states), 30):
            history.seek(cycle)
            is_equal.append((machine.cycle, state()) == (cycle, states[cycle]))
        assert history.step_back()
        history.seek(end)
        is_equal.append(state() == states[end])
        return True

    controlled = ControlledRobot(1, debugger, is_recorded=True)
    assert record(plan, tmp_path / "debugged", controlled) == record(plan, tmp_path / "alone")
    assert controlled.finish()
    assert is_equal == [True] * 31


def test_a_cycle_has_one_state(tmp_path: Path) -> None:
    """At one cycle, a robot is in the same whole state after a single step, a run, and a way back, while light comes
    and over the ends of quanta."""
    scene = crowd("gradient", 2, lamps=[{"x_cm": 99, "y_cm": 101, "counts": 300}])
    scene["clock"]["quantum_ms"] = 0.5
    plan, states, differing = plan_of(scene, 0.6), dict[int, tuple[str, bytes]](), list[tuple[str, int]]()

    def state(controlled: ControlledRobot) -> tuple[str, bytes]:
        """Return the time of the world, and the state of the robot."""
        return controlled.describe()[0][1], controlled._member.machine.comparable_state()

    def stepping(controlled: ControlledRobot) -> bool:
        machine: Any = controlled.machine
        history = controlled.record(machine)
        remove = machine.hook_pc(machine.program_address("__vector_23"), lambda: True)
        history.advance(machine.cycle + 4_000_000)
        remove()
        for _ in range(3000):
            history.step(machine.cycle + 200)
            states[machine.cycle] = state(controlled)
        end = history.end
        for cycle in [*random.Random(1).sample(sorted(states), 200), end]:
            history.seek(cycle)
            if state(controlled)[1] != states[cycle][1]:
                differing.append(("back", cycle))
        return True

    def jumping(controlled: ControlledRobot) -> bool:
        history = controlled.record(controlled.machine)
        for cycle in sorted(states):
            history.advance(cycle)
            if (controlled.machine.cycle, state(controlled)) != (cycle, states[cycle]):
                differing.append(("run", cycle))
        return True

    for number, debugger in enumerate((stepping, jumping)):
        controlled = ControlledRobot(1, debugger, is_recorded=True)
        record(plan, tmp_path / f"{number}", controlled)
        assert controlled.finish()
    assert len(states) > 2000
    assert not differing


def test_the_world_goes_back_with_a_kilobot(tmp_path: Path) -> None:
    """Breakpoint, call stack, values, `finish`, a rewind, and a change that a move to an earlier time undoes."""
    plan = plan_of(crowd("gradient", 3), 1.5)
    session = DebugSession(plan, 1, tmp_path, is_recorded=False)
    try:
        client = Debugger(session)
        client.ask("setFunctionBreakpoints", breakpoints=[{"name": "received"}])
        client.resume("continue", threadId=1)
        there, world = client.cycle, client.evaluate("/world")
        frames = client.ask("stackTrace", threadId=1)["stackFrames"]
        assert [one["name"] for one in frames][:3] == ["received", "take_frame", "__vector_23 <interrupt>"]
        assert client.evaluate("gradient") == "255"
        client.resume("stepOut", threadId=1)
        after = client.cycle
        client.resume("continue", threadId=1)
        assert client.cycle > after
        client.resume("reverseContinue", threadId=1)
        assert client.cycle == there
        assert client.evaluate("/world").splitlines()[0] == world.splitlines()[0]
        assert client.evaluate("heard = 7") == "7"
        client.resume("stepIn", threadId=1, granularity="instruction")
        assert client.evaluate("heard") == "7"
        client.resume("evaluate", expression=f"/goto {there - 100_000}", context="repl")
        assert client.evaluate("heard") == "255"
        client.resume("evaluate", expression=f"/goto {there}", context="repl")
        assert client.evaluate("heard") == "255", "the change was after that time"
    finally:
        session.close()


@pytest.fixture
def faulty(tmp_path: Path) -> Path:
    """Return an image that faults after 50 ms."""
    needs("avr-gcc")
    (tmp_path / "faulty.c").write_text(FAULTY)
    compiled(tmp_path / "faulty.c", tmp_path / "faulty.elf", "-Os", "-gdwarf-2")
    return tmp_path / "faulty.elf"


Play = Callable[..., tuple[int, str, str]]


@pytest.fixture
def play(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Play:
    """Return a function that runs `arena debug --tui` with a script; it returns status, output and errors."""

    def one(scene: str, *lines: str) -> tuple[int, str, str]:
        (tmp_path / "scene.toml").write_text(f'name = "faults"\n[clock]\nquantum_ms = 10\n{scene}')
        monkeypatch.setattr("sys.stdin", io.StringIO("\n".join(lines)))
        words = [str(tmp_path / "scene.toml"), "--minutes", "0.01", "--seed", "3"]
        status = main(["debug", *words, "--robot", "0", "--tui", "--out", str(tmp_path / "debugged")])
        printed = capsys.readouterr()
        assert main(["run", *words, "--trials", "1", "--jobs", "1", "--out", str(tmp_path / "alone")]) == 1
        records = [(tmp_path / name / "trial-0001.parquet").read_bytes() for name in ("debugged", "alone")]
        assert records[0] == records[1]
        return status, printed.out, printed.err

    return one


def test_a_fault_stops_the_debugger_and_the_robot(faulty: Path, play: Play) -> None:
    """A fault stops with its cause; a rewind works; then the robot stays halted and the others continue."""
    group = '[[robots]]\nkind = "kilobot"\nimage = "{}"\nplace = "poses"\nposes = [[{}, 100]]\n'
    status, output, error = play(group.format("faulty.elf", 100) + group.format("gradient", 105),
        "watch rounds if rounds == 4", "continue", "print rounds", "delete 1", "continue", "reverse-stepi",
        "print rounds", "continue", "continue", "time", "detach")  # fmt: skip
    assert status == 1
    assert output.count("firmware fault: illegal instruction 0x9419") == 2
    assert [line for line in output.splitlines() if line.startswith("rounds = ")] == ["rounds = 4", "rounds = 5"]
    assert "the trial is over" in output
    assert error.count("\n") == 1


def test_a_kilobot_of_the_studio(tmp_path: Path) -> None:
    """A debugger attaches to a Kilobot in the middle of a trial, looks into its past and detaches."""
    with studio_of(plan_of(crowd("gradient", 3), 4.0)) as studio:
        do(studio, "step", 40)
        client = attached_client(studio, 1)
        client.ask("setFunctionBreakpoints", breakpoints=[{"name": "set_color"}])
        client.send("continue", threadId=1)
        assert client.event("stopped")["reason"] == "breakpoint"
        assert client.top()["name"].startswith("set_color")
        client.send("stepBack", threadId=1, granularity="instruction")
        client.event("stopped")
        assert "go back to the present" in client.asked("evaluate", expression="heard = 1", context="repl")["message"]
        client.ask("disconnect")
        assert wait_for_state(studio)["debugger"] is None
        do(studio, "step", 10)
