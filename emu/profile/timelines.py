"""Timelines of a profile for speedscope and for Perfetto, as plain data to be written as JSON.

speedscope: its file-format-schema, evented profiles in Tcy, one for every thread and interrupt level. Perfetto: the
"Trace Event Format" of Chrome: slices on a track per thread and level, requests of interrupts as flows to their
handlers, OpenSwarm's events as flows from where they are sent to the first listener of the round that delivers them.
Its times are in µs with fractions; the exact cycle is in `args`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from emu.profile.shares import Place
from emu.profile.tracks import MAIN, Track, Tracks

SENDS: Final = ("Sys_Send_Event", "Sys_Send_IntEvent")
DELIVERIES: Final = frozenset({"run_handlers", "ask_waiters"})
"""Of the kernel, inlined or not: what calls the listeners of an event (firmware/openswarm/kernel/event.c)."""
ROBOT: Final = 1
"""Process number of the one robot."""
LEVEL_TRACKS: Final = 10
"""Thread number of level 0; the threads' come behind the levels'."""


def speedscope(tracks: Tracks, place_of: Callable[[int], Place], name: str, start: int, end: int) -> dict[str, Any]:
    """A speedscope file."""
    frames: list[dict[str, Any]] = []
    known: dict[int, int] = {}
    profiles: dict[Track, list[dict[str, Any]]] = {}
    for mark in tracks.marks:
        number = known.get(mark.entry)
        if number is None:
            function, file, line = place_of(mark.entry)
            number = known[mark.entry] = len(frames)
            frames.append({"name": function.removeprefix("_")} | ({"file": file, "line": line} if file else {}))
        profiles.setdefault(mark.track, []).append(
            {"type": "O" if mark.begins else "C", "frame": number, "at": mark.cycle}
        )
    return {
        "$schema": "https://www.speedscope.app/file-format-schema.json",
        "exporter": "emu profile",
        "name": name,
        "activeProfileIndex": 0,
        "shared": {"frames": frames},
        "profiles": [
            {
                "type": "evented",
                "name": tracks.title(track),
                "unit": "none",
                "startValue": start,
                "endValue": end,
                "events": events,
            }
            for track, events in sorted(profiles.items(), key=lambda one: _thread_number(one[0]))
        ],
    }


def _thread_number(track: Track) -> int:
    """Main first, then levels, then threads."""
    stack, number = track
    if track == MAIN:
        return 0
    return LEVEL_TRACKS + number if stack < 0 else 100 * (stack + 1) + number


def perfetto(
    tracks: Tracks,
    place_of: Callable[[int], Place],
    name: str,
    hz: float,
    inside: Callable[[int], frozenset[str]],
) -> dict[str, Any]:
    """A file in the Trace Event Format. `hz` is the number of cycles in a second; `inside` gives the functions around
    an address, inlined ones too."""
    events: list[dict[str, Any]] = [
        {"ph": "M", "pid": ROBOT, "tid": 0, "name": "process_name", "args": {"name": name}},
    ]
    seen: set[Track] = set()
    sent: list[dict[str, Any]] = []
    flows = 0

    def at(cycle: int) -> float:
        return round(cycle * 1e6 / hz, 3)

    for mark in tracks.marks:
        function, file, line = place_of(mark.entry)
        function, track = function.removeprefix("_"), _thread_number(mark.track)
        base = {"pid": ROBOT, "tid": track, "ts": at(mark.cycle)}
        seen.add(mark.track)
        source = {"source": f"{file}:{line}"} if mark.begins and file else {}
        events.append({"ph": "B" if mark.begins else "E", "name": function, "args": {"cycle": mark.cycle} | source})
        events[-1] |= base
        if not (mark.begins and mark.is_new):
            continue
        if mark.track[0] < 0 and mark.since:
            flows += 1
            request = {"pid": ROBOT, "tid": LEVEL_TRACKS - 1, "cat": "interrupt", "name": function}
            events.append(request | {
                "ph": "X", "ts": at(mark.since), "dur": at(mark.cycle - mark.since), "args": {"cycle": mark.since},
            })  # fmt: skip
            events.append(request | {"ph": "s", "id": flows, "ts": at(mark.since)})
            events.append(base | {"ph": "f", "bp": "e", "id": flows, "cat": "interrupt", "name": function})
        elif function in SENDS:
            flows += 1
            sent.append({"id": flows, "cat": "event", "name": "event"})
            events.append(base | {"ph": "s"} | sent[-1])
        elif sent and DELIVERIES & inside(mark.site):
            events += [base | {"ph": "f", "bp": "e"} | one for one in sent]
            sent.clear()
    titles = {_thread_number(track): tracks.title(track) for track in seen} | {LEVEL_TRACKS - 1: "requests"}
    for number, title in sorted(titles.items()):
        about = {"ph": "M", "pid": ROBOT, "tid": number}
        events.append(about | {"name": "thread_name", "args": {"name": title}})
        events.append(about | {"name": "thread_sort_index", "args": {"sort_index": number}})
    return {"traceEvents": events, "displayTimeUnit": "ns", "otherData": {"cycles_per_second": hz}}
