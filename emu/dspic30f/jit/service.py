"""Native work at an instruction boundary: simple periodic events, interrupts, and the time spent in Idle.

The rules are those of sequencer.py and interrupts.py; everything out of the ordinary (traps, DISI, NSTDIS, requests
that are not visible yet, events that are not a plain timer match, a stack that does not hold) is left to them: the
function then returns with what was due before done, and Python does the rest of the boundary.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from emu.dspic30f.core import Core
from emu.dspic30f.interrupts import ALTIVT, UNMASKABLE
from emu.dspic30f.jit.converter import ConverterPlaces, converter_of, event_text
from emu.dspic30f.jit.counting import BoundaryCount
from emu.dspic30f.power import STIR
from emu.dspic30f.registers import NSTDIS
from emu.dspic30f.state import IDLE, IPL3, IPL_MASK, NOT_REPEATING, PC_MASK, RA, RUN

DONE, PYTHON = 0, 1
"""Results: the boundary has no work left; Python must do it."""

LANES: Final = 8
"""Due cycles in the widest vector register."""

COLUMNS: Final = ("place", "shift", "since", "ivt", "aivt", "vector")
"""Names of the constant tables, in the order of `Boundary.sources`."""


@dataclass(frozen=True)
class Match:
    """A timer's event slot: fields of the record that say what firing does (peripherals/README.md)."""

    slot: int
    period: int
    """Byte offset of the period in Tcy; 0 there means "call Python"."""
    flag: int
    """Address of the interrupt flag register."""
    bit: int
    since: int
    """Byte offset of the cycle in which that flag rose."""


@dataclass(frozen=True)
class Boundary:
    """What the generated function depends on."""

    offset: Mapping[str, int]
    ram: tuple[int, int]
    """First data address of RAM, first one behind it."""
    slots: int
    """Event slots, up to a multiple of `LANES`: those behind the last one are never due."""
    look: int
    """Slot that only makes the engine look."""
    matches: tuple[Match, ...]
    flag_words: tuple[tuple[int, int], ...]
    trap_flags: int
    sources: tuple[tuple[int, int, int, int, int, int], ...]
    """Per flag word and bit: address and shift of the priority, offset of the rise, IVT, AIVT, vector number."""
    converter: ConverterPlaces | None = None


