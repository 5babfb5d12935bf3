"""Minimum and maximum of each number of a scene (schema.py)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from arena.scene.schema import (
    Arena,
    BatterySetting,
    Bluetooth,
    CameraSetting,
    Clock,
    InfraredSetting,
    Kilobots,
    Lamp,
    Light,
    Marks,
    ObjectKind,
    Objects,
    Obstacle,
    Patch,
    RobotGroup,
    Robots,
    Start,
)

FIRMWARE_ROBOTS: Final = 1000
"""Most robots with firmware in a trial: each e-puck takes some MB of the host's memory."""
_CENTRE: Final = (-10_000, 10_000)
_PLACED: Final = {
    "count": (0, 10_000),
    "x_cm": _CENTRE,
    "y_cm": _CENTRE,
    "width_cm": (0, 10_000),
    "depth_cm": (0, 10_000),
    "sd_cm": (0, 10_000),
    "circle_cm": (0, 10_000),
    "spacing_cm": (0.1, 10_000),
}
LIMITS: Final[Mapping[type[Any], Mapping[str, tuple[float, float]]]] = {
    Arena: {"width_cm": (20, 10_000), "height_cm": (20, 10_000)},
    Marks: {"columns": (1, 10_000), "rows": (1, 10_000), "spacing_cm": (1, 10_000)},
    Robots: {
        "count": (0, 10_000),
        "axle_cm": (1, 7.4),
        "thrust_n": (0.01, math.inf),
        "brake_n": (0.01, 1000),
        "wheel_noise": (0, 1),
        "noise_period_s": (0.001, 1000),
        "camera_yaw_sd_deg": (0, 20),
        "camera_pitch_sd_deg": (0, 10),
        "wheel_bias_sd": (0, 0.2),
    },
    Objects: {"count": (0, 10_000), "radius_cm": (0.5, 100), "mass_kg": (0.001, 100), "floor_friction": (0, 10)},
    CameraSetting: {
        "frame_tcy": (100_000, 100_000_000),
        "range_cm": (1, math.inf),
        "pitch_deg": (-20, 20),
        "distortion": (-1, 1),
        "vignetting": (0, 1),
        "pixel_noise": (0, 255),
        "false_negative": (0, 1),
        "false_positive": (0, 1),
    },
    InfraredSetting: {
        "wall_share": (0, 1),
        "object_share": (0, 1),
        "robot_share": (0, 1),
        "signal_gain": (0, 100),
        "emitter_power": (0, 1000),
        "receiver_power": (0, 1000),
        "side_rays": (0, 7),
        "tau_us": (1, 1000),
        "noise_counts": (0, 1000),
        "ripple_counts": (0, 1000),
        "lost_share": (0, 1),
    },
    Light: {"brightness": (0, 100), "ambient_counts": (0, 4095), "ambient_sd_counts": (0, 1000),
            "lamp_counts": (0, 1_000_000), "lamp_x_cm": _CENTRE, "lamp_y_cm": _CENTRE},
    BatterySetting: {"volts": (3.0, 4.2), "hours": (0.01, 1000)},
    Start: {
        "spread_tcy": (1, 147_456_000),
        "selector": (-1, 15),
        "remote_at_s": (0, 100_000),
        "remote_held_s": (0, 7),
        "silent_s": (0.1, math.inf),
    },
    Kilobots: {
        "speed_cm_s": (0, 10),
        "turn_deg_s": (0, 720),
        "motor_sd": (0, 0.2),
        "calibration_sd": (0, 0.2),
        "motion_noise": (0, 1),
        "thrust_n": (0.001, math.inf),
        "brake_n": (0.001, 10),
        "clock_sd": (0, 0.03),
        "reach_cm": (0, 100),
        "lost_share": (0, 0.99),
        "ambient_counts": (0, 1023),
        "lamp_gain": (0, 100),
    },
    Bluetooth: {"period_ms": (0.1, 10_000)},
    Clock: {"quantum_ms": (0.1, 20), "scripted_quantum_ms": (0.1, 20), "sample_s": (0.02, 60)},
    RobotGroup: {**_PLACED, "count": (0, 10_000), "id_first": (0, 65_535), "selector": (-1, 15)},
    ObjectKind: {
        **_PLACED,
        "radius_cm": (0.5, 100),
        "height_cm": (0.1, 1000),
        "mass_kg": (0.001, 100),
        "floor_friction": (0, 10),
        "share": (0, 1),
    },
    Obstacle: {"x_cm": _CENTRE, "y_cm": _CENTRE, "radius_cm": (0, 1000), "height_cm": (0.1, 1000), "share": (0, 1)},
    Patch: {"x_cm": _CENTRE, "y_cm": _CENTRE, "radius_cm": (0, 10_000)},
    Lamp: {"x_cm": _CENTRE, "y_cm": _CENTRE, "counts": (0, 1_000_000)},
}  # fmt: skip
