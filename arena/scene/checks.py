"""Checks of the tables of a scene, and errors that name file, line and key."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, Final

from arena.scene import geometry
from arena.scene.limits import LIMITS
from arena.scene.robot_kind import KINDS
from arena.scene.schema import INHERIT, NAMED, PLACES, Kilobots, ObjectKind, Points, RobotGroup
from emu.boards.epuck.remote import KEYS
from emu.boards.kilobot.messages import MOST_UID, TYPES

COLOUR: Final = re.compile(r"#[0-9a-fA-F]{6}")
MOST_SECONDS: Final = 1e7
"""Longest time in seconds of a command of the overhead controller."""
CONTROLLER: Final = re.compile(r"|A|B|[a-z][a-z0-9_]*|[^\0]+\.py")
"""Pattern of `controller`: empty, table A or B, an entry point, or a Python file."""


class SceneError(ValueError):
    """A scene cannot be read or built; the message names the file, the key, and the line if there is one."""


class TableErrors:
    """Creates errors with the line in the file, found by a search for table and key: the TOML parser reports none."""

    def __init__(self, path: str, text: str = "") -> None:
        self._path = path
        self._lines = text.splitlines()

    def at(self, table: str, key: str, words: str, number: int | None = None) -> SceneError:
        """Return an error about a key of a table, or about the table itself if `key` is empty.

        `number`: position among the tables of that name, from 0; None if there is one table.
        """
        line = self._find(table, key, number) if self._lines else None
        return SceneError(f"{self._path}{f':{line}' if line else ''}: {words}")

    def _find(self, table: str, key: str, number: int | None) -> int | None:
        here, seen, start = "", -1, None
        for place, line in enumerate(self._lines, start=1):
            head = re.match(r"\s*\[\[?\s*([A-Za-z0-9_.\"'-]+)\s*\]?\]", line)
            if head:
                here = head[1].strip("\"'")
                if here == table:
                    seen += 1
                    if start is None or seen == number:
                        start = place
            elif not key and here:
                continue
            elif here == table and (number is None or seen == number):
                if re.match(rf"\s*[\"']?{re.escape(key)}[\"']?\s*[=.]", line):
                    return place
            elif not here and table and re.match(rf"\s*[\"']?{re.escape(table)}[\"']?\s*[=.]", line):
                start = place
        return start


def wrong_points(value: Any) -> str:
    """Return what is wrong with a list of points, or an empty text."""
    if not isinstance(value, (list, tuple)) or not all(isinstance(one, (list, tuple)) for one in value):
        return "expected a list of points, [[x, y], ...]"
    for one in value:
        if len(one) not in (2, 3) or not all(type(number) in (int, float) and abs(number) < 1e6 for number in one):
            return f"{list(one)}: expected a point [x, y] in cm or a pose [x, y, degrees]"
    return ""


def check_links(errors: TableErrors, links: Points, kinds: Sequence[str]) -> None:
    """Check the Bluetooth links between robots of some kinds."""
    robots = len(kinds)
    taken: set[frozenset[float]] = set()
    for link in links:
        ends = frozenset(link)
        words = ""
        if len(link) != 2 or len(ends) != 2 or not all(end in range(robots) for end in ends):
            words = f"expected two different robots of 0 to {robots - 1}"
        elif "kilobot" in (kinds[int(end)] for end in link):
            words = "a Kilobot has no Bluetooth; its messages go by infrared light"
        elif ends in taken:
            words = "is listed twice"
        if words:
            raise errors.at("bluetooth", "links", f"bluetooth.links: {[f'{end:g}' for end in link]}: {words}")
        taken.add(ends)


def check_off(errors: TableErrors, off: Points, robots: int) -> None:
    """Check `start.off`: each of the `robots` robots at most once, with a second of the trial. Raises SceneError."""
    taken: set[float] = set()
    for one in off:
        if len(one) != 2 or one[0] not in range(robots) or one[1] < 0 or one[0] in taken:
            words = f"expected a robot of 0 to {robots - 1}, once, and a second of the trial"
            raise errors.at("start", "off", f"start.off: {[f'{value:g}' for value in one]}: {words}")
        taken.add(one[0])


def check_start_poses(errors: TableErrors, key: str, poses: Points, sizes: Sequence[int]) -> None:
    """Check `start.robot_poses` or `start.object_poses`; `sizes` are the lengths of the bodies' poses."""
    if len(poses) != len(sizes):
        words = f"start.{key} has {len(poses)} poses; expected one for each of {len(sizes)} bodies"
        raise errors.at("start", key, words)
    for number, (pose, size) in enumerate(zip(poses, sizes, strict=True)):
        if len(pose) != size:
            words = f"start.{key}: pose {number} has {len(pose)} numbers; expected " + ("x, y, degrees" if size == 3
                                                                                        else "x, y")  # fmt: skip
            raise errors.at("start", key, words)


