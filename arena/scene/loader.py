"""Load scenes: from a name or the path of a TOML file to a validated `Scene`.

Omitted keys have the defaults of `schema.py`, which also has the limits of all values. Unknown keys are errors.
"""

from __future__ import annotations

import math
import re
import tomllib
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final, TypeVar

from arena.scene import geometry
from arena.scene.checks import (
    CHECKS,
    SceneError,
    TableErrors,
    check_colour,
    check_given,
    check_key,
    check_limits,
    check_links,
    check_losses,
    check_off,
    check_overhead,
    check_polygon,
    check_shape,
    check_start_poses,
    wrong_points,
)
from arena.scene.robot_kind import KINDS, RobotKind
from arena.scene.schema import (
    FCY,
    INHERIT,
    LISTS,
    TABLES,
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
from emu.host.files import is_standard, read_file

__all__ = ["FCY", "BatterySetting", "CameraSetting", "Scene", "SceneError", "Start", "load_scene", "scene_of", "scenes",
           "scripted"]  # fmt: skip
FOLDER: Final = Path(__file__).parents[1] / "scenes"
NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._-]{0,63}")


@dataclass(frozen=True, slots=True)
class Scene:
    """All values of a world that are not random."""

    name: str
    description: str = ""
    experiment: str = "plain"
    """Name of an experiment, or path of its Python file, relative to the scene file."""
    arena: Arena = field(default_factory=Arena)
    marks: Marks = field(default_factory=Marks)
    robots: Robots = field(default_factory=Robots)
    objects: Objects = field(default_factory=Objects)
    camera: CameraSetting = field(default_factory=CameraSetting)
    infrared: InfraredSetting = field(default_factory=InfraredSetting)
    light: Light = field(default_factory=Light)
    battery: BatterySetting = field(default_factory=BatterySetting)
    start: Start = field(default_factory=Start)
    bluetooth: Bluetooth = field(default_factory=Bluetooth)
    kilobots: Kilobots = field(default_factory=Kilobots)
    clock: Clock = field(default_factory=Clock)
    groups: tuple[RobotGroup, ...] = ()
    """Groups of robots; empty: `robots.count` robots of one kind on marks."""
    kinds: tuple[ObjectKind, ...] = ()
    """Kinds of objects; empty: `objects.count` objects of one kind on marks."""
    obstacles: tuple[Obstacle, ...] = ()
    patches: tuple[Patch, ...] = ()
    lamps: tuple[Lamp, ...] = ()

    @property
    def is_furnished(self) -> bool:
        """Whether the scene has more than four walls, green robots and objects of one kind."""
        is_painted = self.robots.colour != Robots().colour
        return bool(is_painted or self.kinds or self.obstacles or self.patches or self.arena.polygon)

    def group_of(self, robot: int) -> RobotGroup:
        """Return the group of a robot."""
        return _nth(self.groups, robot) if self.groups else RobotGroup()

    def robot_kind(self, robot: int) -> RobotKind:
        """Return the kind of a robot: its body, its drive and its engine."""
        return KINDS[self.group_of(robot).kind]

    def id_of(self, robot: int) -> int:
        """Return the number that replaces `{id}` in a robot's stimulus: its index in its group plus `id_first`."""
        first = 0
        for group in self.groups:
            if robot < first + group.count:
                return group.id_first + robot - first
            first += group.count
        return robot

    def start_of(self, robot: int) -> Start:
        """Return power-on and inputs of a robot, with the values of its group."""
        group = self.group_of(robot)
        stimulus = self.start.stimulus if group.stimulus == INHERIT else group.stimulus
        return replace(
            self.start,
            selector=self.start.selector if group.selector < 0 else group.selector,
            remote=self.start.remote if group.remote == INHERIT else group.remote,
            stimulus=stimulus.replace("{id}", str(self.id_of(robot))),
        )

    def off_tick(self, robot: int) -> int:
        """Return the tick at which a robot's battery is removed; 2^62 if it stays for the whole trial."""
        for one, seconds in self.start.off:
            if one == robot:
                return round(seconds * FCY / self.clock.quantum_tcy)
        return 1 << 62

    def kind_of(self, number: int) -> ObjectKind:
        """Return the kind of an object."""
        if self.kinds:
            return _nth(self.kinds, number)
        one = self.objects
        return ObjectKind(radius_cm=one.radius_cm, mass_kg=one.mass_kg, floor_friction=one.floor_friction,
                          share=self.infrared.object_share)  # fmt: skip

    def with_values(self, **values: Any) -> Scene:
        """Return a validated copy with `section__key=value` replaced.

        In a scene with one [[robots]] or [[objects]] table, `robots` and `objects` set the keys of that table. Raises
        SceneError, also for a value that has no effect because other values of the scene replace it.
        """
        scene = self
        for place, value in values.items():
            section, _, key = place.partition("__")
            if _is_key_of_list(scene, section, key):
                scene = _with_list_value(scene, section, key, value)
                continue
            if section not in TABLES or key not in {one.name for one in fields(TABLES[section])}:
                raise SceneError(f"there is no scene value {section}.{key}")
            _check_has_effect(scene, section, key)
            table = _table(TableErrors(self.name), section, TABLES[section], {key: value}, getattr(scene, section))
            scene = replace(scene, **{section: table})
        return _checked(scene, TableErrors(self.name))


