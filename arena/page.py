"""A trial as one HTML page that opens from disk: top view, play, pause, scrub, speed, LEDs, clusters, log.

The page's data is a JSON block (`id="trial"`) of the very values of the file; `page.html` draws it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

import numpy as np

from arena import bodies
from arena.metrics import clusters, course, reach_of
from arena.record import Trial

TEMPLATE: Final = Path(__file__).with_name("page.html")
PLACE: Final = "/*TRIAL*/null"


def page(trial: Trial) -> str:
    """The page's text."""
    scene = trial.about["scene"]
    radius = scene["objects"]["radius_cm"]
    robots = scene["robots"]["count"]
    done = course(trial.times, trial.objects, radius)
    columns = trial.columns
    data = {
        "title": f"{scene['name']}, {trial.about['brain']}, controller {trial.about['controller']}, "
        f"seed {trial.about['seed']}",
        "width": scene["arena"]["width_cm"],
        "height": scene["arena"]["height_cm"],
        "objectRadius": radius,
        "robotRadius": bodies.ROBOT_RADIUS,
        "t": trial.times.tolist(),
        "robots": [
            {key: np.asarray(columns[f"r{i}_{key}"]).tolist() for key in ("x", "y", "heading", "seen", "leds", "load")}
            for i in range(robots)
        ],
        "objects": trial.objects.tolist(),
        "clusters": [clusters(places, reach_of("4r", radius)) for places in trial.objects],
        "share": done.share.tolist(),
        "compactness": done.compactness.tolist(),
        "log": columns["log"],
        "faults": trial.about["faults"],
    }
    text = json.dumps(data, separators=(",", ":")).replace("</", "<\\/")
    return TEMPLATE.read_text(encoding="utf-8").replace(PLACE, text)