def check_limits(errors: TableErrors, name: str, table: Any, number: int | None = None) -> None:
    """Check the numbers of a table against `limits.LIMITS`. Raises SceneError."""
    for key, (low, high) in LIMITS[type(table)].items():
        value = getattr(table, key)
        if not low <= value <= high and not (_is_nan(value) and _is_nan(getattr(type(table)(), key))):
            raise errors.at(name, key, f"{name}.{key} is {value}; expected {low} to {high}", number)


def _is_nan(value: float) -> bool:
    """Whether a number is nan. `math.isnan` raises an exception for integers beyond the range of float."""
    return value != value


def check_key(errors: TableErrors, table: str, key: str, number: int | None = None) -> None:
    """Check the key of the remote control. Raises SceneError."""
    if key not in ("", INHERIT, *KEYS, *map(str, range(64))):
        words = f"{table}.remote is {key!r}; expected {', '.join(KEYS)}, 0 to 63, or empty"
        raise errors.at(table, "remote", words, number)


def overhead_commands(text: str) -> list[tuple[float, str, float]]:
    """Return the commands of the overhead controller in order: start in s, command, and for how many s. Raises
    ValueError with the wrong part."""
    found: list[tuple[float, str, float]] = []
    for part in filter(None, map(str.strip, text.split(";"))):
        words = part.split()
        if len(words) != 3 or words[1] not in TYPES:
            raise ValueError(part)
        try:
            start, seconds = float(words[0]), float(words[2])
        except ValueError:
            raise ValueError(part) from None
        after = found[-1][0] + found[-1][2] if found else 0.0
        if not (after <= start <= MOST_SECONDS and 0 < seconds <= MOST_SECONDS):
            raise ValueError(part)
        found.append((start, words[1], seconds))
    return found


def check_losses(errors: TableErrors, setting: Kilobots) -> None:
    """Check the light pulses that Kilobots miss. Raises SceneError."""
    points, words = setting.lost_at, ""
    if any(len(point) != 2 or point[0] < 0 or not 0 <= point[1] < 1 for point in points):
        words = "expected points [cm, share], with distances of 0 or more and shares of 0 to less than 1"
    elif any(after[0] <= before[0] for before, after in pairwise(points)):
        words = "expected rising distances"
    elif points and setting.lost_share:
        words = "replaces lost_share; remove one of them"
    if words:
        raise errors.at("kilobots", "lost_at", f"kilobots.lost_at: {words}")


def check_overhead(errors: TableErrors, text: str) -> None:
    """Check the commands of the overhead controller. Raises SceneError."""
    try:
        overhead_commands(text)
    except ValueError as error:
        words = (f'kilobots.overhead: {str(error)!r:.60}: expected "SECOND COMMAND SECONDS; ...", one after the other, '
                 f"with a command of {', '.join(TYPES)}")  # fmt: skip
        raise errors.at("kilobots", "overhead", words) from None


def check_placed(errors: TableErrors, table: str, one: Any, number: int) -> None:
    """Check the placement of a table. Raises SceneError."""
    if one.place not in PLACES:
        words = f"{table}.place is {one.place!r}; expected {', '.join(PLACES)}"
        raise errors.at(table, "place", words, number)
    if (one.place == "poses") != bool(one.poses):
        words = f'{table}.poses goes with place = "poses", and only with it'
        raise errors.at(table, "poses" if one.poses else "place", words, number)


def check_given(errors: TableErrors, table: str, given: Mapping[str, Any], one: Any, number: int) -> None:
    """Check that the file sets no key that another key of the same table determines or makes useless: `count` beside
    `poses`, `radius_cm` beside `polygon`. Raises SceneError."""
    if one.place == "poses" and given.get("count", one.count) != one.count:
        words = f"{table}.count is {given['count']}, but {len(one.poses)} poses are listed; remove it"
        raise errors.at(table, "count", words, number)
    if getattr(one, "polygon", ()) and given.get("radius_cm", one.radius_cm) != one.radius_cm:
        raise errors.at(table, "radius_cm", f"{table}.radius_cm has no effect beside `polygon`; remove it", number)


