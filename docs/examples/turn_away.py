"""Random walk that turns away from near surfaces, for `arena run --controller docs/examples/turn_away.py`."""

PERIOD_S = 0.2
"""Time between two steps in s."""
NEAR = 0.05
"""Reflection above which the robot turns."""


class Controller:
    """Controller of one robot. `rng` is a numpy generator that depends on the seed and the robot."""

    def __init__(self, robot, rng):
        self.robot = robot
        self.rng = rng

    def step(self, senses):
        """Return the speeds of the left and the right wheel in cm/s."""
        if max(senses.proximity[:2] + senses.proximity[6:]) > NEAR:
            return 6.0, -6.0
        bias = self.rng.uniform(-2, 2)
        return 8.0 + bias, 8.0 - bias
