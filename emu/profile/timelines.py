"""Timelines of a profile for speedscope and Perfetto, as the text of their files.

speedscope: its file-format-schema, with evented profiles in Tcy, one per thread and interrupt level. Perfetto: the
"Trace Event Format" of Chrome, with slices on a track per thread and level, and flows. Flows lead from an interrupt
request to its handler, and from the sending of an OpenSwarm event to the first listener of its delivery round. Times
are in µs with fractions; the exact cycle is in `args`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from json import dumps
from typing import Any, Final

from emu.profile.cycle_shares import CodeLocation
from emu.profile.tracks import MAIN, Track, Tracks

SENDS: Final = ("Sys_Send_Event", "Sys_Send_IntEvent")
DELIVERIES: Final = frozenset({"run_handlers", "evaluate_conditions"})
"""Kernel functions, inlined or not, that call the listeners of an event (firmware/openswarm/kernel/event.c)."""
ROBOT: Final = 1
"""Process number of the single robot."""
LEVEL_TRACKS: Final = 10
"""Thread number of interrupt level 0. Numbers of threads follow those of the levels."""


def speedscope(
    tracks: Tracks, location_of: Callable[[int], CodeLocation], name: str, start: int, end: int
) -> Iterator[str]:
    """Yield the text of a speedscope file in parts."""
    frames: list[dict[str, Any]] = []
    known: dict[int, int] = {}
    profiles: dict[Track, list[str]] = {}
    for event in tracks.events:
        number = known.get(event.entry)
        if number is None:
            function, file, line = location_of(event.entry)
            number = known[event.entry] = len(frames)
            frames.append({"name": function.removeprefix("_")} | ({"file": file, "line": line} if file else {}))
        profiles.setdefault(event.track, []).append(
            f'{{"type": "{"O" if event.begins else "C"}", "frame": {number}, "at": {event.cycle}}}'
        )
    about = {
        "$schema": "https://www.speedscope.app/file-format-schema.json",
        "exporter": "emu profile",
        "name": name,
        "activeProfileIndex": 0,
        "shared": {"frames": frames},
    }
    yield dumps(about)[:-1] + ', "profiles": ['
    for place, (track, events) in enumerate(sorted(profiles.items(), key=lambda one: _thread_number(one[0]))):
        about = {"type": "evented", "name": tracks.title(track), "unit": "none", "startValue": start, "endValue": end}
        yield (", " if place else "") + dumps(about)[:-1] + ', "events": ['
        yield ", ".join(events) + "]}"
    yield "]}"


def _thread_number(track: Track) -> int:
    """Return the sort number of a track: main first, then levels, then threads."""
    stack, number = track
    if track == MAIN:
        return 0
    return LEVEL_TRACKS + number if stack < 0 else 100 * (stack + 1) + number


def perfetto(
    tracks: Tracks,
    location_of: Callable[[int], CodeLocation],
    name: str,
    hz: float,
    inside: Callable[[int], frozenset[str]],
) -> Iterator[str]:
    """Yield the text of a file in the Trace Event Format in parts.

    `hz`: cycles per second. `inside(pc)`: returns the functions that contain an address, including inlined ones.
    """
    whole = dumps({"traceEvents": [], "displayTimeUnit": "ns", "otherData": {"cycles_per_second": hz}})
    first, last = whole.split("]", 1)
    process = {"ph": "M", "pid": ROBOT, "tid": 0, "name": "process_name", "args": {"name": name}}
    yield first + dumps(process)
    seen: set[Track] = set()
    for piece in _events(tracks, location_of, hz, inside, seen):
        yield ", " + piece
    titles = {_thread_number(track): tracks.title(track) for track in seen} | {LEVEL_TRACKS - 1: "requests"}
    for number, title in sorted(titles.items()):
        about = {"ph": "M", "pid": ROBOT, "tid": number}
        yield ", " + dumps(about | {"name": "thread_name", "args": {"name": title}})
        yield ", " + dumps(about | {"name": "thread_sort_index", "args": {"sort_index": number}})
    yield "]" + last


def _events(
    tracks: Tracks, location_of: Callable[[int], CodeLocation], hz: float, inside: Callable[[int], frozenset[str]],
    seen: set[Track],
) -> Iterator[str]:  # fmt: skip
    """Yield the events one by one as text, because a second has tens of thousands. Add their tracks to `seen`."""
    sent: list[str] = []
    flows = 0
    texts: dict[int, tuple[str, str, str]] = {}
    numbers: dict[Track, int] = {}

    def at(cycle: int) -> float:
        return round(cycle * 1e6 / hz, 3)

    for event in tracks.events:
        known = texts.get(event.entry)
        if known is None:
            function, file, line = location_of(event.entry)
            function = function.removeprefix("_")
            source = f', "source": {dumps(f"{file}:{line}")}' if file else ""
            known = texts[event.entry] = function, dumps(function), source
        function, quoted, source = known
        track = numbers.get(event.track)
        if track is None:
            track = numbers[event.track] = _thread_number(event.track)
            seen.add(event.track)
        base = f'"pid": {ROBOT}, "tid": {track}, "ts": {at(event.cycle)!r}'
        if event.begins:
            yield f'{{"ph": "B", "name": {quoted}, "args": {{"cycle": {event.cycle}{source}}}, {base}}}'
        else:
            yield f'{{"ph": "E", "name": {quoted}, "args": {{"cycle": {event.cycle}}}, {base}}}'
        if not (event.begins and event.is_new):
            continue
        if event.track[0] < 0 and event.since:
            flows += 1
            request = f'"pid": {ROBOT}, "tid": {LEVEL_TRACKS - 1}, "cat": "interrupt", "name": {quoted}'
            since = at(event.since)
            yield (f'{{{request}, "ph": "X", "ts": {since!r}, "dur": {at(event.cycle - event.since)!r}, '
                   f'"args": {{"cycle": {event.since}}}}}')  # fmt: skip
            yield f'{{{request}, "ph": "s", "id": {flows}, "ts": {since!r}}}'
            yield f'{{{base}, "ph": "f", "bp": "e", "id": {flows}, "cat": "interrupt", "name": {quoted}}}'
        elif function in SENDS:
            flows += 1
            sent.append(f'"id": {flows}, "cat": "event", "name": "event"')
            yield f'{{{base}, "ph": "s", {sent[-1]}}}'
        elif sent and DELIVERIES & inside(event.site):
            yield from (f'{{{base}, "ph": "f", "bp": "e", {one}}}' for one in sent)
            sent.clear()
