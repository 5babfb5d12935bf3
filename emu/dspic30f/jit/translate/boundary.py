"""Native work at an instruction boundary: events that have rules, interrupts, and time spent in Idle.

The rules are those of the devices and of exceptions.py, in the order of `Sequencer.boundary`. Python handles traps,
events without a rule, and cases that a rule does not cover. In these cases the function returns after it has done all
earlier work, and Python finishes the boundary.
"""

from __future__ import annotations

from typing import Final

from emu.dspic30f.core import Core
from emu.dspic30f.exceptions import exceptions
from emu.dspic30f.exceptions.power import DRAIN_CYCLES
from emu.dspic30f.jit.counters.cycle_counters import BoundaryCounter
from emu.dspic30f.jit.ir.rule_emitter import BoundaryEmitter
from emu.dspic30f.jit.ir.values import Emitter, Value, truth, wide
from emu.dspic30f.state.state import IDLE, IPL_MASK, RUN, STACK_POINTER
from emu.system.events import NEVER
from emu.system.rules import Cell, Number, cell_of, event_slot

DONE, PYTHON, UNFINISHED = 0, 1, 2
"""Results of the boundary function.

- DONE: the boundary has no more work.
- PYTHON: Python must perform the boundary.
- UNFINISHED: Python must finish it. An exception has already been entered, so a limit that was reached meanwhile counts
  only after the boundary.
"""

LANES: Final = 8
"""Number of due cycles in the widest vector register."""

DECLARATIONS: Final = f"""declare i64 @llvm.vector.reduce.umin.v{LANES}i64(<{LANES} x i64>)
declare <{LANES} x i64> @llvm.umin.v{LANES}i64(<{LANES} x i64>, <{LANES} x i64>)
declare i128 @llvm.cttz.i128(i128, i1)
declare i64 @llvm.umin.i64(i64, i64)"""

FIELDS: Final = {"cycle": "cpu.cycle", "deadline": "events.deadline", "hold": "cpu.hold", "due": "events.due",
                 "mode": "cpu.mode", "slept": "cpu.slept", "power": "wdt.mode",
                 "stopped": "power.stopped"}  # fmt: skip
"""Record fields by their names in the IR of this module."""


def boundary_text(core: Core, counter: BoundaryCounter) -> str:
    """Return the IR of `i64 @boundary(ptr %rec, i64 %limit, ptr %entered)`."""
    fired, accepted = Emitter(), Emitter()
    events = BoundaryEmitter(core, fired, Value(fired, "%least1", False), "python")
    _fire(core, events)
    entering = BoundaryEmitter(core, accepted, Value(accepted, "%first.due", False), "python", events.tables)
    _accept(core, entering, counter)
    fire = "\n".join([_events(core), fired.text(), "}"])
    boundary = "\n".join([_head(core, counter), _SETTLE, accepted.text(), "}"])
    return "\n".join([DECLARATIONS, events.constants(), fire, boundary])


_SETTLE: Final = """fire:
  %first.due = call i64 @fire(ptr %rec, i64 %last)
  %refused.one = icmp eq i64 %first.due, 0
  br i1 %refused.one, label %python, label %settled
settled:
  store i64 %first.due, ptr %p.deadline
  br label %accept"""
"""IR that fires the events due at the boundary, before an exception may be accepted."""


def _head(core: Core, counter: BoundaryCounter) -> str:
    """Return the IR from the call to the first due event (`fire`), including the time spent in Idle."""
    record_offsets = {name: core.record.fields[field].offset for name, field in FIELDS.items()}
    return "\n".join(
        [
            "define internal i64 @boundary(ptr noalias %rec, i64 %limit, ptr %entered) {",
            "first:",
            *(f"  %p.{name} = getelementptr i8, ptr %rec, i64 {offset}" for name, offset in record_offsets.items()),
            f"""  %left = alloca i64
  store i64 {PYTHON}, ptr %left
  %hold = load i64, ptr %p.hold
  %waits = icmp ne i64 %hold, 0
  br i1 %waits, label %python, label %again
python:
  store i64 0, ptr %p.deadline
  %why = load i64, ptr %left
  ret i64 %why
done:
  ret i64 {DONE}
stop:
  ret i64 {PYTHON}
again:
  %within = phi i1 [ false, %first ], [ false, %jump ], [ false, %sleeping ], [ true, %rouse ], [ true, %entered.one ]
  %half = select i1 %within, i64 {UNFINISHED}, i64 {PYTHON}
  store i64 %half, ptr %left
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
  %stir = add i64 %slept, {DRAIN_CYCLES}
  %long = icmp ugt i64 %deadline, %stir
  br i1 %long, label %python, label %nap
nap:
  %far = icmp uge i64 %deadline, %limit
  br i1 %far, label %doze, label %jump
doze:
  %until = call i64 @llvm.umax.i64(i64 %cycle, i64 %limit)
  store i64 %until, ptr %p.cycle
{counter.idle("doze", "%until")}
  ret i64 {PYTHON}
jump:
  store i64 %deadline, ptr %p.cycle
{counter.idle("jump", "%deadline")}
  br label %again""",
        ]
    )


