"""Robots of a trial in other processes: same bytes, same errors."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from arena.cli import main
from arena.infrared.channel import Ether, Switch
from arena.lockstep.processes import Crew, packed, unpacked
from arena.robots.controller import Brain, Lights, Line, Reading
from arena.world.physics import Poses

LENGTH = st.floats(-1e6, 1e6)
WORD = st.integers(-(1 << 63), (1 << 63) - 1)


class Echo:
    """Answers what it was asked, and blinks."""

    def __init__(self, robot: int, ether: Ether | None) -> None:
        self._robot = robot
        self._ether = ether
        self._heard: list[int] = []

    def think(self, tick: int, poses: Poses) -> tuple[float, float]:
        """Own x, and what it sees of robot 0."""
        if tick == 3:
            raise ValueError(f"robot {self._robot} has had enough")
        assert self._ether is not None
        seen = self._ether.shares(0, 1000 * tick + 1000)[3]
        self._ether.switch(self._robot, 1000 * tick, self._robot, lit=True)
        return poses.robots[self._robot][0], seen

    def reading(self) -> Reading:
        """Its number as load."""
        return Reading(load=float(self._robot))

    def lines(self) -> list[Line]:
        """One."""
        return [Line(self._robot, "hello")]

    def lights(self) -> list[Lights]:
        """None."""
        return []

    def close(self) -> None:
        """Nothing to give back."""


def echoes(robots: Sequence[int], ether: Ether | None) -> list[Brain]:
    """Brains for a crew."""
    return [Echo(robot, ether) for robot in robots]


def nobody(reason: str, robots: Sequence[int], ether: Ether | None) -> list[Brain]:
    """Brains that cannot be made."""
    raise FileNotFoundError(reason)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # a busy machine is no failure
@given(WORD, st.lists(st.tuples(LENGTH, LENGTH, LENGTH)), st.lists(st.tuples(LENGTH, LENGTH)),
       st.lists(st.builds(Switch, WORD, WORD, WORD, WORD)))  # fmt: skip
def test_a_quantum_survives_its_message(
    tick: int, robots: list[tuple[float, float, float]], objects: list[tuple[float, float]], switches: list[Switch]
) -> None:
    """To the bit, or a trial would depend on the number of processes."""
    again, poses, heard = unpacked(packed(tick, Poses(robots, objects), switches))
    assert (again, poses.robots, poses.objects, heard) == (tick, robots, objects, switches)


def test_a_crew_answers_records_and_hears() -> None:
    """Speeds in order, what is recorded, and switches in both directions."""
    ether = Ether(3, 1000, tau=1.0)
    crew = Crew(echoes, (1, 2), ether)
    poses = Poses([(1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (3.0, 0.0, 0.0)], [])
    try:
        first, second = crew.brains
        ether.switch(0, -50, 3, lit=True)
        crew.begin(0, poses, ether.take())
        assert [first.think(0, poses), second.think(0, poses)] == [(2.0, 0.0), (3.0, 0.0)]
        assert ether.take() == [Switch(1, 0, 1, 1), Switch(2, 0, 2, 1)]
        crew.begin(1, poses, [])
        assert first.think(1, poses) == (2.0, 1.0)
        assert [(one.reading().load, one.lines()) for one in (first, second)] == [
            (1.0, [Line(1, "hello")]), (2.0, [Line(2, "hello")])]  # fmt: skip
        crew.begin(3, poses, [])
        with pytest.raises(ValueError, match="robot 1 has had enough"):
            first.think(3, poses)
    finally:
        crew.close()


def test_what_cannot_be_made_there_is_an_error_here() -> None:
    """A missing image, for example."""
    with pytest.raises(FileNotFoundError, match=r"no\.elf"):
        Crew(partial(nobody, "no.elf"), (0,), None)


@pytest.mark.parametrize(("image", "seconds"), [("talking_image", 1.2), ("clustering_image", 2.5)])
def test_a_trial_is_the_same_in_one_two_and_three_processes(
    image: str, seconds: float, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """Issue "Must show" 5, for one trial whose robots are spread."""
    files = []
    for jobs in ("1", "2", "3"):
        main(["run", "clustering", "--brain", str(request.getfixturevalue(image)), "--robots", "3", "--trials", "1",
              "--minutes", str(seconds / 60), "--processes", jobs, "--out", str(tmp_path / jobs)])  # fmt: skip
        files.append((tmp_path / jobs / "trial-0001.parquet").read_bytes())
    assert files[0] == files[1] == files[2]