def check_group(errors: TableErrors, table: str, one: RobotGroup, number: int) -> None:
    """Check a table [[robots]]. Raises SceneError."""
    check_placed(errors, table, one, number)
    if one.kind not in KINDS:
        raise errors.at(table, "kind", f"{table}.kind is {one.kind!r}; expected {', '.join(KINDS)}", number)
    check_key(errors, table, one.remote, number)
    if abs(one.heading_deg) > 1e6:
        words = f"{table}.heading_deg is {one.heading_deg}; expected -1e6 to 1e6, or nan for any"
        raise errors.at(table, "heading_deg", words, number)
    if not CONTROLLER.fullmatch(one.controller):
        words = f"{table}.controller is {one.controller!r}; expected A, B, the path of a .py file, or an entry point"
        raise errors.at(table, "controller", words, number)
    if one.kind == "kilobot":
        check_kilobots(errors, table, one, number)
    if one.image and one.controller not in ("", "A", "B"):
        words = f"{table}.controller {one.controller!r} runs in Python; a group with an `image` runs firmware"
        raise errors.at(table, "controller", words, number)


def check_kilobots(errors: TableErrors, table: str, one: RobotGroup, number: int) -> None:
    """Check a table [[robots]] of Kilobots. Raises SceneError."""
    if one.controller:
        words = f"{table}.controller {one.controller!r} drives an e-puck; a Kilobot runs an `image`"
        raise errors.at(table, "controller", words, number)
    for key, value in (("selector", -1), ("remote", INHERIT), ("stimulus", INHERIT)):
        if getattr(one, key) != value:
            words = f"{table}.{key} has no effect on a Kilobot; it takes commands of `overhead` in [kilobots]"
            raise errors.at(table, key, words, number)
    if one.id_first + one.count - 1 > MOST_UID:
        words = f"{table}.id_first is {one.id_first}: the UIDs of {one.count} Kilobots go beyond {MOST_UID}"
        raise errors.at(table, "id_first", words, number)


def check_kind(errors: TableErrors, table: str, one: ObjectKind, number: int) -> None:
    """Check a table [[objects]]. Raises SceneError."""
    check_placed(errors, table, one, number)
    check_colour(errors, table, one, number)
    if not one.polygon and any(len(pose) != 2 for pose in one.poses):
        raise errors.at(table, "poses", f"{table}.poses: an object without a polygon is a disc: [x, y]", number)
    if one.polygon:
        check_polygon(errors, table, one.polygon, number)
        if not geometry.is_convex(one.polygon):
            raise errors.at(table, "polygon", f"{table}.polygon: a movable polygon must be convex", number)


def check_colour(errors: TableErrors, table: str, one: Any, number: int | None) -> None:
    """Check the colour of a table. Raises SceneError."""
    if one.colour not in NAMED and not COLOUR.fullmatch(one.colour):
        words = f"{table}.colour is {one.colour!r}; expected {', '.join(NAMED)} or #rrggbb"
        raise errors.at(table, "colour", words, number)


def check_shape(errors: TableErrors, table: str, one: Any, number: int) -> None:
    """Check an obstacle or a patch: a polygon or a disc. Raises SceneError."""
    check_colour(errors, table, one, number)
    if bool(one.polygon) == bool(one.radius_cm):
        raise errors.at(table, "polygon", f"{table}: expected either a polygon or a radius_cm", number)
    if one.polygon:
        check_polygon(errors, table, one.polygon, number)


def check_polygon(errors: TableErrors, table: str, points: tuple[tuple[float, ...], ...], number: int | None) -> None:
    """Check the corners of a polygon. Raises SceneError."""
    if len(points) < 3 or any(len(point) != 2 for point in points):
        raise errors.at(table, "polygon", f"{table}.polygon: expected three or more corners [x, y]", number)
    if not geometry.is_simple(points):
        raise errors.at(table, "polygon", f"{table}.polygon: its sides cross, or it has no area", number)


CHECKS: Final[Mapping[str, Callable[[TableErrors, str, Any, int], None]]] = {
    "groups": check_group,
    "kinds": check_kind,
    "lamps": lambda _errors, _table, _one, _number: None,
}
