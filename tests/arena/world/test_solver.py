"""The solver that omits calls without effect gives the numbers of the library's own loop, to the bit."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import CFUNCTYPE, c_void_p, cast

import numpy as np
import pymunk
import pytest

from arena.scene.loader import Scene, load_scene
from arena.world import solver
from arena.world.physics import ITERATIONS, World
from arena.world.wheels import ROOM

QUANTA = 1000


def poses(world: World, seed: int) -> np.ndarray:
    """Return the poses in all quanta of a run of robots that drive, turn and stop at random, 250 quanta each."""
    generator = np.random.default_rng(seed)
    count = len(world.robots)
    speeds = np.zeros((count, ROOM, 2))
    addresses = np.array([one.ctypes.data for one in speeds], dtype=np.uint64)
    for first in range(0, QUANTA, 250):
        drawn = generator.uniform(-12.8, 12.8, (count, 2)) * (generator.random((count, 1)) < 0.7)
        drawn[::2] = 12.8, 12.8
        speeds[:, first : first + 250] = drawn[:, None]
    blocks = world.run_quanta(addresses.ctypes.data, ROOM, QUANTA)
    return np.vstack([one.sheet[one.row : one.row + one.last - one.first + 1] for one in blocks])


def crowd() -> World:
    """Return a world in which robots push objects in a row, each other, and a wall."""
    scene = load_scene("clustering").with_values(robots__count=4, objects__count=8)
    row = [(40.0 + 9.9 * number, 40.0) for number in range(5)]
    return World.of(scene, 1, [(30, 40, 0), (90, 80, 3.1), (82, 80, 0), (12, 12, 4.0)],
                    [*row, (90, 91), (100, 85), (200, 200)])  # fmt: skip


def box() -> World:
    """Return a world in which robots push a box at two of its corners."""
    scene: Scene = load_scene("chen2015").with_values(robots__count=3, objects__mass_kg=0.1)
    return World.of(scene, 1, [(100, 100, 0), (100, 118, 0), (140, 60, 1.6)], [(125, 112, 0.2)])


@pytest.mark.parametrize("made", [crowd, box])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_every_pose_is_that_of_the_library_alone(
    made: Callable[[], World], seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pushes, stops and turns give equal bits in every quantum; bodies move and touch."""
    own = poses(made(), seed)
    monkeypatch.setattr(solver, "is_usable", lambda: False)
    plain = made()
    assert plain.space.iterations == ITERATIONS
    theirs = poses(plain, seed)
    assert own.tobytes() == theirs.tobytes()
    objects = slice(3 * len(plain.robots), None)
    assert np.abs(own[-1, objects] - own[0, objects]).max() > 1


def test_without_memory_for_contacts_every_call_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """Joints and contacts beyond the solver's room are called in every iteration, with equal results."""
    own = poses(crowd(), 1)
    monkeypatch.setattr(solver, "CONTACTS_PER_BODY", -2)
    assert poses(crowd(), 1).tobytes() == own.tobytes()


def test_a_contact_without_effect_is_called_once() -> None:
    """Of two objects that touch at rest, the contact is applied in the first iteration only; that of a robot that
    pushes an object is applied in most."""
    scene = load_scene("clustering").with_values(robots__count=1, objects__count=2)
    calls: list[int] = []

    def count(world: World) -> list[int]:
        real = CFUNCTYPE(None, c_void_p)(world._solver._struct.apply_arbiter)
        counted = CFUNCTYPE(None, c_void_p)(lambda arbiter: (calls.append(arbiter), real(arbiter))[1])
        world._solver._struct.apply_arbiter = cast(counted, c_void_p).value
        calls.clear()
        world.step([(12.8, 12.8)])
        return [calls.count(one) for one in set(calls)]

    diameter = 2 * scene.kind_of(0).radius_cm
    resting = World.of(scene, 1, [(200, 200, 0)], [(50, 50), (50 + diameter - 0.005, 50)])
    assert count(resting) == [1]
    pushing = World.of(scene, 1, [(50, 50, 0)], [(50 + 3.7 + diameter / 2 - 0.005, 50), (200, 200)])
    pushing.step([(12.8, 12.8)])
    assert min(count(pushing)) > ITERATIONS / 2


def test_the_solver_knows_the_installed_library() -> None:
    """A failure means that pymunk has another Chipmunk, with which trials take longer: compare its chipmunk_structs.h
    with solver.c, then add the version to KNOWN_LIBRARIES."""
    assert pymunk.chipmunk_version in solver.KNOWN_LIBRARIES
    assert solver.is_usable()
