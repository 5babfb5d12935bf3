"""`arena channel`: compare the infrared amplitude between two robots with the published table, and draw its range."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from arena.commands.options.plan import with_overrides
from arena.infrared.propagation import PUBLISHED, Optics, amplitude, distance_of
from arena.scene.loader import Scene, load_scene
from arena.scene.palette import LINES
from arena.trial.strict_json import json_text
from arena.world.poses import Poses
from emu.host.errors import CommandParser

THRESHOLDS: Final = (10.0, 2.0)
"""Amplitudes in ADC counts whose range is drawn.

The detection threshold of libIrcom is 10 (swarmcom.md §3); 2 is one standard deviation of plausible noise."""
BEST_DEG: Final = 31.5
"""Direction in degrees between two neighbouring emitters, in which a robot is brightest with the default beams."""
NEAR_CM: Final = 10.0
"""Distance in cm at which receivers in all directions have a signal."""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = CommandParser(
        description="print the infrared amplitude between two robots beside the published values, and draw it",
        epilog="example: arena channel --figure docs/figures/infrared-channel.png",
    )
    command.add_argument(
        "scene", nargs="?", default="clustering", help="scene with the [infrared] section (default %(default)s)"
    )
    command.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE", help="change a scene value")
    command.add_argument(
        "--figure", type=Path, metavar="FILE", help="draw amplitude and range into this PNG, SVG or PDF file"
    )
    command.add_argument("--json", action="store_true", help="print JSON")
    return command


def received_counts(optics: Optics, distance_cm: float, sender_deg: float, receiver_deg: float) -> float:
    """Return the ADC counts of a robot's strongest sensor while another robot lights all its emitters.

    The angles are the directions of the other robot, clockwise from the front of sender and receiver."""
    poses = Poses([(0.0, 0.0, math.radians(receiver_deg)), (distance_cm, 0.0, math.pi + math.radians(sender_deg))], [])
    return max((sum(one.counts) * max(one.shares) for one in optics.signals(poses, 0, [1])), default=0.0)


def reach(optics: Optics, counts: float, sender_deg: float) -> float:
    """Return the distance in cm at which a sensor that faces the sender receives `counts`."""
    share = received_counts(optics, NEAR_CM, sender_deg, 90.0) / amplitude(NEAR_CM)
    return distance_of(counts / share) if share else 0.0


def draw(optics: Optics) -> Figure:
    """Draw the amplitude by distance, and the range by direction."""
    figure = Figure(figsize=(10, 4.4), layout="constrained")
    left, right = figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2, projection="polar")
    for axes in (left, right):
        axes.set_prop_cycle(color=LINES)
    distances = np.arange(7.4, 60, 0.1)
    left.semilogy(*zip(*PUBLISHED, strict=True), "o", color="k", markersize=4, label="published (libIrcom)")
    for name, sender, receiver in (("brightest direction", BEST_DEG, 90.0), ("front to front", 0.0, 0.0),
                                   ("from behind", 180.0, 90.0)):  # fmt: skip
        left.semilogy(distances, [received_counts(optics, one, sender, receiver) for one in distances], label=name)
    left.axhline(THRESHOLDS[0], linestyle=":", color="k", linewidth=1)
    left.set(xlabel="distance of the centres (cm)", ylabel="counts between dark and lit", ylim=(0.5, 5000))
    left.legend(fontsize=8)
    bearings = np.arange(0, 361, 1.5)
    for counts in THRESHOLDS:
        right.plot(np.radians(bearings), [reach(optics, counts, one) for one in bearings], label=f"{counts:g} counts")
    polar: Any = right
    polar.set_theta_zero_location("N")
    polar.set_theta_direction(-1)
    right.set_title("reach (cm) by direction from the sender's front", fontsize=9)
    right.legend(fontsize=8, loc="lower left", bbox_to_anchor=(-0.25, -0.1))
    return figure


def run(options: argparse.Namespace) -> int:
    """Print the table of amplitudes in ADC counts. Raises SceneError, OSError."""
    setting = with_overrides(load_scene(options.scene), options.set).infrared
    optics = Optics(Scene("channel", infrared=setting))
    rows = [(distance, counts, received_counts(optics, distance, BEST_DEG, 90.0)) for distance, counts in PUBLISHED]
    errors = [math.log(model / counts) if model else -math.inf for _, counts, model in rows]
    error = math.sqrt(sum(one * one for one in errors) / len(rows))
    if options.figure:
        draw(optics).savefig(options.figure, dpi=100)
    if options.json:
        print(json_text({"table": [dict(zip(("cm", "published", "model"), row, strict=True)) for row in rows],
                          "rms_log": error}))  # fmt: skip
        return 0
    print("| cm | published | model |\n|---|---|---|")
    for distance, counts, model in rows:
        print(f"| {distance:g} | {counts:g} | {model:.1f} |")
    print(f"\nroot mean square of the logarithm's difference: {100 * error:.1f} %")
    return 0
