"""The native dispatch loop: calls native code by PC until Python is needed."""

from __future__ import annotations

from typing import Final

from emu.dspic30f.core import Core
from emu.dspic30f.jit.counters.cycle_counters import BoundaryCounter
from emu.dspic30f.jit.environment import (
    ARRIVED,
    AT_BOUNDARY,
    BLOCKS,
    INTERRUPTS,
    LAST_LIMIT,
    PASSED,
    PASSED_COUNT,
    PASSED_ROOM,
    PERIOD,
    STEPS,
)
from emu.dspic30f.jit.exit_reasons import (
    ARRIVE,
    BOUNDARY_WORK,
    DEADLINE,
    INTERPRET,
    MISS,
    NEXT,
    RETFIE,
)
from emu.dspic30f.jit.exit_reasons import (
    UNFINISHED as UNFINISHED_EXIT,
)
from emu.dspic30f.jit.translate.boundary import DONE, PYTHON, UNFINISHED, boundary_text
from emu.system.events import NEVER

DISPATCH: Final = """
declare i64 @llvm.cttz.i64(i64, i1)
declare i64 @llvm.umax.i64(i64, i64)
define i64 @entry(ptr noalias %rec, ptr %env) {{
first:
  %pc_place = getelementptr i8, ptr %rec, i64 {pc}
  %repeat_place = getelementptr i8, ptr %rec, i64 {repeat}
  %blocks_place = getelementptr i64, ptr %env, i64 {blocks}
  %steps_place = getelementptr i64, ptr %env, i64 {steps}
  %arrived_place = getelementptr i64, ptr %env, i64 {arrived}
  store i64 {never}, ptr %arrived_place
  %blocks = load ptr, ptr %blocks_place
  %steps = load ptr, ptr %steps_place
  %begin_place = getelementptr i64, ptr %env, i64 {begin}
  %begin = load i64, ptr %begin_place
  %inside = icmp eq i64 %begin, 0
  br i1 %inside, label %loop, label %serve
loop:
  %pc = load i32, ptr %pc_place
  %known = icmp ult i32 %pc, {flash_end}
  br i1 %known, label %lookup, label %miss, !prof !0
lookup:
  %half = lshr i32 %pc, 1
  %word = zext i32 %half to i64
  %repeat = load i16, ptr %repeat_place
  %repeating = icmp ne i16 %repeat, 0
  br i1 %repeating, label %single, label %block
block:
  %place = getelementptr ptr, ptr %blocks, i64 %word
  %code = load ptr, ptr %place
  %none = icmp eq ptr %code, null
  br i1 %none, label %single, label %call
call:
  %why = call i64 %code(ptr %rec, ptr %env)
  switch i64 %why, label %back [ i64 {next}, label %loop
                                 i64 {boundary_work}, label %serve
                                 i64 {deadline}, label %again
                                 i64 {retfie}, label %returned ]
again:
  %pc2 = load i32, ptr %pc_place
  %half2 = lshr i32 %pc2, 1
  %word2 = zext i32 %half2 to i64
  br label %single
single:
  %at = phi i64 [ %word, %lookup ], [ %word, %block ], [ %word2, %again ]
  %place2 = getelementptr ptr, ptr %steps, i64 %at
  %code2 = load ptr, ptr %place2
  %none2 = icmp eq ptr %code2, null
  br i1 %none2, label %miss, label %step
step:
  %why2 = call i64 %code2(ptr %rec, ptr %env)
  switch i64 %why2, label %back2 [ i64 {next}, label %loop
                                   i64 {boundary_work}, label %serve
                                   i64 {arrive}, label %arrive
                                   i64 {retfie}, label %returned ]
arrive:
  %upto = load i64, ptr %arrived_place
  %due6 = call i64 @fire(ptr %rec, i64 %upto)
  %refused6 = icmp eq i64 %due6, 0
  br i1 %refused6, label %unarrived, label %arrived
unarrived:
  ret i64 {interpret}
arrived:
  %deadline_place = getelementptr i8, ptr %rec, i64 {deadline_at}
  %deadline6 = load i64, ptr %deadline_place
  %kicked = icmp eq i64 %deadline6, 0
  %settled6 = select i1 %kicked, i64 0, i64 %due6
  store i64 %settled6, ptr %deadline_place
  %cycle_place6 = getelementptr i8, ptr %rec, i64 {cycle}
  %cycle6 = load i64, ptr %cycle_place6
  store i64 %cycle6, ptr %arrived_place
  br label %again
returned:
  br i1 {returns}, label %unsure, label %resumed
resumed:
  %limit3 = load i64, ptr %env
  %entered3 = getelementptr i64, ptr %env, i64 {entered}
  %count3 = load i64, ptr %entered3
  %rest3 = call i64 @boundary(ptr %rec, i64 %limit3, ptr %entered3)
  %done3 = icmp eq i64 %rest3, {done}
  %count4 = load i64, ptr %entered3
  %refused = icmp eq i64 %count3, %count4
  br i1 %refused, label %third, label %accepted
accepted:
  br i1 %done3, label %loop, label %boundary
third:
  br i1 %done3, label %last, label %unsure
unsure:
  ret i64 {retfie}
last:
{third}
  %cycle_place = getelementptr i8, ptr %rec, i64 {cycle}
  %cycle3 = load i64, ptr %cycle_place
  %cycle4 = add i64 %cycle3, 1
  store i64 %cycle4, ptr %cycle_place
  br label %loop
serve:
  %limit = load i64, ptr %env
  %entered = getelementptr i64, ptr %env, i64 {entered}
  %rest = call i64 @boundary(ptr %rec, i64 %limit, ptr %entered)
  %served = icmp eq i64 %rest, {done}
  br i1 %served, label %loop, label %boundary
boundary:
  %rest1 = phi i64 [ %rest3, %accepted ], [ %rest, %serve ]
  %unfinished = icmp eq i64 %rest1, {unfinished}
  br i1 %unfinished, label %finish, label %limited
finish:
  ret i64 {unfinished_exit}
limited:
  %limit_now = load i64, ptr %env
  %cycle_place2 = getelementptr i8, ptr %rec, i64 {cycle}
  %cycle5 = load i64, ptr %cycle_place2
  %reached = icmp uge i64 %cycle5, %limit_now
  %last_place = getelementptr i64, ptr %env, i64 {last}
  %last_limit = load i64, ptr %last_place
  %further = icmp ult i64 %limit_now, %last_limit
  %passed_count_place = getelementptr i64, ptr %env, i64 {passed_count}
  %passed_count = load i64, ptr %passed_count_place
  %room = icmp ult i64 %passed_count, {room}
  %further_room = and i1 %further, %room
  %passes = and i1 %reached, %further_room
  br i1 %passes, label %pass, label %stop
stop:
  ret i64 {boundary_work}
pass:
  %passed_list = getelementptr i64, ptr %env, i64 {passed}
  %entry_place = getelementptr i64, ptr %passed_list, i64 %passed_count
  store i64 %cycle5, ptr %entry_place
  %passed_count1 = add i64 %passed_count, 1
  store i64 %passed_count1, ptr %passed_count_place
  %period_place = getelementptr i64, ptr %env, i64 {period}
  %period = load i64, ptr %period_place
  %limit_next = add i64 %limit_now, %period
  %limit_new = call i64 @llvm.umin.i64(i64 %limit_next, i64 %last_limit)
  store i64 %limit_new, ptr %env
  br label %serve
back:
  ret i64 %why
back2:
  ret i64 %why2
miss:
  ret i64 {miss}
}}
!0 = !{{!"branch_weights", i32 2000, i32 1}}
"""


