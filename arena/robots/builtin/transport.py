"""Occlusion-based cooperative transport, after Chen et al., IEEE Transactions on Robotics 31 (2015).

A robot pushes the object only where the object hides the goal from it. It searches the object (red), drives to it, and
turns once on the spot beside it. If it sees the goal (green) meanwhile, it moves on around the object and looks again;
otherwise it pushes for some seconds. No robot knows a position or communicates. The states are the publication's; their
thresholds and times are this project's.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

    from arena.robots.senses import Senses

    State = Callable[[Senses, float], tuple[float, float]]

PERIOD_S = 0.1
OBJECT, GOAL = 1, 2
"""Answers of the line-of-sight sensor: red, and green."""
FAST, SLOW, TURN = 12.0, 6.0, 4.0
"""Wheel speeds in cm/s: ahead, along the object, on the spot."""
TOUCH: Final = 0.08
"""Reflection in front from which a robot is at a body: about 1 cm from a red object."""
NEAR: Final = 0.03
"""Reflection from which a body counts as near."""
ROUND_S: Final = 2 * math.pi * 5.1 / 2 / TURN * 1.1
"""Time of a full turn on the spot, with a tenth in reserve for noise of the wheels."""
PUSH_S, PASS_S, LOST_S = 8.0, 4.0, 1.5
"""Times to push, to follow the edge of the object, and after which an object out of sight counts as lost."""


class Controller:
    """Controller of one robot: a state, and the time since it began."""

    def __init__(self, robot: int, rng: np.random.Generator) -> None:
        self._rng: Final = rng
        self._since = 0.0
        self._state: State = self._search
        self._side = 1.0 if rng.random() < 0.5 else -1.0
        self._seen_at = -math.inf
        self._bias = 0.0

    def step(self, senses: Senses) -> tuple[float, float]:
        """Return the wheel speeds in cm/s."""
        before = self._state
        left, right = self._state(senses, senses.seconds - self._since)
        if self._state != before:
            self._since = senses.seconds
        return left, right

    def _search(self, senses: Senses, elapsed: float) -> tuple[float, float]:
        """Look around once, then drive on a random arc, away from bodies, until the object is in sight."""
        if senses.seen == OBJECT:
            self._seen_at = senses.seconds
            self._state = self._approach
            return FAST, FAST
        if elapsed < ROUND_S:
            return -TURN * self._side, TURN * self._side
        if elapsed > ROUND_S + 6.0:
            self._since = senses.seconds
            self._bias = float(self._rng.uniform(-2, 2))
        return self._avoid(senses, FAST + self._bias, FAST - self._bias)

    def _approach(self, senses: Senses, elapsed: float) -> tuple[float, float]:
        """Drive to the object; turn to and fro if it is out of sight."""
        front = max(senses.proximity[0], senses.proximity[7])
        if senses.seen == OBJECT:
            self._seen_at = senses.seconds
            if front > TOUCH:
                self._state = self._turn_once
                return 0.0, 0.0
            return FAST, FAST
        lost = senses.seconds - self._seen_at
        if lost > 2 * LOST_S or elapsed > 60:
            self._side = -self._side
            self._state = self._search
            return 0.0, 0.0
        if front > TOUCH:
            self._side = 1.0 if self._rng.random() < 0.5 else -1.0
            self._state = self._leave
            return 0.0, 0.0
        turn = TURN / 2 * (1 if lost < LOST_S / 2 else -1) * self._side
        return turn, -turn

    def _leave(self, senses: Senses, elapsed: float) -> tuple[float, float]:
        """Turn away from a body that is not the object, and drive on."""
        if elapsed < 0.8:
            return TURN * self._side, -TURN * self._side
        if elapsed < 2.5:
            return self._avoid(senses, FAST, FAST)
        self._state = self._search
        return 0.0, 0.0

    def _turn_once(self, senses: Senses, elapsed: float) -> tuple[float, float]:
        """Turn once on the spot: move on if the goal is in sight, else push."""
        if senses.seen == GOAL:
            self._state = self._pass
        elif elapsed >= ROUND_S:
            self._seen_at = senses.seconds
            self._state = self._push
        return -TURN, TURN

    def _push(self, senses: Senses, elapsed: float) -> tuple[float, float]:
        """Push, and keep the object straight ahead."""
        near = senses.proximity
        if senses.seen == OBJECT or max(near[0], near[7]) > NEAR:
            self._seen_at = senses.seconds
        if senses.seen == GOAL or elapsed > PUSH_S:
            self._state = self._turn_once
        elif senses.seconds - self._seen_at > LOST_S:
            self._state = self._search
        steer = 10.0 * max(-0.3, min(near[0] + near[1] - near[7] - near[6], 0.3))
        return FAST + steer, FAST - steer

    def _pass(self, senses: Senses, elapsed: float) -> tuple[float, float]:
        """Follow the edge of the object, which is on the right."""
        near = senses.proximity
        if elapsed > PASS_S:
            self._side = -1.0  # the object is on the right
            self._seen_at = senses.seconds
            self._state = self._search
            return 0.0, 0.0
        if max(near[0], near[7], near[6]) > NEAR:
            return -TURN, TURN
        steer = 25.0 * max(-0.1, min(near[2] + near[1] - 0.05, 0.1))
        return SLOW * 1.3 - steer, SLOW * 1.3 + steer

    def _avoid(self, senses: Senses, left: float, right: float) -> tuple[float, float]:
        """Return speeds that turn away from a body ahead."""
        near = senses.proximity
        if max(near[0], near[1], near[6], near[7]) < NEAR:
            return left, right
        turn = TURN if near[6] + near[7] > near[0] + near[1] else -TURN
        return turn, -turn
