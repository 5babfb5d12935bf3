"""Scenes: TOML files to checked values. What enters: a name or a path. What leaves: a `Scene`, which knows no physics.

A new scene is a new TOML file; keys that are left out take the values of `clustering.toml`'s comments, unknown keys are
errors.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final, TypeVar

FOLDER: Final = Path(__file__).parent / "scenes"
FCY: Final = 14_745_600
"""Tcy per second of the e-puck (epuck.md)."""


class SceneError(ValueError):
    """A scene cannot be read or built; the text names file and key."""


@dataclass(frozen=True, slots=True)
class Arena:
    """Inner size between the walls."""

    width_cm: float = 400.0
    height_cm: float = 300.0


@dataclass(frozen=True, slots=True)
class Marks:
    """Grid of start positions, centred in the arena."""

    columns: int = 15
    rows: int = 11
    spacing_cm: float = 25.0


@dataclass(frozen=True, slots=True)
class Robots:
    """The e-pucks. `wheel_noise` is a share of the speed, drawn anew every `noise_period_s`."""

    count: int = 5
    axle_cm: float = 5.1
    thrust_n: float = 1.0
    wheel_noise: float = 0.05
    noise_period_s: float = 0.1


@dataclass(frozen=True, slots=True)
class Objects:
    """What can be pushed: discs seen from above."""

    count: int = 20
    radius_cm: float = 5.0
    mass_kg: float = 0.035
    floor_friction: float = 0.58


@dataclass(frozen=True, slots=True)
class CameraSetting:
    """The sensor in front; how it is mounted and its lens are explained in `lens.py`. `false_*` are chances per frame
    and hold for scripted brains only."""

    sensor: str = "PO6030K"
    frame_tcy: int = 1_600_000
    range_cm: float = 150.0
    pitch_deg: float = 0.0
    mirrored: bool = False
    distortion: float = 0.0
    vignetting: float = 0.0
    pixel_noise: float = 3.0
    false_negative: float = 0.0
    false_positive: float = 0.0


@dataclass(frozen=True, slots=True)
class InfraredSetting:
    """Reflection of surfaces as a share of white paper's. UNVERIFIED but for white walls; black is 0.1 to 0.3."""

    wall_share: float = 1.0
    object_share: float = 0.8
    robot_share: float = 0.5


@dataclass(frozen=True, slots=True)
class Light:
    """`brightness` of the scene for cameras, 1 = as their colours say. For infrared sensors: raw counts in the room
    (falling with light), and what a lamp takes off at 1 m from a sensor that faces it; 0 = no lamp."""

    brightness: float = 1.0
    ambient_counts: int = 3800
    lamp_x_cm: float = 0.0
    lamp_y_cm: float = 0.0
    lamp_counts: float = 0.0


@dataclass(frozen=True, slots=True)
class BatterySetting:
    """Voltage at the trial's start, and hours until it has fallen in a line from full (4.2 V) to low (3.4 V)."""

    volts: float = 4.0
    hours: float = 3.0


@dataclass(frozen=True, slots=True)
class Clock:
    """Lock-step of world and brains, another one when all brains are scripted, and how often rows are written."""

    quantum_ms: float = 1.0
    scripted_quantum_ms: float = 10.0
    sample_s: float = 0.5

    @property
    def quantum_tcy(self) -> int:
        """The quantum in whole Tcy."""
        return round(self.quantum_ms * FCY / 1000)


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything about a world that is not chance."""

    name: str
    description: str = ""
    arena: Arena = Arena()
    marks: Marks = Marks()
    robots: Robots = Robots()
    objects: Objects = Objects()
    camera: CameraSetting = CameraSetting()
    infrared: InfraredSetting = InfraredSetting()
    light: Light = Light()
    battery: BatterySetting = BatterySetting()
    clock: Clock = Clock()

    def with_values(self, **values: Any) -> Scene:
        """A copy with `section__key=value` replaced, checked. Raises SceneError."""
        scene = self
        for place, value in values.items():
            section, _, key = place.partition("__")
            if section not in _SECTIONS or key not in {one.name for one in fields(_SECTIONS[section])}:
                raise SceneError(f"there is no scene value {section}.{key}")
            table = _section(self.name, section, _SECTIONS[section], {key: value}, getattr(scene, section))
            scene = replace(scene, **{section: table})
        return _checked(scene, self.name)


_SECTIONS: Final[Mapping[str, type[Any]]] = {
    "arena": Arena,
    "marks": Marks,
    "robots": Robots,
    "objects": Objects,
    "camera": CameraSetting,
    "infrared": InfraredSetting,
    "light": Light,
    "battery": BatterySetting,
    "clock": Clock,
}

T = TypeVar("T")


def scripted(scene: Scene) -> Scene:
    """The scene as scripted brains live in it: with their own, longer quantum."""
    return scene.with_values(clock__quantum_ms=scene.clock.scripted_quantum_ms)


def scenes() -> list[str]:
    """Names of the scenes that come along."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_scene(name: str) -> Scene:
    """A scene by name, or from the TOML file at a path. Raises SceneError."""
    path = Path(name) if name.endswith(".toml") else FOLDER / f"{name}.toml"
    try:
        with path.open("rb") as file:
            data = tomllib.load(file)
    except FileNotFoundError:
        raise SceneError(f"there is no scene {name!r}; known: {', '.join(scenes())}, or a path to a .toml") from None
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SceneError(f"{path}: {error}") from None
    return _checked(_scene(str(path), data), str(path))