NO_BOUNDARY: Final = f"""declare i64 @llvm.umin.i64(i64, i64)
define internal i64 @boundary(ptr %rec, i64 %limit, ptr %entered) {{
  ret i64 {PYTHON}
}}
define internal i64 @fire(ptr %rec, i64 %last) {{
  ret i64 0
}}
"""
"""IR of boundaries that native code leaves to Python."""


def dispatch_text(core: Core, flash_end: int, counter: BoundaryCounter | None = None) -> str:
    """Return the IR of the dispatch loop and its boundaries. `flash_end` is the end of flash in PC units."""
    counter = counter if counter is not None else BoundaryCounter()
    offset = {name: core.record.fields[f"cpu.{name}"].offset for name in ("pc", "repeat", "cycle")}
    boundary = boundary_text(core, counter) if counter.is_native else NO_BOUNDARY
    return boundary + DISPATCH.format(
        **offset,
        third=counter.third_cycle(),
        returns=str(counter.returns_after_retfie).lower(),
        flash_end=flash_end,
        blocks=BLOCKS,
        steps=STEPS,
        entered=INTERRUPTS,
        begin=AT_BOUNDARY,
        arrived=ARRIVED,
        never=NEVER,
        arrive=ARRIVE,
        interpret=INTERPRET,
        deadline_at=core.record.fields["events.deadline"].offset,
        next=NEXT,
        retfie=RETFIE,
        deadline=DEADLINE,
        boundary_work=BOUNDARY_WORK,
        miss=MISS,
        done=DONE,
        unfinished=UNFINISHED,
        unfinished_exit=UNFINISHED_EXIT,
        period=PERIOD,
        last=LAST_LIMIT,
        passed_count=PASSED_COUNT,
        passed=PASSED,
        room=PASSED_ROOM,
    )
