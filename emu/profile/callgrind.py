"""Output of a profile in Callgrind's format, for callgrind_annotate and KCachegrind.

Format: "Callgrind Format Specification" of the Valgrind documentation, version 1, positions "instr line", absolute.
Costs are Tcy. Inlined code keeps its file (fi/fe). Sleep is not included, so the sum is the busy time of the CPU.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator

from emu.profile.call_graph import CallEdge
from emu.profile.cycle_shares import CodeLocation, Profile


def lines(profile: Profile, image: str, location_of: Callable[[int], CodeLocation]) -> Iterator[str]:
    """Yield the text lines of the file."""
    yield "# callgrind format"
    yield "version: 1"
    yield "creator: emu profile"
    yield f"cmd: {image}"
    yield f"desc: Timerange: Tcy {profile.start} to {profile.end}, asleep for {profile.idle}"
    yield "positions: instr line"
    yield "events: Tcy"
    yield f"summary: {profile.busy}"
    costs: dict[tuple[str, str], list[tuple[int, int, int, str]]] = defaultdict(list)
    home: dict[str, str] = {}
    calls: dict[str, list[CallEdge]] = defaultdict(list)
    for pc, cycles in profile.addresses.items():
        name, file, line = location_of(pc)
        costs[name, file].append((pc, line, cycles, file))
    for edge in profile.edges:
        home.setdefault(location_of(edge.entry)[0], location_of(edge.entry)[1])
        if edge.site is not None and edge.calls:
            calls[location_of(edge.site)[0]].append(edge)
    names: dict[str, list[str]] = defaultdict(list)
    for name, file in costs:
        names[name].append(file)
        home.setdefault(name, file)
    for name in sorted(names.keys() | calls.keys()):
        yield ""
        yield f"fl={home.get(name) or '???'}"
        yield f"fn={name}"
        for file in sorted(names[name], key=lambda file: (file != home.get(name), file)):
            if file != home.get(name):
                yield f"fi={file or '???'}"
            for pc, line, cycles, _ in sorted(costs[name, file]):
                yield f"{pc:#x} {line} {cycles}"
        for edge in calls[name]:
            callee, file, line = location_of(edge.entry)
            _, site_file, site_line = location_of(edge.site or 0)
            yield f"fi={site_file or '???'}"
            yield f"cfi={file or '???'}"
            yield f"cfn={callee}"
            yield f"calls={edge.calls} {edge.entry:#x} {line}"
            yield f"{edge.site:#x} {site_line} {edge.cycles}"
    yield ""
    yield f"totals: {profile.busy}"