def scene_of(values: dict[str, Any]) -> Scene:
    """The scene a record was made in, from its metadata. Raises SceneError for one this version cannot build."""
    return _checked(_scene("the record", values), "the record")


def _scene(path: str, data: dict[str, Any]) -> Scene:
    values: dict[str, Any] = {}
    for key, value in data.items():
        if key in ("name", "description") and isinstance(value, str):
            values[key] = value
        elif key in _SECTIONS and isinstance(value, dict):
            values[key] = _section(path, key, _SECTIONS[key], value, _SECTIONS[key]())
        else:
            raise SceneError(f"{path}: unexpected {key!r}; expected name, description, {', '.join(_SECTIONS)}")
    if "name" not in values:
        raise SceneError(f"{path}: a scene needs a name")
    return Scene(**values)


def _section(path: str, section: str, kind: type[T], values: dict[str, Any], base: T) -> T:
    known = {one.name: type(getattr(base, one.name)) for one in fields(kind)}  # type: ignore[arg-type]
    taken: dict[str, Any] = {}
    for key, value in values.items():
        if key not in known:
            raise SceneError(f"{path}: unknown key {section}.{key}; expected {', '.join(known)}")
        want = known[key]
        if want is float and value == "inf":
            value = math.inf
        if want is float and type(value) is int:
            value = float(value)
        if type(value) is not want:
            raise SceneError(f"{path}: {section}.{key} is {value!r}; expected {want.__name__}")
        taken[key] = value
    return replace(base, **taken)  # type: ignore[type-var]


def _checked(scene: Scene, path: str) -> Scene:
    """Raises SceneError for values no world can have."""
    limits: dict[str, tuple[float, float, float]] = {
        "arena.width_cm": (scene.arena.width_cm, 20, 10_000),
        "arena.height_cm": (scene.arena.height_cm, 20, 10_000),
        "marks.columns": (scene.marks.columns, 1, 10_000),
        "marks.rows": (scene.marks.rows, 1, 10_000),
        "marks.spacing_cm": (scene.marks.spacing_cm, 1, 10_000),
        "robots.count": (scene.robots.count, 0, 1000),
        "robots.axle_cm": (scene.robots.axle_cm, 1, 7.4),
        "robots.thrust_n": (scene.robots.thrust_n, 0.01, math.inf),
        "robots.wheel_noise": (scene.robots.wheel_noise, 0, 1),
        "robots.noise_period_s": (scene.robots.noise_period_s, 0.001, 1000),
        "objects.count": (scene.objects.count, 0, 10_000),
        "objects.radius_cm": (scene.objects.radius_cm, 0.5, 100),
        "objects.mass_kg": (scene.objects.mass_kg, 0.001, 100),
        "objects.floor_friction": (scene.objects.floor_friction, 0, 10),
        "camera.frame_tcy": (scene.camera.frame_tcy, 100_000, 100_000_000),
        "camera.range_cm": (scene.camera.range_cm, 1, math.inf),
        "camera.pitch_deg": (scene.camera.pitch_deg, -20, 20),
        "camera.distortion": (scene.camera.distortion, -1, 1),
        "camera.vignetting": (scene.camera.vignetting, 0, 1),
        "camera.pixel_noise": (scene.camera.pixel_noise, 0, 255),
        "camera.false_negative": (scene.camera.false_negative, 0, 1),
        "camera.false_positive": (scene.camera.false_positive, 0, 1),
        "infrared.wall_share": (scene.infrared.wall_share, 0, 1),
        "infrared.object_share": (scene.infrared.object_share, 0, 1),
        "infrared.robot_share": (scene.infrared.robot_share, 0, 1),
        "light.brightness": (scene.light.brightness, 0, 100),
        "light.ambient_counts": (scene.light.ambient_counts, 0, 4095),
        "light.lamp_counts": (scene.light.lamp_counts, 0, 1_000_000),
        "battery.volts": (scene.battery.volts, 3.0, 4.2),
        "battery.hours": (scene.battery.hours, 0.01, 1000),
        "clock.quantum_ms": (scene.clock.quantum_ms, 0.1, 20),
        "clock.scripted_quantum_ms": (scene.clock.scripted_quantum_ms, 0.1, 20),
        "clock.sample_s": (scene.clock.sample_s, 0.02, 60),
    }
    for key, (value, low, high) in limits.items():
        if not low <= value <= high:
            raise SceneError(f"{path}: {key} is {value}; expected {low} to {high}")
    return scene
