"""`arena channel`: infrared light between robots beside the published table, and how far it reaches by angle."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from arena.commands.run import changed
from arena.infrared.propagation import PUBLISHED, Optics, amplitude, distance_of
from arena.scene.loader import Scene, load_scene
from arena.trial.json_numbers import json_text
from arena.world.physics import Poses

THRESHOLDS: Final = (10.0, 2.0)
"""Counts whose reach is drawn: libIrcom detects from 10 on (swarmcom.md §3); 2 are one deviation of plausible noise."""
BEST_DEG: Final = 31.5
"""Between two neighbouring emitters, where a robot shines brightest with the usual beams."""
NEAR_CM: Final = 10.0
"""Where everybody gets something."""


def parser() -> argparse.ArgumentParser:
    """Options of the command."""
    made = argparse.ArgumentParser(
        description="print the amplitude of infrared light between two robots beside the published one, and draw it",
        epilog="example: arena channel --figure docs/figures/infrared-channel.png",
    )
    made.add_argument("scene", nargs="?", default="clustering", help="whose [infrared] holds (default %(default)s)")
    made.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE", help="change a scene value")
    made.add_argument("--figure", type=Path, metavar="FILE", help="a PNG, SVG or PDF to draw")
    made.add_argument("--json", action="store_true")
    return made


def received(optics: Optics, distance_cm: float, sender_deg: float, receiver_deg: float) -> float:
    """Counts on the strongest sensor of one robot when another lights all emitters: directions of the line between
    their centres, clockwise from the sender's and the receiver's front."""
    poses = Poses([(0.0, 0.0, math.radians(receiver_deg)), (distance_cm, 0.0, math.pi + math.radians(sender_deg))], [])
    return max((sum(one.counts) * max(one.shares) for one in optics.signals(poses, 0, [1])), default=0.0)


def reach(optics: Optics, counts: float, sender_deg: float) -> float:
    """cm at which a receiver with a sensor right in the direction still gets so much."""
    share = received(optics, NEAR_CM, sender_deg, 90.0) / amplitude(NEAR_CM)
    return distance_of(counts / share) if share else 0.0


def draw(optics: Optics) -> Figure:
    """Amplitude by distance, and reach by direction."""
    figure = Figure(figsize=(10, 4.4), layout="constrained")
    left, right = figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2, projection="polar")
    distances = np.arange(7.4, 60, 0.1)
    left.semilogy(*zip(*PUBLISHED, strict=True), "o", color="k", markersize=4, label="published (libIrcom)")
    for name, sender, receiver in (("brightest direction", BEST_DEG, 90.0), ("front to front", 0.0, 0.0),
                                   ("from behind", 180.0, 90.0)):  # fmt: skip
        left.semilogy(distances, [received(optics, one, sender, receiver) for one in distances], label=name)
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
    """Print the table; raises SceneError, OSError."""
    setting = changed(load_scene(options.scene), options.set).infrared
    optics = Optics(Scene("channel", infrared=setting))
    rows = [(distance, counts, received(optics, distance, BEST_DEG, 90.0)) for distance, counts in PUBLISHED]
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
