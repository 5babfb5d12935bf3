"""A trial as one HTML page that opens from disk: top view, play, scrub, speed, LEDs, camera strips, clusters, log.

The page's data is a JSON block (`id="trial"`) of the very values of the record; `page.html` draws it. A page that
follows a running trial asks its server (`live.py`) for more of the same.
"""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from arena import bodies
from arena.brain import STRIP_COLUMNS, STRIP_PIXELS
from arena.metrics import clusters, reach_of
from arena.record import Trial
from arena.scene import scene_of
from arena.vision import COLOURS, Eye, sensor_of
from arena.world import Poses

TEMPLATE: Final = Path(__file__).with_name("page.html")
PLACE: Final = "/*TRIAL*/null"
_MIDDLE_ROW: Final = 240
_STRIP: Final = np.arange(STRIP_PIXELS) * len(STRIP_COLUMNS) // STRIP_PIXELS + STRIP_COLUMNS.start


def page(trial: Trial, live: bool = False) -> str:
    """The page's text; `live`: it asks where it came from for more."""
    data = head_of(trial.about) | samples_of(trial) | {"live": live}
    text = json.dumps(data, separators=(",", ":")).replace("</", "<\\/")
    return TEMPLATE.read_text(encoding="utf-8").replace(PLACE, text)


def head_of(about: dict[str, Any]) -> dict[str, Any]:
    """What does not change during a trial."""
    scene = about["scene"]
    return {
        "title": f"{scene['name']}, {about['brain']}, controller {about['controller']}, seed {about['seed']}",
        "width": scene["arena"]["width_cm"],
        "height": scene["arena"]["height_cm"],
        "objectRadius": scene["objects"]["radius_cm"],
        "robotRadius": bodies.ROBOT_RADIUS,
    }


def samples_of(trial: Trial) -> dict[str, Any]:
    """What there is per sample, as arrays over the samples, and the faults so far."""
    radius = trial.about["scene"]["objects"]["radius_cm"]
    columns, objects = trial.columns, trial.objects
    done = trial.course
    robots = []
    for robot, (seen, strips) in enumerate(_views(trial)):
        keys = ("x", "y", "heading", "leds", "load")
        robots.append({key: np.asarray(columns[f"r{robot}_{key}"]).tolist() for key in keys})
        robots[-1] |= {"seen": seen, "strip": [base64.b64encode(strip).decode() for strip in strips]}
    return {
        "t": trial.times.tolist(),
        "robots": robots,
        "objects": objects.tolist(),
        "clusters": [clusters(places, reach_of("4r", radius)) for places in objects],
        "share": done.share.tolist(),
        "compactness": done.compactness.tolist(),
        "log": columns["log"],
        "lights": columns["lights"],
        "faults": trial.about["faults"],
    }


def _views(trial: Trial) -> list[tuple[list[int], list[bytes]]]:
    """Per robot: what its sensor's window shows, and the camera's strips. A brain that keeps its sensor to itself is
    shown what stands before it at that moment; a script, which has no camera, gets a strip in perfect colours."""
    scene = scene_of(trial.about["scene"])
    count = int(trial.about["scene"]["robots"]["count"])
    views: list[tuple[list[int], list[bytes]]] = []
    headings = [trial.columns[f"r{robot}_heading"] for robot in range(count)]
    robots, objects = trial.robots.tolist(), trial.objects.tolist()
    for robot in range(count):
        seen, strips = list(map(int, trial.columns[f"r{robot}_seen"])), list(trial.columns[f"r{robot}_strip"])
        is_script = not any(strips)
        for sample, (places, things) in enumerate(zip(robots, objects, strict=True)):
            if seen[sample] >= 0 and not is_script:
                continue
            poses = Poses([(x, y, float(headings[i][sample])) for i, (x, y) in enumerate(places)], things)
            eye = Eye(scene, poses, robot)
            if seen[sample] < 0:
                seen[sample] = sensor_of(eye)
            if is_script:
                strips[sample] = COLOURS[np.broadcast_to(eye.classes(_MIDDLE_ROW, _STRIP), len(_STRIP))].tobytes()
        views.append((seen, strips))
    return views
