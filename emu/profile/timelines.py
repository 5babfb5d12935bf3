"""Timelines of a profile for speedscope and for Perfetto, as the text of their files.

speedscope: its file-format-schema, evented profiles in Tcy, one for every thread and interrupt level. Perfetto: the
"Trace Event Format" of Chrome: slices on a track per thread and level, requests of interrupts as flows to their
handlers, OpenSwarm's events as flows from where they are sent to the first listener of the round that delivers them.
Its times are in µs with fractions; the exact cycle is in `args`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from json import dumps
from typing import Any, Final

from emu.profile.cycle_shares import CodeLocation
from emu.profile.tracks import MAIN, Track, Tracks

SENDS: Final = ("Sys_Send_Event", "Sys_Send_IntEvent")
DELIVERIES: Final = frozenset({"run_handlers", "evaluate_conditions"})
"""Of the kernel, inlined or not: what calls the listeners of an event (firmware/openswarm/kernel/event.c)."""
ROBOT: Final = 1
"""Process number of the one robot."""
LEVEL_TRACKS: Final = 10
"""Thread number of level 0; the threads' come behind the levels'."""


def speedscope(
    tracks: Tracks, place_of: Callable[[int], CodeLocation], name: str, start: int, end: int
) -> Iterator[str]:
    """A speedscope file, in pieces."""
    frames: list[dict[str, Any]] = []
    known: dict[int, int] = {}
    profiles: dict[Track, list[str]] = {}
    for mark in tracks.marks:
        number = known.get(mark.entry)
        if number is None:
            function, file, line = place_of(mark.entry)
            number = known[mark.entry] = len(frames)
            frames.append({"name": function.removeprefix("_")} | ({"file": file, "line": line} if file else {}))
        profiles.setdefault(mark.track, []).append(
            f'{{"type": "{"O" if mark.begins else "C"}", "frame": {number}, "at": {mark.cycle}}}'
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
    """Main first, then levels, then threads."""
    stack, number = track
    if track == MAIN:
        return 0
    return LEVEL_TRACKS + number if stack < 0 else 100 * (stack + 1) + number


def perfetto(
    tracks: Tracks,
    place_of: Callable[[int], CodeLocation],
    name: str,
    hz: float,
    inside: Callable[[int], frozenset[str]],
) -> Iterator[str]:
    """A file in the Trace Event Format, in pieces. `hz` is the number of cycles in a second; `inside` gives the
    functions around an address, inlined ones too."""
    whole = dumps({"traceEvents": [], "displayTimeUnit": "ns", "otherData": {"cycles_per_second": hz}})
    first, last = whole.split("]", 1)
    process = {"ph": "M", "pid": ROBOT, "tid": 0, "name": "process_name", "args": {"name": name}}
    yield first + dumps(process)
    seen: set[Track] = set()
    for piece in _events(tracks, place_of, hz, inside, seen):
        yield ", " + piece
    titles = {_thread_number(track): tracks.title(track) for track in seen} | {LEVEL_TRACKS - 1: "requests"}
    for number, title in sorted(titles.items()):
        about = {"ph": "M", "pid": ROBOT, "tid": number}
        yield ", " + dumps(about | {"name": "thread_name", "args": {"name": title}})
        yield ", " + dumps(about | {"name": "thread_sort_index", "args": {"sort_index": number}})
    yield "]" + last


def _events(
    tracks: Tracks, place_of: Callable[[int], CodeLocation], hz: float, inside: Callable[[int], frozenset[str]],
    seen: set[Track],
) -> Iterator[str]:  # fmt: skip
    """Events as text: there are tens of thousands in a second. `seen` gets their tracks."""
    sent: list[str] = []
    flows = 0
    texts: dict[int, tuple[str, str, str]] = {}
    numbers: dict[Track, int] = {}

    def at(cycle: int) -> float:
        return round(cycle * 1e6 / hz, 3)

    for mark in tracks.marks:
        known = texts.get(mark.entry)
        if known is None:
            function, file, line = place_of(mark.entry)
            function = function.removeprefix("_")
            source = f', "source": {dumps(f"{file}:{line}")}' if file else ""
            known = texts[mark.entry] = function, dumps(function), source
        function, quoted, source = known
        track = numbers.get(mark.track)
        if track is None:
            track = numbers[mark.track] = _thread_number(mark.track)
            seen.add(mark.track)
        base = f'"pid": {ROBOT}, "tid": {track}, "ts": {at(mark.cycle)!r}'
        if mark.begins:
            yield f'{{"ph": "B", "name": {quoted}, "args": {{"cycle": {mark.cycle}{source}}}, {base}}}'
        else:
            yield f'{{"ph": "E", "name": {quoted}, "args": {{"cycle": {mark.cycle}}}, {base}}}'
        if not (mark.begins and mark.is_new):
            continue
        if mark.track[0] < 0 and mark.since:
            flows += 1
            request = f'"pid": {ROBOT}, "tid": {LEVEL_TRACKS - 1}, "cat": "interrupt", "name": {quoted}'
            since = at(mark.since)
            yield (f'{{{request}, "ph": "X", "ts": {since!r}, "dur": {at(mark.cycle - mark.since)!r}, '
                   f'"args": {{"cycle": {mark.since}}}}}')  # fmt: skip
            yield f'{{{request}, "ph": "s", "id": {flows}, "ts": {since!r}}}'
            yield f'{{{base}, "ph": "f", "bp": "e", "id": {flows}, "cat": "interrupt", "name": {quoted}}}'
        elif function in SENDS:
            flows += 1
            sent.append(f'"id": {flows}, "cat": "event", "name": "event"')
            yield f'{{{base}, "ph": "s", {sent[-1]}}}'
        elif sent and DELIVERIES & inside(mark.site):
            yield from (f'{{{base}, "ph": "f", "bp": "e", {one}}}' for one in sent)
            sent.clear()