def _events(core: Core) -> str:
    """Return the IR of `i64 @fire(ptr %rec, i64 %last)`.

    It fires the events due up to cycle `%last`, sorted by (due, slot). It returns the earliest later due cycle, or 0
    if Python must continue. The caller updates the deadline."""
    due = core.record.fields[FIELDS["due"]].offset
    lanes, groups = f"<{LANES} x i64>", range(-(-len(core.events.names) // LANES))
    loads, hits, least = [], [], "%dues0"
    for g in groups:  # slots after the last one are never due
        loads += [
            f"  %p.group{g} = getelementptr i64, ptr %p.due, i64 {LANES * g}",
            f"  %dues{g} = load {lanes}, ptr %p.group{g}, align 8",
        ]
        if g:
            loads.append(f"  %min{g} = call {lanes} @llvm.umin.v{LANES}i64({lanes} {least}, {lanes} %dues{g})")
            least = f"%min{g}"
        hits += [
            f"  %equal{g} = icmp eq {lanes} %dues{g}, %least.all",
            f"  %bits{g} = bitcast <{LANES} x i1> %equal{g} to i{LANES}",
            f"  %wide{g} = zext i{LANES} %bits{g} to i128",
            f"  %placed{g} = shl i128 %wide{g}, {LANES * g}",
            f"  %hits{g} = or i128 %placed{g}, {f'%hits{g - 1}' if g else 0}",
        ]
    newline = "\n"
    return f"""define internal i64 @fire(ptr noalias %rec, i64 %last) {{
first:
  %p.due = getelementptr i8, ptr %rec, i64 {due}
  br label %fire
python:
  ret i64 0
fire:
{newline.join(loads)}
  %least1 = call i64 @llvm.vector.reduce.umin.v{LANES}i64({lanes} {least})
  %later = icmp ugt i64 %least1, %last
  br i1 %later, label %settled, label %choose
settled:
  ret i64 %least1
choose:
  %least.0 = insertelement {lanes} poison, i64 %least1, i64 0
  %least.all = shufflevector {lanes} %least.0, {lanes} poison, <{LANES} x i32> zeroinitializer
{newline.join(hits)}
  %hit = call i128 @llvm.cttz.i128(i128 %hits{groups[-1]}, i1 true)
  %slot = trunc i128 %hit to i64
  switch i64 %slot, label %python [ {" ".join(f"i64 {slot}, label %t{slot}" for slot in core.events.rules)} ]"""


def _fire(core: Core, m: BoundaryEmitter) -> None:
    """Emit the rules of events."""
    for number, rule in core.events.rules.items():
        slot = event_slot(core.record, number)
        m.e.start(f"t{number}")
        rule.fires(m, rule.operands)
        if slot not in m.posted:
            m.put(slot.due, NEVER)
        m.e.end("br label %fire")


def _accept(core: Core, m: BoundaryEmitter, counter: BoundaryCounter) -> None:
    """Emit the search for an interrupt that is accepted after cycle `%last` or that wakes the CPU."""
    e, p = m.e, core.exceptions.operands
    cycle, last = (Value(e, name, False) for name in ("%cycle", "%last"))
    e.start("accept")
    m.require((m.get(p.intcon1) & core.traps.flags) == 0)
    e.end("br i1 %awake, label %running.on, label %wake")
    e.start("wake")
    bits = exceptions.requested(m, p)
    e.end(f"br i1 {truth(bits)}, label %seek, label %sleeping")
    e.start("sleeping")
    e.end("br label %again")
    e.start("seek")
    found = exceptions.waking(m, p, bits)
    e.end(f"br i1 {truth(found == exceptions.NO_REQUEST)}, label %sleeping, label %rouse")
    e.start("rouse")
    risen = exceptions.request_cycle(m, p, found) + 1
    until = e.select(cycle < risen, risen, cycle)
    for name, value in (("cycle", until), ("mode", RUN), ("power", RUN), ("deadline", 0)):
        m.put(cell_of(core.record, FIELDS[name]), value)
    e.line(counter.idle("rouse", wide(until)))
    e.end("br label %again")
    e.start("running.on")
    slip = cycle if core.exceptions.ipl_slip else None
    bits = exceptions.requested(m, p, slip)
    e.end(f"br i1 {truth(bits)}, label %pick, label %done")
    e.start("pick")
    winner, level = exceptions.accepted(m, p, bits, last, slip)
    e.end(f"br i1 {truth(winner == exceptions.NO_REQUEST)}, label %done, label %enter")
    _enter(core, m, counter, winner, level)


def _enter(core: Core, m: BoundaryEmitter, counter: BoundaryCounter, winner: Number, level: Number) -> None:
    """Emit the entry of the interrupt numbered `winner`, and count it."""
    e, p = m.e, core.exceptions.operands
    e.start("enter")
    vectors = tuple(m.table(column, winner) for column in (p.ivt, p.aivt, p.slot))
    since, site, stack = exceptions.request_cycle(m, p, winner), m.get(p.pc), m.get(Cell(2 * STACK_POINTER, 16))
    exceptions.enter(m, p, level, since, Value(e, "%last", False), vectors)
    ipl = (m.get(p.sr) & IPL_MASK) >> IPL_MASK.bit_length() - 3
    e.line(counter.entered(*map(wide, (m.get(p.cycle), m.get(p.pc), site, stack, level, ipl, since))))
    e.end("br label %entered.one")
    e.start("entered.one")
    e.line("%count = load i64, ptr %entered")
    e.line("%count1 = add i64 %count, 1")
    e.line("store i64 %count1, ptr %entered")
    e.end("br label %again")
