"""`emu profile` counts every cycle once, and its files agree with a single-stepped machine."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections import Counter, defaultdict

import pytest

from emu.api import Machine
from emu.cli import main
from emu.image.loader import load_image
from emu.profile.cycle_shares import Profiler
from toolchain.driver.driver import main as compile_program

SOURCE = """
#include <p30F6014A.h>
volatile unsigned int ticks;
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void) { IFS0bits.T1IF = 0; ticks++; }
__attribute__((noinline)) void spin(void) { for (int i = 0; i < 10; i++) __asm__ volatile("nop"); }
int main(void) {
    PR1 = 999; T1CON = 0x8000; IEC0bits.T1IE = 1;
    for (;;) { spin(); __asm__ volatile("pwrsav #1"); }
}
"""


def compiled(folder, text):
    """Return the image of a C program."""
    source, target = folder / "program.c", folder / "program.elf"
    source.write_text(text)
    assert compile_program(["-Os", "-g", "-fxc16-attributes", str(source), "-o", str(target)]) == 0
    return load_image(target)


@pytest.fixture(scope="module")
def image(tmp_path_factory):
    return compiled(tmp_path_factory.mktemp("profile"), SOURCE)


def profile_of(image, cycles: int, skip: int = 5_000):
    machine = Machine(image.chip)
    machine.load(image)
    return machine, Profiler(machine, image).run(skip + cycles, skip)


def test_shares_add_up_and_repeat_with_the_timer(image):
    """With an interrupt every 1000 Tcy (dspic30f6014a.md §7), the counts of ten periods are ten times those of one."""
    _, ten = profile_of(image, 10_000)
    _, one = profile_of(image, 1_000)
    assert ten.cycles == 10_000
    assert ten.busy == sum(ten.levels.values()) == sum(ten.files.values()) == sum(ten.functions.values())
    assert dict(ten.functions) == {n: 10 * c for n, c in one.functions.items()}
    assert ten.idle == 10 * one.idle > 5_000


def test_entering_an_interrupt_counts_for_its_handler(image):
    """isa.md §14.2: the entry of an interrupt, up to the handler's first instruction, counts for the handler. The
    machine itself counts what happens at level 4, the priority after reset."""
    _, one = profile_of(image, 1_000)
    assert one.functions["__T1Interrupt"] == one.levels[4]
    machine = Machine(image.chip, engine="plain")
    machine.load(image)
    machine.run_until(5_000)
    handler = image.symbols.find("_T1Interrupt").address
    assert machine.run(cycles=2_000, until=handler).reason == "until"
    start = machine.cycle
    while machine.state.ipl:
        machine.step()
    assert one.levels[4] == machine.cycle - start + 3


def test_groups_match_functions_and_files(image):
    _, one = profile_of(image, 1_000)
    assert one.group(["_spin"]) == one.functions["_spin"]
    assert one.group(["*/program.c"]) == one.busy
    assert not one.matched("spin")


# -- comparison with a single-stepped machine

NESTED = """
#include <p30F6014A.h>
volatile unsigned ticks, total; volatile unsigned char from[40], to[40];
static __attribute__((noinline)) unsigned depth(unsigned n) { return n ? depth(n - 1) + 1 : ticks; }
static __attribute__((noinline)) unsigned work(unsigned n) {
    for (unsigned i = 0; i < sizeof from; i++) to[i] = from[i] ^ n;
    return depth(n & 7) / (n | 1);
}
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void) { IFS0bits.T1IF = 0; ticks += work(3); }
void __attribute__((interrupt, no_auto_psv)) _T2Interrupt(void) { IFS0bits.T2IF = 0; total++; }
int main(void) {
    PR1 = 1999; T1CON = 0x8000; IEC0bits.T1IE = 1;
    PR2 = 350; T2CON = 0x8000; IPC1bits.T2IP = 6; IEC0bits.T2IE = 1;
    for (unsigned n = 0;; n++) {
        total += work(n);
        if ((n & 3) == 0) __asm__ volatile("pwrsav #1");
        if ((n & 7) == 3) { SRbits.IPL = 5; total += work(n); SRbits.IPL = 0; }
    }
}
"""


@pytest.fixture(scope="module")
def nested(tmp_path_factory):
    return compiled(tmp_path_factory.mktemp("nested"), NESTED)


def single_step_counts(image, until: int):
    """Return cycles by function and level, cycles in Sleep, and calls by function, counted with single steps."""
    machine = Machine(image.chip, engine="plain")
    machine.load(image)
    functions, levels, idle, calls = Counter(), Counter(), 0, Counter()
    while machine.cycle < until:
        cycle, pc, was_asleep = machine.cycle, machine.pc, machine.is_asleep
        machine.service_boundary(until)
        entry = machine.cycle - cycle
        if was_asleep:
            entry = min(entry, 3) if machine.pc != pc else 0  # from the first cycle after wake-up to the handler
            idle += machine.cycle - cycle - entry
        before, pc, level = machine.cycle, machine.pc, machine.state.ipl
        if before >= until:
            functions[image.symbols.text(pc).split("+")[0]] += entry
            levels[level] += entry
            break
        machine.step()
        functions[image.symbols.text(pc).split("+")[0]] += machine.cycle - before + entry
        levels[level] += machine.cycle - before + entry
        if machine.program.word(pc) >> 16 in (0x02, 0x07):  # CALL, RCALL
            calls[machine.pc] += 1
        if machine.program.word(pc) == 0x064000:  # RETFIE
            calls[image.symbols.text(pc).split("+")[0]] += 1
    return functions, levels, idle, calls


def counted(image, engine: str, until: int, timed: bool = False):
    machine = Machine(image.chip, engine=engine)
    machine.load(image)
    return Profiler(machine, image, timed).run(until)


@pytest.mark.slow
def test_native_counts_equal_single_stepping(nested):
    """Functions, levels, sleep and calls of 100,000 cycles with two nested interrupts equal the counts of single
    steps. If both interrupts are entered at one boundary, single steps cannot separate their cycles, so the sum is
    compared."""
    functions, levels, idle, calls = single_step_counts(nested, 100_000)
    profile = counted(nested, "jit", 100_000)
    assert profile.cycles == profile.end - profile.start
    assert idle > 1_000
    assert min(levels[level] for level in (0, 4, 5, 6)) > 1_000
    handlers = ("__T1Interrupt", "__T2Interrupt")
    for one, other, several in ((profile.functions, functions, handlers), (profile.levels, levels, (4, 6))):
        assert sum(one[name] for name in several) == sum(other[name] for name in several)
        assert {k: v for k, v in one.items() if k not in several} == {
            k: v for k, v in other.items() if k not in several
        }
    assert profile.idle == idle
    seen = Counter()
    for edge in profile.edges:
        name = nested.symbols.text(edge.entry)
        if edge.entry:
            seen[name if name in handlers else edge.entry] += edge.calls
    assert {place: n for place, n in seen.items() if place not in handlers} == {
        place: n for place, n in calls.items() if place not in handlers
    }
    assert all(0 <= seen[name] - calls[name] <= 1 for name in handlers)  # one call may be in progress
    assert profile == counted(nested, "plain", 100_000)


def test_entries_without_nesting_are_at_priority_7(nested):
    """With NSTDIS every handler runs at priority 7, and so do the cycles of its entry (isa.md §14.2)."""
    profiles = []
    for engine in ("plain", "jit"):
        machine = Machine(nested.chip, engine=engine)
        machine.load(nested)
        machine.write("INTCON1", 0x8000)
        if engine == "jit":
            machine.runner.threshold = 1
        profiles.append(Profiler(machine, nested).run(20_000))
    assert profiles[0].levels == profiles[1].levels
    assert profiles[0].levels.keys() == {0, 7}


def test_timelines_of_the_engines_are_equal(nested):
    """T3 runs without an interrupt: its events divide a sleep in native code."""
    timelines = []
    for engine in ("plain", "jit"):
        machine = Machine(nested.chip, engine=engine)
        machine.load(nested)
        machine.write("PR3", 20)
        machine.write("T3CON", 0x8000)
        if engine == "jit":
            machine.runner.threshold = 1
        timelines.append(list(Profiler(machine, nested, timed=True).run(20_000).events))
    assert timelines[0] == timelines[1]
    assert max(event.length for event in timelines[0]) > 21


def test_inclusive_cycles_leave_out_interrupts_and_count_recursion_once(nested):
    profile = counted(nested, "jit", 200_000)
    named = {edge.entry: nested.symbols.text(edge.entry) for edge in profile.edges}
    inclusive = Counter()
    for edge in profile.edges:
        if edge.site is not None:
            inclusive[named[edge.entry], nested.symbols.text(edge.site).split("+")[0]] += edge.cycles
    work, depth = (profile.functions[name] for name in ("_work", "_depth"))
    assert inclusive["_depth", "_work"] == depth
    assert inclusive["_depth", "_depth"] < depth
    assert sum(n for (callee, _), n in inclusive.items() if callee == "_work") == work + sum(
        n for (callee, caller), n in inclusive.items() if caller == "_work"
    )


class Callgrind:
    """Parser for Callgrind's format (version 1) that rejects everything outside the specification."""

    COST = re.compile(r"(0x[0-9a-f]+) (\d+) (\d+)")

    def __init__(self, text: str) -> None:
        self.own, self.calls, self.inclusive = Counter(), Counter(), Counter()
        header, self.function, callee, waits = {}, None, None, None
        lines = text.splitlines()
        assert lines[0] == "# callgrind format"
        for line in lines[1:]:
            if not line:
                continue
            if match := self.COST.fullmatch(line):
                assert self.function is not None
                if waits is None:
                    self.own[self.function] += int(match[3])
                else:
                    self.calls[self.function, callee] += waits
                    self.inclusive[self.function, callee] += int(match[3])
                    waits = None
                continue
            assert waits is None, "a line of costs follows calls="
            if match := re.fullmatch(r"calls=(\d+) 0x[0-9a-f]+ \d+", line):
                assert callee is not None
                waits = int(match[1])
            elif match := re.fullmatch(r"(fl|fi|fe|fn|cfi|cfl|cfn)=(.+)", line):
                self.function = match[2] if match[1] == "fn" else self.function
                callee = match[2] if match[1] == "cfn" else callee
            else:
                match = re.fullmatch(r"(version|creator|cmd|desc|positions|events|summary|totals): (.+)", line)
                assert match is not None, line
                header[match[1]] = match[2]
        assert (header["version"], header["positions"], header["events"]) == ("1", "instr line", "Tcy")
        assert int(header["summary"]) == int(header["totals"]) == sum(self.own.values())