_LIST_OF: Final = {"robots": "groups", "objects": "kinds"}
T = TypeVar("T")
K = TypeVar("K", RobotGroup, ObjectKind)


def _nth(kinds: tuple[K, ...], number: int) -> K:
    for kind in kinds:
        if number < kind.count:
            return kind
        number -= kind.count
    raise IndexError(number)


def _is_key_of_list(scene: Scene, section: str, key: str) -> bool:
    """Whether a value belongs to the [[robots]] or [[objects]] tables of a scene, not to a value that all share."""
    if section not in _LIST_OF or not getattr(scene, _LIST_OF[section]):
        return False
    is_shared = section == "robots" and key != "count" and key in {one.name for one in fields(Robots)}
    return not is_shared and key in {one.name for one in fields(LISTS[_LIST_OF[section]])}


def _with_list_value(scene: Scene, section: str, key: str, value: Any) -> Scene:
    """Return the scene with a value of its only [[robots]] or [[objects]] table replaced. Raises SceneError."""
    name, errors = _LIST_OF[section], TableErrors(scene.name)
    tables = getattr(scene, name)
    if len(tables) > 1:
        raise SceneError(f"{scene.name}: {section}.{key} cannot be set for {len(tables)} [[{section}]] tables at once; "
                         f"write `{key}` into the [[{section}]] tables of the scene file")  # fmt: skip
    if key == "radius_cm" and tables[0].polygon:
        raise SceneError(f"{scene.name}: objects.radius_cm has no effect in this scene; change `polygon`")
    if key == "count" and tables[0].place == "poses":
        raise SceneError(f"{scene.name}: {section}.count is the number of listed poses; write all `poses` "
                         f'into [[{section}]] of the scene file, or another `place` than "poses"')  # fmt: skip
    changed: dict[str, Any] = {name: (_table(errors, section, LISTS[name], {key: value}, tables[0], 0),)}
    return _counted(replace(scene, **changed))


def _check_has_effect(scene: Scene, section: str, key: str) -> None:
    """Raise SceneError if other values of the scene replace a value."""
    instead = ""
    if (section, key) == ("infrared", "object_share") and scene.kinds:
        instead = "`share` in the [[objects]] tables"
    elif section == "arena" and key in ("width_cm", "height_cm") and scene.arena.polygon:
        instead = "`polygon` in [arena]"
    elif (
        section == "start"
        and key in _OF_GROUP
        and scene.groups
        and all(getattr(group, key) != _OF_GROUP[key] for group in scene.groups)
    ):
        instead = f"`{key}` in the [[robots]] tables"
    if instead:
        raise SceneError(f"{scene.name}: {section}.{key} has no effect in this scene; change {instead}")


_OF_GROUP: Final = {"selector": -1, "remote": INHERIT, "stimulus": INHERIT}
"""Keys of a group that replace the keys of [start], and their default values, which leave [start] in force."""


def scripted(scene: Scene) -> Scene:
    """Return the scene with the longer quantum of scripted controllers."""
    return scene.with_values(clock__quantum_ms=scene.clock.scripted_quantum_ms)


