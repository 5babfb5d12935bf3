"""Replay page: one HTML file that shows a trial from above, with LEDs, camera strips, curves, clusters and log.

The data is a JSON block (`id="trial"`) with the values of the record; the scripts of `page_files` draw it. A Content
Security Policy permits only these scripts, by their hash. The page of a running trial polls its server for new samples
(`arena/replay/live_feed.py`, `arena/commands/studio.py`).
"""

from __future__ import annotations

import base64
import hashlib
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from arena.camera.appearance import colours_of
from arena.camera.line_of_sight import LineOfSight
from arena.camera.renderer import Renderer
from arena.robots.controller import STRIP_COLUMNS, STRIP_PIXELS
from arena.scene import dimensions, geometry, palette
from arena.scene.loader import Scene
from arena.scene.schema import NAMED, Obstacle, Patch
from arena.trial.record import Trial
from arena.trial.strict_json import script_json
from arena.world.physics import traits_of
from arena.world.poses import Poses

FILES: Final = Path(__file__).with_name("page_files")
SCRIPTS: Final = ("view.js", "controls.js", "studio.js", "start.js")
"""Parts of the page's script, in order."""
_MIDDLE_ROW: Final = 240
_STRIP: Final = np.arange(STRIP_PIXELS) * len(STRIP_COLUMNS) // STRIP_PIXELS + STRIP_COLUMNS.start


def page(trial: Trial, live: bool = False, studio: dict[str, Any] | None = None) -> str:
    """Return the text of the page of a trial.

    With `live` the page polls its server for new samples. `studio` holds the data with which it sends commands
    (arena/commands/studio.py)."""
    data = trial_data(trial) | sample_data(trial) | {"live": live, "studio": studio}
    return _document("page.html", "".join(map(_text, SCRIPTS)), data)


def waiting_page(data: Mapping[str, Any]) -> str:
    """Return the text of the page that a studio shows until its trial is ready (arena/commands/studio.py)."""
    return _document("waiting.html", _text("waiting.js"), data)


def _document(template: str, script: str, data: Mapping[str, Any]) -> str:
    """Return a page made from a file with places for the style, the script, their policy and the data."""
    style = _text("style.css")
    policy = (f"default-src 'none'; connect-src 'self'; style-src {_hash(style)}; script-src {_hash(script)}; "
              "base-uri 'none'; form-action 'none'")  # fmt: skip
    parts = {"/*STYLE*/\n": style, "/*SCRIPT*/\n": script, "/*POLICY*/": policy, "/*TRIAL*/null": script_json(data)}
    whole = _text(template)
    for place, content in parts.items():
        whole = whole.replace(place, content)
    return whole


def _text(name: str) -> str:
    """Return the content of a file of the page."""
    return (FILES / name).read_text(encoding="utf-8")


def _hash(content: str) -> str:
    """Return the source expression of the Content Security Policy for an inline element, as page.html embeds it."""
    digest = hashlib.sha256(f"\n{content}".encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode()}'"


def trial_data(trial: Trial) -> dict[str, Any]:
    """Return the data of a trial that do not change with time; lengths in cm."""
    about = trial.about
    return {
        "title": f"{trial.scene.name}, {about['brain']}, controller {about['controller']}, seed {about['seed']}",
        "width": trial.scene.arena.width_cm,
        "height": trial.scene.arena.height_cm,
        "polygon": trial.scene.arena.polygon,
        "walls": trial.scene.arena.walls,
        "kinds": [
            {
                "name": one.name,
                "radius": one.radius_cm,
                "colour": _css(one.colour),
                "polygon": geometry.centred(one.polygon) if one.polygon else (),
            }
            for one in map(trial.scene.kind_of, range(trial.scene.objects.count))
        ],
        "grouped": trial.experiment.has_groups,
        "obstacles": [_shape(one) for one in trial.scene.obstacles],
        "patches": [_shape(one) for one in trial.scene.patches],
        "lamps": _lamps(trial.scene),
        "links": trial.scene.bluetooth.links,
        "names": [
            f" ({one.name} {trial.scene.id_of(robot)})" if one.name else ""
            for robot, one in enumerate(map(trial.scene.group_of, range(trial.scene.robots.count)))
        ],
        "bodies": [
            {"kind": kind.name, "radius": kind.radius_cm}
            for kind in map(trial.scene.robot_kind, range(trial.scene.robots.count))
        ],
        "palette": {"seen": palette.SEEN, "groups": palette.GROUPS},
        "sight": min(trial.scene.camera.range_cm, 1000.0),
        "infrared": {
            "bearings": [math.radians(bearing) for bearing in dimensions.IR_BEARINGS_DEG],
            "range": dimensions.IR_RANGE,
        },
        "metrics": [
            {"name": one.name, "label": one.label, "unit": one.unit, "scale": one.scale, "best": one.best}
            for one in trial.experiment.curves
        ],
    }


