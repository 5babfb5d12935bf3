"""Recording of arrivals in native code (emu/system/arrivals.py).

Native code records an arrival together with the effects of the instruction, because until then it may leave the
function, and Python would record the same arrival.
"""

from __future__ import annotations

from typing import Final

from emu.dspic30f.isa.flow import Repeat
from emu.dspic30f.jit.environment import ARRIVALS, NOWHERE, RESUME, SEEN
from emu.dspic30f.jit.exit_reasons import HOOK
from emu.dspic30f.jit.ir.values import Emitter, Number, Value, truth, wide
from emu.dspic30f.jit.ir.variables import pointer
from emu.dspic30f.jit.translate.frame import FunctionFrame
from emu.dspic30f.jit.translate.region import Step
from emu.dspic30f.state.data_space import W_END
from emu.system.arrivals import COUNTS, LOGGED, ROOM, LoggedNumber, Recording


class ArrivalRecorder:
    """Emits IR that records arrivals at the hooked addresses of one function: a count and a log."""

    def __init__(self, frame: FunctionFrame) -> None:
        self._f: Final = frame
        self._pending: tuple[Recording, Value, list[Number]] | None = None
        """Recording of the instruction being translated, host address of the log or 0, cycle and numbers."""

    def prepare(self, step: Step) -> bool:
        """Emit what precedes the first instruction of a block. Return whether native code records arrivals at it.

        Python does so at a REPEAT, which may leave native code after the recording.
        """
        f, e = self._f, self._f.e
        self._pending = None
        recording = f.layout.recorded.get(step.pc)
        if recording is None or step.facts.flow is Repeat:
            return False
        resume_place, cycle = _word(e, "%env", RESUME), f.v.get("cycle")
        resume, log, skipped = (e.load(_word(e, "%env", word), 64) for word in (RESUME, ARRIVALS, SEEN))
        is_called = resume == step.pc
        e.line(f"store i64 {wide(e.select(is_called, NOWHERE, resume))}, ptr {resume_place}, align 1")
        chosen = e.select(is_called | (skipped == cycle), 0, log)
        assert isinstance(chosen, Value)
        if recording.first is not None:
            look, on = e.fresh("look"), e.fresh("on")
            e.end(f"br i1 {truth(chosen != 0)}, label %{look}, label %{on}")
            e.start(look)
            fits = e.load(_word(e, _address(e, chosen), LOGGED), 64) != ROOM
            e.end(f"br i1 {truth(fits)}, label %{on}, label %{f.exit(step.pc, HOOK)}, !prof !0")
            e.start(on)
        self._pending = recording, chosen, [cycle, *map(self._number, recording.numbers)]
        return True

    def record(self) -> None:
        """Emit the recording for the instruction that has just taken effect, if its address is recorded."""
        pending, self._pending = self._pending, None
        if pending is None:
            return
        (recording, log, (cycle, *numbers)), e = pending, self._f.e
        some, on = e.fresh("some"), e.fresh("on")
        e.end(f"br i1 {truth(log != 0)}, label %{some}, label %{on}")
        e.start(some)
        memory = _address(e, log)
        count = _word(e, memory, COUNTS + recording.place)
        e.store(count, e.load(count, 64) + 1, 64)
        if recording.first is not None:
            logged_place = _word(e, memory, LOGGED)
            logged = e.load(logged_place, 64)
            for word, number in enumerate((cycle, recording.place, *numbers)):
                e.store(_word(e, memory, logged * recording.entry_words + recording.first + word), number, 64)
            e.store(logged_place, logged + 1, 64)
        e.end(f"br label %{on}")
        e.start(on)

    def _number(self, one: LoggedNumber) -> Number:
        """Emit a read of a number before the instruction takes effect."""
        f, e = self._f, self._f.e
        if one.address >= W_END:
            return e.load(pointer(e, one.address), 8 * one.size)
        number: Number = 0
        for byte in range(one.address, one.address + one.size, 2):
            number = number | f.v.get(f"W{byte >> 1}") << 8 * (byte - one.address)
        return number & (1 << 8 * one.size) - 1


def _address(e: Emitter, log: Value) -> str:
    name = e.name()
    e.line(f"{name} = inttoptr i64 {log.text} to ptr")
    return name


def _word(e: Emitter, base: str, word: Number) -> str:
    name = e.name()
    e.line(f"{name} = getelementptr i64, ptr {base}, i64 {wide(word)}")
    return name