def scenes() -> list[str]:
    """Return the names of the included scenes."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_scene(name: str) -> Scene:
    """Load a scene by name, or from the TOML file at a path. Raises SceneError."""
    path = Path(name) if name.endswith(".toml") or is_standard(name) else FOLDER / f"{name}.toml"
    try:
        text = read_file(path).decode()
        data = tomllib.loads(text.replace("\r\n", "\n"))
    except FileNotFoundError:
        raise SceneError(f"there is no scene {name!r}; known: {', '.join(scenes())}, or a path to a .toml") from None
    except UnicodeDecodeError as error:
        raise SceneError(f"{path}:{error.object[: error.start].count(10) + 1}: is not UTF-8 text") from None
    except tomllib.TOMLDecodeError as error:
        line = re.search(r"at line (\d+)", str(error))
        at = int(line[1]) if line else text.count("\n") + 1
        raise SceneError(f"{path}:{at}: {error}") from None
    except (OSError, RecursionError, ValueError) as error:
        raise SceneError(f"{path}: {error}") from None
    errors = TableErrors(str(path), text)
    _read_poses(errors, data, path.parent)
    return _checked(_scene(errors, data), errors)


def _read_poses(errors: TableErrors, data: dict[str, Any], home: Path) -> None:
    """Replace names of files in `poses` of [[robots]] and [[objects]] by their content. Raises SceneError."""
    for name in _LIST_OF:
        tables = data.get(name)
        for number, table in enumerate(tables if isinstance(tables, list) else ()):
            file = table.get("poses") if isinstance(table, dict) else None
            if isinstance(file, str):
                table["poses"] = _poses_in(errors, name, home / file, number)


def _poses_in(errors: TableErrors, table: str, file: Path, number: int) -> list[list[float]]:
    """Return the poses in a file, one `x,y` or `x,y,degrees` per line; empty lines and # comments are skipped."""
    poses = []
    try:
        lines = read_file(file).decode().splitlines()
    except (OSError, ValueError) as error:
        raise errors.at(table, "poses", f"{table}.poses: {error}", number) from None
    for at, line in enumerate(lines, start=1):
        text = line.partition("#")[0].strip()
        try:
            pose = [float(value) for value in text.split(",")] if text else []
        except ValueError:
            pose = [math.nan]
        if text and (len(pose) not in (2, 3) or not all(map(math.isfinite, pose))):
            raise errors.at(table, "poses", f"{table}.poses: {file}:{at}: {text!r:.60}; expected x,y or x,y,degrees",
                            number)  # fmt: skip
        if pose:
            poses.append(pose)
    return poses


def scene_of(values: dict[str, Any]) -> Scene:
    """Return the scene of a record from its metadata. Raises SceneError if this version cannot build it."""
    errors = TableErrors("the record")
    return _checked(_scene(errors, values), errors)


def _scene(errors: TableErrors, data: dict[str, Any]) -> Scene:
    values: dict[str, Any] = {}
    for key, value in data.items():
        is_list = isinstance(value, list) and all(isinstance(one, dict) for one in value)
        name = _LIST_OF.get(key, key)
        if key in ("name", "description", "experiment") and isinstance(value, str):
            values[key] = value
        elif key == "chassis" and isinstance(value, dict):
            if "count" in value:
                raise errors.at("chassis", "count", "chassis.count: the groups determine the number of robots")
            values["robots"] = _table(errors, "chassis", Robots, value, values.get("robots", Robots()))
        elif key in TABLES and isinstance(value, dict):
            values[key] = _table(errors, key, TABLES[key], value, TABLES[key]())
        elif name in LISTS and is_list:
            kind = LISTS[name]
            values[name] = tuple(_table(errors, key, kind, one, kind(), n) for n, one in enumerate(value))
        else:
            known = "name", "description", "experiment", "chassis", *TABLES, "obstacles", "patches", "lamps"
            raise errors.at(key, "", f"unexpected {key!r}; expected {', '.join(known)}")
    if "name" not in values:
        raise errors.at("", "name", "a scene needs a name")
    if values.get("groups") and "objects" not in values and "kinds" not in values:
        values["objects"] = Objects(count=0)  # a scene with groups of robots has only the objects it lists
    scene = _counted(Scene(**values))
    for name, long, tables in (("robots", "groups", scene.groups), ("objects", "kinds", scene.kinds)):
        for number, (given, one) in enumerate(zip(data.get(long) or data.get(name, ()), tables, strict=False)):
            check_given(errors, name, given, one, number)
    return scene