def boundary_of(core: Core, offset: Mapping[str, int]) -> Boundary:
    """Collect it from a wired core."""
    chip, names = core.chip, core.events.names
    since = core.record.fields["irq.since"].offset
    words = sorted({(chip.sfrs[s.flag[0]].address, chip.sfrs[s.enable[0]].address) for s in chip.interrupts.values()})
    order = {flags: number for number, (flags, _enables) in enumerate(words)}
    vectors = {vector.irq: vector for vector in chip.vectors}
    sources = [(0, 0, 0, 0, 0, 0)] * (16 * len(words))
    rises: dict[int, tuple[int, int, int]] = {}
    for irq, source in chip.interrupts.items():
        flags, bit = chip.sfrs[source.flag[0]].address, source.flag[1]
        rise = since + 8 * ((flags >> 1) % 4 * 16 + bit)
        rises[irq] = (flags, bit, rise)
        priority, shift = source.priority
        vector = vectors[irq]
        sources[16 * order[flags] + bit] = (
            chip.sfrs[priority].address, shift, rise, vector.ivt >> 1, vector.aivt >> 1, vector.slot)
    matches = []
    for site in chip.timers:
        name = f"t{site.number}"
        if f"{name}.match" in names:
            flags, bit, rise = rises[site.irq]
            matches.append(Match(names.index(f"{name}.match"), offset[f"{name}.period"], flags, bit, rise))
    slots = -(-len(names) // LANES) * LANES
    ram = chip.data["ram"]
    return Boundary(offset, (ram.start, ram.end), slots, names.index("cpu.look"), tuple(matches), tuple(words),
                    core.traps.flags, tuple(sources), converter_of(core))


def service_text(b: Boundary, counts: BoundaryCount) -> str:
    """IR of `i64 @service(ptr %rec, i64 %limit, ptr %entered)`."""
    lanes = f"<{LANES} x i64>"
    declared = f"""declare i64 @llvm.vector.reduce.umin.v{LANES}i64({lanes})
declare {lanes} @llvm.umin.v{LANES}i64({lanes}, {lanes})
declare i128 @llvm.cttz.i128(i128, i1)"""
    return "\n".join([declared, _tables(b), _head(b, counts), _events(b), _accept(b, counts), _enter(b, counts), "}"])


def _tables(b: Boundary) -> str:
    lines = []
    for number, name in enumerate(COLUMNS):
        values = ", ".join(f"i64 {source[number]}" for source in b.sources)
        lines.append(f"@{name} = private unnamed_addr constant [{len(b.sources)} x i64] [{values}]")
    return "\n".join(lines)


def _at(name: str, offset: int) -> str:
    return f"  %{name} = getelementptr i8, ptr %rec, i64 {offset}"


def _head(b: Boundary, counts: BoundaryCount) -> str:
    o = b.offset
    places = {"p.cycle": o["cpu.cycle"], "p.deadline": o["events.deadline"], "p.hold": o["cpu.hold"],
              "p.due": o["events.due"], "p.intcon1": o["INTCON1"], "p.intcon2": o["INTCON2"], "p.sr": o["SR"],
              "p.corcon": o["CORCON"], "p.pc": o["cpu.pc"], "p.disi": o["cpu.disi_end"], "p.sp": o["WREG15"],
              "p.splim": o["SPLIM"], "p.armed": o["cpu.limit_armed"], "p.stall": o["cpu.stall"],
              "p.inttreg": o["INTTREG"], "p.repeat": o["cpu.repeat"],
              "p.slip": o["cpu.slip_cycle"],
              "p.mode": o["cpu.mode"], "p.slept": o["cpu.slept"], "p.power": o["wdt.mode"], "p.flash": o["flash"],
              "p.stopped": o["power.stopped"]}
    return "\n".join([
        "define internal i64 @service(ptr noalias %rec, i64 %limit, ptr %entered) {", "first:",
        *(_at(name, offset) for name, offset in places.items()),
        f"""  %hold = load i64, ptr %p.hold
  %waits = icmp ne i64 %hold, 0
  %slip = load i64, ptr %p.slip
  %now = load i64, ptr %p.cycle
  %slips = icmp eq i64 %slip, %now
  %held = or i1 %waits, %slips
  br i1 %held, label %python, label %again
python:
  store i64 0, ptr %p.deadline
  ret i64 {PYTHON}
done:
  ret i64 {DONE}
stop:
  ret i64 {PYTHON}
again:
  %within = phi i1 [ false, %first ], [ false, %jump ], [ false, %wake ], [ true, %rouse ], [ true, %push ]
  %cycle = load i64, ptr %p.cycle
  %before = sub i64 %cycle, 1
  %deadline = load i64, ptr %p.deadline
  %mode = load i16, ptr %p.mode
  %awake = icmp eq i16 %mode, {RUN}
  %last = select i1 %awake, i64 %before, i64 %cycle
  %early = icmp ugt i64 %deadline, %last
  br i1 %awake, label %running, label %resting
running:
  %reached = icmp uge i64 %cycle, %limit
  %over = select i1 %within, i1 false, i1 %reached
  br i1 %over, label %stop, label %due
due:
  br i1 %early, label %done, label %fire
resting:
  %idle = icmp eq i16 %mode, {IDLE}
  %halted = load i8, ptr %p.stopped
  %clocked = icmp eq i8 %halted, 0
  %simple = and i1 %idle, %clocked
  br i1 %simple, label %idling, label %python
idling:
  br i1 %early, label %sleep, label %fire
sleep:
  %slept = load i64, ptr %p.slept
  %stir = add i64 %slept, {STIR}
  %long = icmp ugt i64 %deadline, %stir
  br i1 %long, label %python, label %nap
nap:
  %far = icmp uge i64 %deadline, %limit
  br i1 %far, label %doze, label %jump
doze:
  %until = call i64 @llvm.umax.i64(i64 %cycle, i64 %limit)
  store i64 %until, ptr %p.cycle
{counts.idle("doze", "%until")}
  ret i64 {PYTHON}
jump:
  store i64 %deadline, ptr %p.cycle
{counts.idle("jump", "%deadline")}
  br label %again"""])


def _events(b: Boundary) -> str:
    lanes, groups = f"<{LANES} x i64>", range(b.slots // LANES)
    looked, hits, least = [], [], "%dues0"
    for g in groups:
        looked += [f"  %p.group{g} = getelementptr i64, ptr %p.due, i64 {LANES * g}",
                   f"  %dues{g} = load {lanes}, ptr %p.group{g}, align 8"]
        if g:
            looked.append(f"  %min{g} = call {lanes} @llvm.umin.v{LANES}i64({lanes} {least}, {lanes} %dues{g})")
            least = f"%min{g}"
        hits += [f"  %equal{g} = icmp eq {lanes} %dues{g}, %least.all",
                 f"  %bits{g} = bitcast <{LANES} x i1> %equal{g} to i{LANES}",
                 f"  %wide{g} = zext i{LANES} %bits{g} to i128", f"  %placed{g} = shl i128 %wide{g}, {LANES * g}",
                 f"  %hits{g} = or i128 %placed{g}, {f'%hits{g - 1}' if g else 0}"]
    last, newline = groups[-1], "\n"
    lines = [f"""fire:
{newline.join(looked)}
  %least1 = call i64 @llvm.vector.reduce.umin.v{LANES}i64({lanes} {least})
  %later = icmp ugt i64 %least1, %last
  br i1 %later, label %settled, label %choose
settled:
  store i64 %least1, ptr %p.deadline
  br label %accept
choose:
  %least.0 = insertelement {lanes} poison, i64 %least1, i64 0
  %least.all = shufflevector {lanes} %least.0, {lanes} poison, <{LANES} x i32> zeroinitializer
{newline.join(hits)}
  %hit = call i128 @llvm.cttz.i128(i128 %hits{last}, i1 true)
  %who1 = trunc i128 %hit to i64
  %p.who = getelementptr i64, ptr %p.due, i64 %who1
  switch i64 %who1, label %python [ i64 {b.look}, label %look"""]
    slots = [m.slot for m in b.matches] + ([b.converter.slot] if b.converter is not None else [])
    lines[0] += "".join(f" i64 {slot}, label %t{slot}" for slot in slots) + " ]"
    lines.append("look:\n  store i64 -1, ptr %p.who\n  br label %fire")
    for m in b.matches:
        n = f"t{m.slot}"
        lines += [f"{n}:", _at(f"{n}.pp", m.period), _at(f"{n}.pf", m.flag), _at(f"{n}.ps", m.since),
                  f"""  %{n}.period = load i64, ptr %{n}.pp
  %{n}.odd = icmp eq i64 %{n}.period, 0
  br i1 %{n}.odd, label %python, label %{n}.go
{n}.go:
  %{n}.next = add i64 %least1, %{n}.period
  store i64 %{n}.next, ptr %p.who
  %{n}.word = load i16, ptr %{n}.pf
  %{n}.new = or i16 %{n}.word, {_i16(1 << m.bit)}
  store i16 %{n}.new, ptr %{n}.pf
  %{n}.same = icmp eq i16 %{n}.new, %{n}.word
  br i1 %{n}.same, label %fire, label %{n}.rise
{n}.rise:
  store i64 %least1, ptr %{n}.ps
  br label %fire"""]
    if b.converter is not None:
        lines.append(event_text(b.converter))
    return "\n".join(lines)


def _i16(value: int) -> int:
    return value - 0x10000 if value & 0x8000 else value


def _accept(b: Boundary, counts: BoundaryCount) -> str:
    lines = [f"""accept:
  %intcon1 = load i16, ptr %p.intcon1
  %traps = and i16 %intcon1, {_i16(b.trap_flags)}
  %trap = icmp ne i16 %traps, 0
  %sr = load i16, ptr %p.sr
  %corcon = load i16, ptr %p.corcon
  br i1 %trap, label %python, label %ask0"""]
    bits = 16 * len(b.flag_words)
    for number, (flags, enables) in enumerate(b.flag_words):
        lines += [f"ask{number}:", _at(f"pf{number}", flags), _at(f"pe{number}", enables),
                  f"""  %f{number} = load i16, ptr %pf{number}
  %e{number} = load i16, ptr %pe{number}
  %r{number} = and i16 %f{number}, %e{number}
  %w{number} = zext i16 %r{number} to i64
  %s{number} = shl i64 %w{number}, {16 * number}
  %o{number} = or i64 %s{number}, {f"%o{number - 1}" if number else "0"}
  br label %{f"ask{number + 1}" if number + 1 < len(b.flag_words) else "asked"}"""]
    shift = IPL_MASK.bit_length() - 3
    table = f"[{bits} x i64]"
    lines.append(f"""asked:
  %all = or i64 %o{len(b.flag_words) - 1}, 0
  %ipl.low = lshr i16 %sr, {shift}
  %ipl.low7 = and i16 %ipl.low, 7
  %ipl.high = and i16 %corcon, {IPL3}
  %ipl16 = or i16 %ipl.low7, %ipl.high
  %ipl = zext i16 %ipl16 to i64
  %disi = load i64, ptr %p.disi
  br i1 %awake, label %pick, label %wake
wake:
  %wreq = phi i64 [ %all, %asked ], [ %wreq1, %wtake ]
  %wnone = icmp eq i64 %wreq, 0
  br i1 %wnone, label %again, label %wtake
wtake:
  %wirq = call i64 @llvm.cttz.i64(i64 %wreq, i1 true)
  %wreqm = sub i64 %wreq, 1
  %wreq1 = and i64 %wreq, %wreqm
  %wpp = getelementptr {table}, ptr @place, i64 0, i64 %wirq
  %wplace = load i64, ptr %wpp
  %wps = getelementptr {table}, ptr @shift, i64 0, i64 %wirq
  %wshift = load i64, ptr %wps
  %p.wipc = getelementptr i8, ptr %rec, i64 %wplace
  %wipc = load i16, ptr %p.wipc
  %wipc64 = zext i16 %wipc to i64
  %wlev = lshr i64 %wipc64, %wshift
  %wlevel = and i64 %wlev, 7
  %wakes = icmp ne i64 %wlevel, 0
  br i1 %wakes, label %rouse, label %wake
rouse:
  %wpr = getelementptr {table}, ptr @since, i64 0, i64 %wirq
  %wrise.off = load i64, ptr %wpr
  %p.wrise = getelementptr i8, ptr %rec, i64 %wrise.off
  %wrise = load i64, ptr %p.wrise
  %wrise1 = add i64 %wrise, 1
  %wcycle = call i64 @llvm.umax.i64(i64 %cycle, i64 %wrise1)
  store i64 %wcycle, ptr %p.cycle
{counts.idle("rouse", "%wcycle")}
  store i16 {RUN}, ptr %p.mode
  store i8 {RUN}, ptr %p.power
  store i64 0, ptr %p.deadline
  br label %again
pick:
  %req = phi i64 [ %all, %asked ], [ %req1, %next ]
  %best = phi i64 [ %ipl, %asked ], [ %best1, %next ]
  %win = phi i64 [ -1, %asked ], [ %win1, %next ]
  %none = icmp eq i64 %req, 0
  br i1 %none, label %picked, label %take
take:
  %irq = call i64 @llvm.cttz.i64(i64 %req, i1 true)
  %reqm = sub i64 %req, 1
  %req1 = and i64 %req, %reqm
  %pp = getelementptr {table}, ptr @place, i64 0, i64 %irq
  %place.off = load i64, ptr %pp
  %ps = getelementptr {table}, ptr @shift, i64 0, i64 %irq
  %shift.n = load i64, ptr %ps
  %p.ipc = getelementptr i8, ptr %rec, i64 %place.off
  %ipc = load i16, ptr %p.ipc
  %ipc64 = zext i16 %ipc to i64
  %lev = lshr i64 %ipc64, %shift.n
  %level = and i64 %lev, 7
  %wins = icmp ugt i64 %level, %best
  br i1 %wins, label %open, label %next
open:
  %maskable = icmp ult i64 %level, {UNMASKABLE}
  %blocked = icmp ult i64 %last, %disi
  %held.back = and i1 %maskable, %blocked
  br i1 %held.back, label %python, label %seen
seen:
  %pr = getelementptr {table}, ptr @since, i64 0, i64 %irq
  %rise.off = load i64, ptr %pr
  %p.rise = getelementptr i8, ptr %rec, i64 %rise.off
  %rise = load i64, ptr %p.rise
  %visible = icmp ule i64 %rise, %last
  br i1 %visible, label %next, label %python
next:
  %best1 = phi i64 [ %best, %take ], [ %level, %seen ]
  %win1 = phi i64 [ %win, %take ], [ %irq, %seen ]
  br label %pick
picked:
  %nobody = icmp eq i64 %win, -1
  br i1 %nobody, label %done, label %enter""")
    return "\n".join(lines)


def _enter(b: Boundary, counts: BoundaryCount) -> str:
    table = f"[{len(b.sources)} x i64]"
    return f"""enter:
  %nstdis = and i16 %intcon1, {_i16(NSTDIS)}
  %nest = icmp eq i16 %nstdis, 0
  %sp = load i16, ptr %p.sp
  %sp2 = add i16 %sp, 2
  %armed = load i16, ptr %p.armed
  %splim = load i16, ptr %p.splim
  %unlimited = icmp eq i16 %armed, 0
  %fits = icmp ule i16 %sp2, %splim
  %below = or i1 %unlimited, %fits
  %high = icmp uge i16 %sp, {b.ram[0]}
  %ram = icmp ult i16 %sp, {b.ram[1] - 2}
  %a1 = and i1 %below, %high
  %a2 = and i1 %a1, %ram
  %a3 = and i1 %a2, %nest
  br i1 %a3, label %push, label %python
push:
  %pw = getelementptr {table}, ptr @since, i64 0, i64 %win
  %rise.w = load i64, ptr %pw
  %p.rise.w = getelementptr i8, ptr %rec, i64 %rise.w
  %c = load i64, ptr %p.rise.w
  %c4 = add i64 %c, 4
  %e3 = add i64 %last, 3
  %start = call i64 @llvm.umax.i64(i64 %c4, i64 %e3)
  store i64 %start, ptr %p.cycle
  %pc = load i32, ptr %p.pc
  %pc.low = trunc i32 %pc to i16
  %pc.high32 = lshr i32 %pc, 16
  %pc.high = trunc i32 %pc.high32 to i16
  %srl = shl i16 %sr, 8
  %ipl3 = and i16 %corcon, {IPL3}
  %ipl3.up = shl i16 %ipl3, 4
  %word.a = or i16 %srl, %ipl3.up
  %word = or i16 %word.a, %pc.high
  %spx = zext i16 %sp to i64
  %p.push = getelementptr i8, ptr %rec, i64 %spx
  store i16 %pc.low, ptr %p.push
  %p.push2 = getelementptr i8, ptr %p.push, i64 2
  store i16 %word, ptr %p.push2
  %sp4 = add i16 %sp, 4
  store i16 %sp4, ptr %p.sp
  %best16 = trunc i64 %best to i16
  %ipl.bits = shl i16 %best16, 5
  %sr.kept = and i16 %sr, {_i16(0xFFFF & ~(IPL_MASK | RA))}
  %sr.new = or i16 %sr.kept, %ipl.bits
  store i16 %sr.new, ptr %p.sr
  %corcon.new = and i16 %corcon, {_i16(0xFFFF & ~IPL3)}
  store i16 %corcon.new, ptr %p.corcon
  %intcon2 = load i16, ptr %p.intcon2
  %alt = and i16 %intcon2, {_i16(ALTIVT)}
  %ivt.on = icmp eq i16 %alt, 0
  %pi = getelementptr {table}, ptr @ivt, i64 0, i64 %win
  %pa = getelementptr {table}, ptr @aivt, i64 0, i64 %win
  %p.entry = select i1 %ivt.on, ptr %pi, ptr %pa
  %entry.word = load i64, ptr %p.entry
  %p.vector = getelementptr i32, ptr %p.flash, i64 %entry.word
  %vector = load i32, ptr %p.vector
  %handler = and i32 %vector, {PC_MASK}
  store i32 %handler, ptr %p.pc
{counts.entered()}
  store i16 0, ptr %p.stall
  store i16 {NOT_REPEATING}, ptr %p.repeat
  %pv = getelementptr {table}, ptr @vector, i64 0, i64 %win
  %vec = load i64, ptr %pv
  %lev8 = shl i64 %best, 8
  %treg = or i64 %lev8, %vec
  %treg16 = trunc i64 %treg to i16
  store i16 %treg16, ptr %p.inttreg
  store i64 0, ptr %p.deadline
  %count = load i64, ptr %entered
  %count1 = add i64 %count, 1
  store i64 %count1, ptr %entered
  br label %again"""