def _css(colour: str) -> str:
    """Return a colour of the scene for CSS. Named colours are brightened: as a camera shows them they are dark."""
    red, green, blue = NAMED.get(colour) or tuple(bytes.fromhex(colour[1:]))
    brightest = max(red, green, blue, 1)
    gain = min(230 / brightest, 2.2) if colour in NAMED else 1.0
    return "#" + "".join(f"{round(min(gain * one, 255)):02x}" for one in (red, green, blue))


def _shape(one: Obstacle | Patch) -> dict[str, Any]:
    return {"name": one.name, "polygon": one.polygon, "x": one.x_cm, "y": one.y_cm, "radius": one.radius_cm,
            "colour": _css(one.colour)}  # fmt: skip


def _lamps(scene: Scene) -> list[dict[str, float]]:
    lamps = [{"x": one.x_cm, "y": one.y_cm} for one in scene.lamps]
    return lamps + ([{"x": scene.light.lamp_x_cm, "y": scene.light.lamp_y_cm}] if scene.light.lamp_counts else [])


def sample_data(trial: Trial) -> dict[str, Any]:
    """Return the data per sample as arrays over the samples, and the faults so far."""
    columns, objects = trial.columns, trial.objects
    series = trial.series
    robots = []
    for robot, (seen, strips) in enumerate(_camera_views(trial)):
        keys = ("x", "y", "heading", "left", "right", "leds", "load")
        robots.append({key: np.asarray(columns[f"r{robot}_{key}"]).tolist() for key in keys})
        robots[-1] |= {"seen": seen, "strip": [base64.b64encode(strip).decode() for strip in strips]}
    return {
        "t": trial.times.tolist(),
        "robots": robots,
        "objects": trial.object_poses,
        "clusters": [trial.experiment.groups(trial.scene, places) for places in objects],
        "curves": {name: values.tolist() for name, values in series.curves.items()},
        "log": columns["log"],
        "lights": columns["lights"],
        "messages": columns["messages"] if "messages" in columns else [[] for _ in trial.times],
        "faults": trial.about["faults"],
    }


def _camera_views(trial: Trial) -> list[tuple[list[int], list[bytes]]]:
    """Return per robot the readings of its line-of-sight sensor and its camera strips.

    Values are those of the record. For a robot with a camera, values that the record lacks are computed from the poses:
    readings that the firmware did not report, and the strip of a scripted robot, in noise-free colours."""
    scene = trial.scene
    colours = colours_of(scene)
    seed = trial.about["seed"]
    count = scene.robots.count
    views: list[tuple[list[int], list[bytes]]] = []
    headings = [trial.columns[f"r{robot}_heading"] for robot in range(count)]
    places = zip(trial.robots.tolist(), trial.object_poses, strict=True)
    poses = [Poses([(x, y, float(headings[i][sample])) for i, (x, y) in enumerate(robots)], objects)
             for sample, (robots, objects) in enumerate(places)]  # fmt: skip
    for robot in range(count):
        seen, strips = list(map(int, trial.columns[f"r{robot}_seen"])), list(trial.columns[f"r{robot}_strip"])
        if not scene.robot_kind(robot).has_camera:
            views.append((seen, strips))
            continue
        is_script = not any(strips)
        traits = traits_of(scene, seed, robot)
        renderer, sight = Renderer(scene, robot, traits), LineOfSight(scene, robot, traits)
        for sample, now in enumerate(poses):
            if seen[sample] < 0:
                seen[sample] = sight.look(now)
            if is_script:
                renderer.set_viewpoint(now)
                strips[sample] = colours[renderer.classify_row(_MIDDLE_ROW, _STRIP)].tobytes()
        views.append((seen, strips))
    return views