def _numbered(one: K) -> K:
    """Return a table with its count of listed poses, and with the radius of its polygon's circumscribed circle."""
    if isinstance(one, ObjectKind) and len(one.polygon) >= 3 and geometry.area(one.polygon):
        one = replace(one, radius_cm=max(math.hypot(x, y) for x, y in geometry.centred(one.polygon)))
    return replace(one, count=len(one.poses)) if one.place == "poses" else one


def _counted(scene: Scene) -> Scene:
    """Return the scene with the counts of robots and objects as sums of their kinds, and the size of a polygon."""
    groups, kinds = tuple(map(_numbered, scene.groups)), tuple(map(_numbered, scene.kinds))
    scene = replace(scene, groups=groups, kinds=kinds)
    if groups:
        scene = replace(scene, robots=replace(scene.robots, count=sum(one.count for one in groups)))
    if kinds:
        scene = replace(scene, objects=replace(scene.objects, count=sum(one.count for one in kinds)))
    if scene.arena.polygon and all(len(point) == 2 for point in scene.arena.polygon):
        width, height = (max(point[axis] for point in scene.arena.polygon) for axis in (0, 1))
        scene = replace(scene, arena=replace(scene.arena, width_cm=width, height_cm=height))
    return scene


def _table(
    errors: TableErrors, name: str, kind: type[T], values: dict[str, Any], base: T, number: int | None = None
) -> T:
    known = {one.name: type(getattr(base, one.name)) for one in fields(kind)}  # type: ignore[arg-type]
    taken: dict[str, Any] = {}
    for key, value in values.items():
        if key not in known:
            raise errors.at(name, key, f"unknown key {name}.{key}; expected {', '.join(known)}", number)
        want = known[key]
        if want is float and value == "inf":
            value = math.inf
        if want is float and value is None:  # a record's JSON has no nan
            value = math.nan
        if want is float and type(value) is int:
            try:
                value = float(value)
            except OverflowError:
                raise errors.at(name, key, f"{name}.{key}: the number is too large", number) from None
        if want is tuple:
            wrong = wrong_points(value)
            if wrong:
                raise errors.at(name, key, f"{name}.{key}: {wrong}", number)
            value = tuple(tuple(map(float, one)) for one in value)
        if type(value) is not want:
            raise errors.at(name, key, f"{name}.{key} is {value!r}; expected {want.__name__}", number)
        taken[key] = value
    return replace(base, **taken)  # type: ignore[type-var]


def _checked(scene: Scene, errors: TableErrors) -> Scene:
    """Validate all values of a scene. Raises SceneError."""
    if not NAME.fullmatch(scene.name):
        raise errors.at("", "name", f"name is {scene.name!r}; expected up to 64 letters, digits, blanks and -_., "
                        "a letter or digit first: results go into a folder of this name")  # fmt: skip
    check_key(errors, "start", scene.start.remote)
    check_overhead(errors, scene.kilobots.overhead)
    check_losses(errors, scene.kilobots)
    for name in LISTS:
        table = {"groups": "robots", "kinds": "objects"}.get(name, name)
        for number, one in enumerate(getattr(scene, name)):
            check_limits(errors, table, one, number)
            CHECKS.get(name, check_shape)(errors, table, one, number)
    for name in TABLES:
        check_limits(errors, name, getattr(scene, name))
    if not 0 <= scene.robots.count <= 10_000 or not 0 <= scene.objects.count <= 10_000:
        words = f"{scene.robots.count} robots and {scene.objects.count} objects; expected at most 10000 of each"
        raise errors.at("robots", "count", words)
    check_colour(errors, "robots", scene.robots, None)
    check_links(errors, scene.bluetooth.links, [scene.robot_kind(one).name for one in range(scene.robots.count)])
    check_off(errors, scene.start.off, scene.robots.count)
    if scene.start.robot_poses or scene.start.object_poses:
        check_start_poses(errors, "robot_poses", scene.start.robot_poses, [3] * scene.robots.count)
        sizes = [3 if scene.kind_of(number).polygon else 2 for number in range(scene.objects.count)]
        check_start_poses(errors, "object_poses", scene.start.object_poses, sizes)
    if scene.arena.polygon and not scene.arena.walls:
        raise errors.at("arena", "walls", "arena.walls = false has no effect beside `polygon`; remove one of them")
    if scene.arena.polygon:
        check_polygon(errors, "arena", scene.arena.polygon, None)
        if min(value for point in scene.arena.polygon for value in point) < 0:
            raise errors.at("arena", "polygon", "arena.polygon: corners are 0 or more cm from the lower left")
    return scene
