"""Filmstrip of one robot of a recorded trial: pictures and a log of its camera and wheels (`arena plot --film`)."""

from __future__ import annotations

import base64
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray

from arena.camera.appearance import COLOURS, NAMES, OBJECT, ROBOT, WALL
from arena.camera.line_of_sight import WINDOW_COLUMNS
from arena.replay.page import sample_data
from arena.robots.controller import STRIP_COLUMNS, STRIP_PIXELS
from arena.scene import geometry, palette
from arena.trial.record import Trial

PICTURES: Final = 6
LINES: Final = 20
VIEW_CM: Final = 60.0
"""Half of the side of a picture, in cm."""
CHANGE_CM_S: Final = 2.0
"""Least difference of wheel speeds, in cm/s, that counts as a new command.

One step more or less in the 10 ms in which steps are counted is 1.28 cm/s."""


def command_changes(trial: Trial, robot: int) -> list[int]:
    """Return the samples at which the commanded speed of a wheel changes."""
    speeds = wheel_speeds(trial, robot)
    found = [0]
    for sample in range(1, len(speeds)):
        if np.abs(speeds[sample] - speeds[found[-1]]).max() > CHANGE_CM_S:
            found.append(sample)
    return found


def wheel_speeds(trial: Trial, robot: int) -> NDArray[np.float64]:
    """Return the commanded speeds in cm/s: samples x (left, right)."""
    return np.column_stack([trial.columns[f"r{robot}_left"], trial.columns[f"r{robot}_right"]])


def strip_content(strip: bytes) -> str:
    """Return what a camera strip shows in the window of the firmware's sensor.

    Each column counts as the class of the nearest colour. The result is the first of object, robot and wall that a
    column shows."""
    if not strip:
        return "nothing yet"
    pixels = np.frombuffer(strip, np.uint8).reshape(-1, 3).astype(int)
    every = len(STRIP_COLUMNS) // STRIP_PIXELS
    places = [(column - STRIP_COLUMNS.start) // every for column in WINDOW_COLUMNS]
    kinds = (OBJECT, ROBOT, WALL)
    seen = {min(kinds, key=lambda kind: int(np.abs(pixels[place] - COLOURS[kind].astype(int)).sum()))
            for place in places if place < len(pixels)}  # fmt: skip
    return next((NAMES[kind] for kind in kinds if kind in seen), "nothing yet")


def log_lines(trial: Trial, robot: int) -> list[str]:
    """Return at most LINES lines, one per change of command: time, camera, wheel speeds in mm/s, front LED."""
    speeds = wheel_speeds(trial, robot)
    lines = []
    for sample in command_changes(trial, robot)[:LINES]:
        left, right = 10 * speeds[sample]
        leds = int(trial.columns[f"r{robot}_leds"][sample])
        content = strip_content(trial.columns[f"r{robot}_strip"][sample])
        lines.append(f"{trial.times[sample]:7.2f} s  camera {content:11}  "
                     f"wheels {left:4.0f} {right:4.0f} mm/s  front LED {'on' if leds >> 8 & 1 else 'off'}")  # fmt: skip
    return lines


def draw_filmstrip(trial: Trial, robot: int) -> Figure:
    """Draw the surroundings of the robot at its first changes of command, each with its camera line."""
    chosen = command_changes(trial, robot)[:PICTURES]
    data = sample_data(trial)
    figure = Figure(figsize=(2.2 * PICTURES, 3.0), layout="constrained")
    grid = figure.subplots(2, PICTURES, squeeze=False, height_ratios=(6, 1))
    for column in range(PICTURES):
        above, below = grid[:, column]
        for axis in (above, below):
            axis.set(xticks=[], yticks=[])
        if column >= len(chosen):
            above.axis("off")
            below.axis("off")
            continue
        sample = chosen[column]
        _from_above(above, trial, data, robot, sample)
        left, right = 10 * wheel_speeds(trial, robot)[sample]
        above.set_title(f"{trial.times[sample]:.1f} s: {left:.0f}, {right:.0f} mm/s", fontsize=8)
        strip = np.frombuffer(base64.b64decode(data["robots"][robot]["strip"][sample]), np.uint8)
        below.imshow(strip.reshape(1, -1, 3) if strip.size else np.zeros((1, STRIP_PIXELS, 3), np.uint8), aspect="auto")
    return figure


def _from_above(axis: Any, trial: Trial, data: dict[str, Any], robot: int, sample: int) -> None:
    x, y = trial.robots[sample][robot]
    heading = data["robots"][robot]["heading"][sample]
    path = trial.robots[: sample + 1, robot]
    axis.plot(path[:, 0], path[:, 1], color="0.6", linewidth=0.8)
    for thing, place in enumerate(trial.object_poses[sample]):
        kind = trial.scene.kind_of(thing)
        outline = (Polygon(geometry.turned(geometry.centred(kind.polygon), *place)) if kind.polygon else
                   Circle((place[0], place[1]), kind.radius_cm))  # fmt: skip
        outline.set(facecolor=palette.OBJECT, edgecolor="k")
        axis.add_patch(outline)
    for number, (rx, ry) in enumerate(trial.robots[sample]):
        radius = trial.scene.robot_kind(number).radius_cm
        axis.add_patch(Circle((rx, ry), radius, facecolor=palette.ROBOT, edgecolor="k"))
    axis.plot([x, x + 150 * np.cos(heading)], [y, y + 150 * np.sin(heading)], "k:", linewidth=0.8)
    axis.set(xlim=(x - VIEW_CM, x + VIEW_CM), ylim=(y - VIEW_CM, y + VIEW_CM), aspect="equal")