@pytest.fixture(scope="module")
def files(nested, tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    names = [folder / name for name in ("out.callgrind", "speed.json", "perfetto.json")]
    options = [part for option, name in zip(("callgrind", "speedscope", "perfetto"), names, strict=True)
               for part in (f"--{option}", str(name))]  # fmt: skip
    words = ["profile", nested.path, "--board", "none", "--skip", "0.001", "--seconds", "0.01", "--json", *options]
    assert main([str(word) for word in words]) == 0
    return names


def test_callgrind_files_are_what_the_specification_says(files):
    read = Callgrind(files[0].read_text())
    assert {"_main", "_work", "_depth", "__T1Interrupt", "__T2Interrupt"} <= read.own.keys()
    assert read.calls["_work", "_depth"] > 10
    assert read.inclusive["_work", "_depth"] >= read.own["_depth"] - 1_000  # a call may be in progress
    if shutil.which("callgrind_annotate"):
        done = subprocess.run(["callgrind_annotate", files[0]], capture_output=True, text=True, check=True)
        total = re.search(r"([\d,]+) \(100.0%\)  PROGRAM TOTALS", done.stdout)
        assert int(total[1].replace(",", "")) == sum(read.own.values())


def test_speedscope_files_nest_and_add_up(files):
    """In a speedscope file time never decreases, the innermost frame ends first, and all frames are closed at the end.
    The time of open frames is the time of the level."""
    data = json.loads(files[1].read_text())
    cycles = Counter()
    for profile in data["profiles"]:
        open_frames, last = [], data["profiles"][0]["startValue"]
        for event in profile["events"]:
            assert profile["startValue"] <= last <= event["at"] <= profile["endValue"]
            cycles[profile["name"]] += (event["at"] - last) * bool(open_frames)
            last = event["at"]
            if event["type"] == "O":
                open_frames.append(event["frame"])
            else:
                assert open_frames.pop() == event["frame"]
        assert not open_frames
    busy = sum(Callgrind(files[0].read_text()).own.values())
    assert cycles.keys() == {"main", "level 4", "level 6"}
    assert sum(cycles.values()) == busy


def test_perfetto_files_have_slices_on_tracks_and_flows_from_request_to_handler(files):
    data = json.loads(files[2].read_text())
    names = {e["tid"]: e["args"]["name"] for e in data["traceEvents"] if e["name"] == "thread_name"}
    assert set(names.values()) == {"main", "requests", "level 4", "level 6"}
    depth, flows = Counter(), defaultdict(list)
    for event in data["traceEvents"]:
        depth[event["tid"]] += {"B": 1, "E": -1}.get(event["ph"], 0)
        assert min(depth.values()) >= 0
        if event["ph"] in "sf":
            flows[event["id"]].append((event["ph"], names[event["tid"]], event["ts"], event["name"]))
    assert not any(depth.values())
    assert len(flows) > 50
    for start, finish in flows.values():
        assert (start[0], finish[0]) == ("s", "f")
        assert start[1] == "requests"
        assert finish[1].startswith("level")
        assert finish[2] > start[2]
        assert start[3] == finish[3]
