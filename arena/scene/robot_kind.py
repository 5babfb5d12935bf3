"""The interface of a kind of robot: its body, its drive, how its robots differ, and the engine of its controllers.

Scenes, placement, physics, cameras, infrared light, trials and replays take everything that depends on the kind from
here. `KINDS` has the kinds by name; an entry is all that a new kind needs. Lengths cm, masses kg.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from arena.scene import dimensions
from arena.scene.schema import Kilobots, Robots


class Traits(NamedTuple):
    """Deviations of one robot from the nominal one.

    `yaw` and `pitch_deg` turn its camera to the left and up. `bias` are factors on the commanded values of its left and
    right wheel or motor.
    """

    yaw: float = 0.0
    pitch_deg: float = 0.0
    bias: tuple[float, float] = (1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Drive:
    """Drive of a body, which two commanded values control: left and right.

    With an `axle_cm` they are speeds of wheels in cm/s. Without one they are values of two vibration motors. Both move
    the body ahead by `ahead` cm/s per unit of the smaller value. The excess of the larger value turns the body by
    `turn` rad/s per unit about a leg on the other side, `leg_back_cm` behind and `leg_aside_cm` beside the centre.
    """

    thrust_n: float
    """Greatest force on the body while it is driven, N; inf: the body follows without slip."""
    brake_n: float
    """Force that pushes a body at rest, N."""
    lever_cm: float
    """Lever of both forces for turning."""
    noise: float = 0.0
    """Noise of the drive: factors from 1 - noise to 1 + noise, drawn again every `noise_period_s`."""
    axle_cm: float = 0.0
    ahead: float = 0.0
    turn: float = 0.0
    leg_back_cm: float = 0.0
    leg_aside_cm: float = 0.0


@dataclass(frozen=True)
class RobotKind:
    """One kind of robot. `table` names the table of a scene with its settings, the argument of `drive` and `traits`."""

    name: str
    table: str
    radius_cm: float
    mass_kg: float
    height_cm: float
    drive: Callable[[Any], Drive]
    traits: Callable[[Any, Sequence[float]], Traits]
    """Traits of a robot from four numbers with the standard normal distribution."""
    engine: str
    """`module:function` that makes the controllers of all robots of the kind in a trial, with the parameters of
    `arena.robots.epuck.controllers`. It is loaded when a trial begins: a scene is read without an emulator."""
    has_camera: bool = False

    def controllers(self, *arguments: Any) -> Sequence[Any]:
        """Return the controllers of some robots, made by the engine."""
        module, _, function = self.engine.partition(":")
        made: Sequence[Any] = getattr(importlib.import_module(module), function)(*arguments)
        return made


def _wheels(setting: Robots) -> Drive:
    return Drive(setting.thrust_n, setting.brake_n, setting.axle_cm / 2, setting.wheel_noise, setting.axle_cm)


def _epuck_traits(setting: Robots, drawn: Sequence[float]) -> Traits:
    yaw, pitch, left, right = drawn
    bias = (1.0 + setting.wheel_bias_sd * left, 1.0 + setting.wheel_bias_sd * right)
    return Traits(math.radians(setting.camera_yaw_sd_deg * yaw), setting.camera_pitch_sd_deg * pitch, bias)


EPUCK: Final = RobotKind("epuck", "robots", dimensions.ROBOT_RADIUS, dimensions.ROBOT_MASS, dimensions.ROBOT_HEIGHT,
                         _wheels, _epuck_traits, "arena.robots.epuck:controllers", has_camera=True)  # fmt: skip
TURN_DUTY, STRAIGHT_DUTY = 70, 65
"""Calibrated duties of a nominal Kilobot's motors, of 255, for turning and for straight motion (kilobot.md §1)."""
LEG_BACK_CM, LEG_ASIDE_CM = 0.9, 1.3
"""Distances of a Kilobot's rear legs behind and beside its centre (kilobot.md §1)."""
LEAST_STRENGTH: Final = 0.3


def motor_strengths(setting: Kilobots, drawn: Sequence[float]) -> tuple[float, float]:
    """Return the strength of a Kilobot's left and right motor as a share of the nominal one."""
    left, right = (max(1.0 + setting.motor_sd * one, LEAST_STRENGTH) for one in drawn[:2])
    return left, right


def _vibration(setting: Kilobots) -> Drive:
    turn = math.radians(setting.turn_deg_s) / TURN_DUTY
    return Drive(setting.thrust_n, setting.brake_n, LEG_ASIDE_CM, setting.motion_noise, 0.0,
                 setting.speed_cm_s / STRAIGHT_DUTY, turn, LEG_BACK_CM, LEG_ASIDE_CM)  # fmt: skip


def _kilobot_traits(setting: Kilobots, drawn: Sequence[float]) -> Traits:
    left, right = motor_strengths(setting, drawn)
    rest = [1.0 + setting.calibration_sd * one for one in drawn[2:]]
    return Traits(bias=(left * rest[0], right * rest[1]))


KILOBOT: Final = RobotKind("kilobot", "kilobots", dimensions.KILOBOT_RADIUS, dimensions.KILOBOT_MASS,
                           dimensions.KILOBOT_HEIGHT, _vibration, _kilobot_traits,
                           "arena.robots.kilobot:controllers")  # fmt: skip
KINDS: Final[dict[str, RobotKind]] = {one.name: one for one in (EPUCK, KILOBOT)}
"""The kinds of robots by the name that a scene has for them."""
