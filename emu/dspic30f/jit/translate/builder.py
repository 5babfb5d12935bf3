"""The builder that turns an instruction row into LLVM IR (contract: isa/builder.py).

Nothing an instruction does is committed before all its addresses have been probed. A probe that fails, or an access
that only Python can make (a register with side effects, a trap, a cold memory), leaves through the instruction's
*slow exit* with the machine as it was before the instruction; the interpreter then runs it whole.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.isa.builder import Context, Side, Size
from emu.dspic30f.jit.exit_reasons import INTERPRET, Surroundings
from emu.dspic30f.jit.translate.deferred import Pending, Store
from emu.dspic30f.jit.translate.indirect_sfr import CONVENTION, POINTED
from emu.dspic30f.jit.translate.rule_emitter import LlvmWays, NativeReader
from emu.dspic30f.jit.translate.values import Emitter, Number, Value, truth, wide
from emu.dspic30f.jit.translate.variables import Variables, pointer
from emu.dspic30f.state.data_space import W_END
from emu.dspic30f.state.registers import NSTDIS
from emu.dspic30f.state.state import FLAGS, SA, SAB, SB, STACK_POINTER
from emu.system.device import flag_row


class NeedsInterpreter(Exception):
    """This instruction is left to the interpreter in every case."""


class LlvmBuilder:
    """One per function; `begin` and `commit` frame each instruction."""

    def __init__(self, emitter: Emitter, variables: Variables, around: Surroundings, context: Context) -> None:
        self.e: Final = emitter
        self.v: Final = variables
        self.around: Final = around
        self.context: Final = context
        self.pc = 0
        self.now: Number = 0
        """Cycle of the data access of the instruction being translated."""
        self.psv_cycles: int | None = 2
        self.pending = Pending()
        self.repeating: Number | None = None
        """RCOUNT as a REPEAT target sees it."""
        self.left_count: Number | None = None
        """The count of a REPEAT whose state is not in the record."""
        self.dsp_region = False
        """Some instruction of the function writes accumulator flags, so SR in the record may lack them."""
        self.before_slow: Callable[[], None] = lambda: None
        """Writes what goes into a slow exit first."""
        self.reach: Callable[[Number], Number] | None = None
        """Truth of "no event is due up to the access, which waits for so many cycles", for pointers that turn out to
        lead to a register. None: such an access is the interpreter's."""
        self.loads_ahead = 0
        """Loads that follow the next one of the instruction: each is made a cycle later (engines.md §4.2)."""
        self.several_stores = False
        """Of one instruction: a register's is then the interpreter's, who alone can do all or none."""
        self._slow: str | None = None

    # -- instruction frame ------------------------------------------------------------------------------------------
    def begin(self, pc: int, psv_cycles: int | None) -> None:
        """Start the instruction at `pc`; `psv_cycles` is what a PSV read adds to it (isa.md §13.3).

        None: it is a REPEAT target, of which PSV reads are the interpreter's; `repeating` is to be set.
        """
        self.pc = pc
        self.psv_cycles = psv_cycles
        self.pending = Pending()
        self.reach = None
        self._slow = None

    def commit(self) -> None:
        """All probes have been made: write registers, flags and memory."""
        p = self.pending
        if p.pointed is not None:
            self._store_pointed(p.pointed)
        for store in p.stores:
            store()
        for n, value in p.w.items():
            self.v.set(f"W{n}", value)
        if p.flags:
            self.v.set_flags(p.flags)
        for i, value in p.acc.items():
            self.v.set(f"A{i}", value)
        for name, value in p.registers.items():
            self.e.store(pointer(self.e, self.around.offset[name]), value, 16)
        unknown = p.initialises & ~self.around.initialised
        if unknown:
            place = pointer(self.e, self.around.offset["cpu.initialised"])
            self.e.store(place, self.e.load(place, 16) | unknown, 16)
        if p.sr is not None:
            self._commit_sr(*p.sr)

    @property
    def slow_label(self) -> str:
        """Label of the slow exit, which is made on first use."""
        if self._slow is None:
            self._slow = self.e.fresh("slow")
            current = self.e.block
            self.e.start(self._slow)
            self.before_slow()
            if self.repeating is not None and self.left_count is not None:
                count, left = self.left_count, self.repeating
                LlvmWays(self.e).all(lambda m: flow_rules.repeating(m, self.around.flow, count, left))
            self.v.leave(self.pc, INTERPRET)
            self.e.block = current
        return self._slow

    def guard(self, ok: Number) -> None:
        """Leave through the slow exit unless `ok`."""
        if isinstance(ok, int):
            if not ok:
                raise NeedsInterpreter
            return
        label = self.e.fresh("ok")
        self.e.end(f"br i1 {truth(ok)}, label %{label}, label %{self.slow_label}, !prof !0")
        self.e.start(label)

    # -- pure -------------------------------------------------------------------------------------------------------
    def select(self, c: Number, a: Number, b: Number) -> Number:
        """`a` if `c` else `b`."""
        return self.e.select(c, a, b)

    def let(self, v: Number) -> Number:
        """Names are free in SSA."""
        return v

    def div_trunc(self, a: Number, b: Number) -> Number:
        """Quotient towards zero; 0 if b is 0."""
        return self._divide("sdiv", a, b)

    def rem_trunc(self, a: Number, b: Number) -> Number:
        """Remainder with the sign of a; 0 if b is 0."""
        return self._divide("srem", a, b)

    def _divide(self, op: str, a: Number, b: Number) -> Number:
        zero = self.e.let(f"icmp eq i64 {wide(b)}, 0", bit=True)
        safe = self.select(zero, 1, b)
        return self.select(zero, 0, self.e.let(f"{op} i64 {wide(a)}, {wide(safe)}"))

    def clz16(self, v: Number) -> Number:
        """Leading zeros of a 16-bit value; 16 for 0."""
        return self._count("ctlz", v)

    def ctz16(self, v: Number) -> Number:
        """Trailing zeros of a 16-bit value; 16 for 0."""
        return self._count("cttz", v)

    def _count(self, which: str, v: Number) -> Value:
        half = self.e.let(f"trunc i64 {wide(v)} to i16").text
        count = self.e.let(f"call i16 @llvm.{which}.i16(i16 {half}, i1 false)").text
        return self.e.let(f"zext i16 {count} to i64")

    # -- working registers ------------------------------------------------------------------------------------------
    def w(self, n: int) -> Number:
        """Wn as data."""
        return self.pending.w[n] if n in self.pending.w else self.v.get(f"W{n}")

    def set_w(self, n: int, v: Number) -> None:
        """Word write."""
        self.pending.w[n] = v & (0xFFFE if n == STACK_POINTER else 0xFFFF)
        self.pending.initialises |= 1 << n

    def set_wb(self, n: int, v: Number) -> None:
        """Byte write."""
        self.pending.w[n] = (self.w(n) & 0xFF00) | (v & (0xFE if n == STACK_POINTER else 0xFF))

    def ptr(self, n: int, side: Side) -> Number:
        """Wn as address pointer; the reset of an uninitialised one is the interpreter's."""
        if not (self.around.initialised | self.pending.initialises) >> n & 1:
            flags = self.e.load(pointer(self.e, self.around.offset["cpu.initialised"]), 16)
            self.guard((flags & (1 << n)) != 0)
        return self.w(n)

    def set_ptr(self, n: int, v: Number, side: Side) -> None:
        """Pointer update."""
        self.pending.w[n] = v & (0xFFFE if n == STACK_POINTER else 0xFFFF)
        self.pending.initialises |= 1 << n

    # -- data memory ------------------------------------------------------------------------------------------------
    def load(self, ea: Number, size: Size, side: Side = "src", ptr: int | None = None) -> Number:
        """Data read."""
        ahead, self.loads_ahead = self.loads_ahead, max(self.loads_ahead - 1, 0)
        if isinstance(ea, int):
            return self._load_static(ea, size)
        in_ram = self._in_ram(ea, size, ptr)
        window = bool(self.context.psv) and self.psv_cycles is not None
        if ptr == STACK_POINTER or not (window or self.reach):
            self.guard(in_ram)
            return self.e.load(pointer(self.e, ea), 8 * size)
        return self._load_pointed(ea, size, in_ram, window, self.now - ahead)

    def _in_ram(self, ea: Value, size: int, ptr: int | None) -> Value:
        """Aligned, in RAM and, for the stack pointer, not above SPLIM: one comparison plus one (engines.md §4.3)."""
        first, end = self.around.ram
        half = self.e.let(f"trunc i64 {wide(ea - first)} to i16").text
        if size == 2:
            half = self.e.let(f"call i16 @llvm.fshl.i16(i16 {half}, i16 {half}, i16 15)").text
        span = (end - first) // size
        ok = self.e.let(f"icmp ult i16 {half}, {span}", bit=True)
        if ptr == STACK_POINTER and self.around.limit_armed:
            limit = self.e.load(pointer(self.e, self.around.offset["SPLIM"]), 16)
            return ok & (ea <= limit)
        return ok

    def _load_pointed(self, ea: Value, size: Size, in_ram: Value, window: bool, now: Number) -> Value:
        """From RAM, from the PSV window if it is open, or from a register in cycle `now`."""
        e = self.e
        ram, other, done = (e.fresh(s) for s in ("ram", "other", "done"))
        e.end(f"br i1 {truth(in_ram)}, label %{ram}, label %{other}, !prof !0")
        e.start(ram)
        found = [(wide(e.load(pointer(e, ea), 8 * size)), ram)]
        e.end(f"br label %{done}")
        e.start(other)
        if window:
            value, label, elsewhere = self._load_window(ea, size)
            found.append((value, label))
            e.end(f"br label %{done}")
            e.start(elsewhere)
        if self.reach is None:
            e.end(f"br label %{self.slow_label}")
        else:
            self.guard(self.reach(0) & ((ea & (size - 1)) == 0))
            word = self._pointed(now, ea & 0xFFFE, 0, 0, "memory(read)")
            self.guard(word >= 0)
            found.append((wide(word if size == 2 else (word >> ((ea & 1) << 3)) & 0xFF), e.block.label))
            e.end(f"br label %{done}")
        e.start(done)
        if window:
            ways = ", ".join(f"[ {str(i == 1).lower()}, %{label} ]" for i, (_, label) in enumerate(found))
            self.pending.psv.append(e.let(f"phi i1 {ways}", bit=True))
        return e.let(f"phi i64 {', '.join(f'[ {value}, %{label} ]' for value, label in found)}")

    def _load_window(self, ea: Value, size: Size) -> tuple[str, str, str]:
        """What the PSV window shows at an address, the block that has read it, and that of addresses not in it."""
        e = self.e
        window, elsewhere = e.fresh("psv"), e.fresh("elsewhere")
        fits = (ea & 0x8000) != 0
        if size == 2:
            fits = fits & ((ea & 1) == 0)
        page = e.load(pointer(e, self.around.offset["PSVPAG"]), 16)
        word = ((page << 15) | (ea & 0x7FFE)) >> 1
        fits = fits & (word < self.around.flash_words)
        e.end(f"br i1 {truth(fits)}, label %{window}, label %{elsewhere}")
        e.start(window)
        code = e.load(pointer(e, (word << 2) + self.around.offset["flash"]), 32)
        shifted = code >> ((ea & 1) << 3) if size == 1 else code
        return wide(shifted & (0xFF if size == 1 else 0xFFFF)), window, elsewhere

    def _pointed(self, now: Number, word: Number, lanes: Number, value: Number, effect: str = "") -> Value:
        """Call what `pointed.py` makes."""
        e, place, function = self.e, self.e.name(), self.e.name()
        e.line(f"{place} = getelementptr i64, ptr %env, i64 {POINTED}")
        e.line(f"{function} = load ptr, ptr {place}")
        numbers = ", ".join(f"i64 {wide(one)}" for one in (now, word, lanes, value))
        return e.let(f"call {CONVENTION} i64 {function}(ptr %rec, {numbers}) cold nounwind {effect}")

    def waited(self) -> Number:
        """Cycles that reads of the PSV window have added to the instruction (isa.md §13.3)."""
        if not self.pending.psv or self.psv_cycles is None:
            return 0
        any_window: Number = 0
        for read in self.pending.psv:
            any_window = any_window | read
        return self.select(any_window, self.psv_cycles, 0)

    def _load_static(self, ea: int, size: Size) -> Number:
        if size == 2 and ea & 1:
            raise NeedsInterpreter
        word_address = ea & ~1
        if word_address < W_END:
            word = self.w(word_address >> 1)
            return word if size == 2 else (word >> 8 if ea & 1 else word & 0xFF)
        if word_address == self.around.offset["SR"]:
            value = self.sr_word()
            return value if size == 2 else (value >> 8 if ea & 1 else value & 0xFF)
        self.pending.touches_sfr |= self.around.offset["SR"] < word_address < self.around.ram[0]
        rule = self.around.rules.get(word_address)
        if rule is not None and rule.reads is not None and self.repeating is None:
            shown: Number = rule.reads(NativeReader(self), rule.places)
            return shown if size == 2 else (shown >> 8 if ea & 1 else shown & 0xFF)
        if rule is not None and rule.takes is not None and self.repeating is None:
            self.pending.taken = True
            taken: Number = rule.takes(NativeReader(self), rule.places)
            return taken if size == 2 else (taken >> 8 if ea & 1 else taken & 0xFF)
        if word_address == self.around.offset["RCOUNT"] and self.repeating is not None and size == 2:
            return self.repeating
        place = self.around.accumulator_at(word_address)
        if place is not None and self.repeating is None:  # block code keeps accumulators out of the record
            part = self.acc(place[0]) >> place[1] & 0xFFFF
            return part if size == 2 else (part >> 8 if ea & 1 else part & 0xFF)
        kept = self.around.reads.get(word_address) == "plain" and self.repeating is None
        if word_address < self.around.ram[0] and not kept:
            raise NeedsInterpreter
        if ea >= self.around.ram[1]:
            raise NeedsInterpreter
        return self.e.load(pointer(self.e, ea), 8 * size)

    def store(self, ea: Number, v: Number, size: Size, ptr: int | None = None) -> None:
        """Data write."""
        if isinstance(ea, int):
            self._store_static(ea, v, size)
            return
        in_ram, target = self._in_ram(ea, size, ptr), ea
        if self.reach is not None and ptr != STACK_POINTER and not self.several_stores:
            self.pending.pointed = Store(ea, v, size, in_ram)
            return
        self.guard(in_ram)
        self.pending.stores.append(lambda: self.e.store(pointer(self.e, target), v, 8 * size))

    def _store_pointed(self, s: Store) -> None:
        """To RAM or to a register, which is the last that can refuse."""
        assert self.reach is not None
        e = self.e
        ram, device, done = (e.fresh(name) for name in ("ram", "device", "done"))
        e.end(f"br i1 {truth(s.in_ram)}, label %{ram}, label %{device}, !prof !0")
        e.start(device)
        waited = self.waited()
        self.guard(self.reach(waited) & ((s.address & (s.size - 1)) == 0))
        odd = s.address & 1
        lanes, placed = (0xFFFF, s.value) if s.size == 2 else (0xFF << (odd << 3), s.value << (odd << 3))
        self.guard(self._pointed(self.now + waited, s.address & 0xFFFE, lanes, placed) != 0)
        written = e.block.label
        e.end(f"br label %{done}")
        e.start(ram)
        e.store(pointer(e, s.address), s.value, 8 * s.size)
        e.end(f"br label %{done}")
        e.start(done)
        self.pending.left = e.let(f"phi i1 [ true, %{written} ], [ false, %{ram} ]", bit=True)

    def _store_static(self, ea: int, v: Number, size: Size) -> None:
        if (size == 2 and ea & 1) or ea >= self.around.ram[1]:
            raise NeedsInterpreter
        word_address = ea & ~1
        if word_address < W_END:
            self._store_w(word_address >> 1, ea & 1, v, size)
            return
        if word_address >= self.around.ram[0]:
            self.pending.stores.append(lambda: self.e.store(pointer(self.e, ea), v, 8 * size))
            return
        self.pending.touches_sfr = True
        rule = self.around.rules.get(word_address)
        lanes = 0xFFFF if size == 2 else (0xFF00 if ea & 1 else 0x00FF)
        placed = v << 8 if lanes == 0xFF00 else v
        if rule is not None and self.pending.taken:  # it would see the device as it was before the read
            raise NeedsInterpreter
        if rule is not None and rule.writes is not None and self.repeating is None:
            if not rule.writes(NativeReader(self), rule.places, placed, lanes):
                raise NeedsInterpreter
            return
        how, mask = self.around.writes.get(word_address, ("slow", 0))
        if how == "slow" or self.repeating is not None:
            raise NeedsInterpreter
        place = self.around.accumulator_at(word_address)
        if place is not None:
            self._store_accumulator(*place, placed, mask & lanes)
            return
        if how == "sr":
            old = self.sr_word()
            nstdis = self.e.load(pointer(self.e, self.around.offset["INTCON1"]), 16) & NSTDIS
            self.guard(((old & (SA | SB | SAB)) | nstdis) == 0)
            self.pending.sr = placed, mask & lanes
            self.pending.stop = True
            return
        if how == "flags":
            old = self.e.load(pointer(self.e, word_address), 16)
            rises = placed & (mask & lanes) & (old ^ 0xFFFF)
            self.guard((rises & (rises - 1)) == 0)
            self.pending.stores.append(lambda: self._rise(word_address, rises))
        if how in ("irq", "flags"):
            self.pending.stop = True
        self.pending.stores.append(lambda: self._store_masked(word_address, placed, mask & lanes))

    def _rise(self, address: int, rises: Number) -> None:
        """A flag that software sets, one at most, is first 1 in the next cycle."""
        bit = self.ctz16(rises | 0x8000)
        since = pointer(self.e, (bit << 3) + self.around.offset["irq.since"] + 8 * flag_row(address))
        self.e.store(since, self.select(rises == 0, self.e.load(since, 64), self.now + 1), 64)

    def _store_accumulator(self, i: int, shift: int, v: Number, free: int) -> None:
        """A data write to 16 bits of accumulator `i`, or to the 8 that are kept of the upper word (isa.md §2.1)."""
        kept = self.acc(i) & (0xFF_FFFF_FFFF ^ (free << shift))
        self.pending.acc[i] = ((kept | ((v & free) << shift)) ^ (1 << 39)) - (1 << 39)

    def _store_masked(self, address: int, v: Number, free: int) -> None:
        place = pointer(self.e, address)
        old = self.e.load(place, 16)
        self.e.store(place, (old & (0xFFFF & ~free)) | (v & free), 16)

    def _store_w(self, n: int, odd: int, v: Number, size: Size) -> None:
        """The data write to a memory-mapped register wins over a pointer update (isa.md §2.2)."""

        def now() -> None:
            keep = 0xFFFE if n == STACK_POINTER else 0xFFFF
            if size == 2:
                self.pending.w[n] = v & keep
            elif odd:
                self.pending.w[n] = (self.w(n) & 0x00FF) | ((v & 0xFF) << 8)
            else:
                self.pending.w[n] = (self.w(n) & 0xFF00) | (v & 0xFF & keep)

        self.pending.stores.append(now)
        self.pending.mapped |= 1 << n
        if size == 2:
            self.pending.initialises |= 1 << n

    def xload(self, ea: Number, ptr: int) -> Number:
        """MAC X prefetch: 0 from Y RAM; PSV prefetches are the interpreter's."""
        assert isinstance(ea, Value)
        self.guard(self._in_ram(ea, 2, None))
        return self.select(ea < self.around.y_ram, self.e.load(pointer(self.e, ea), 16), 0)

    def yload(self, ea: Number, ptr: int) -> Number:
        """MAC Y prefetch: 0 from outside Y RAM."""
        assert isinstance(ea, Value)
        self.guard(self._in_ram(ea, 2, None))
        return self.select(ea >= self.around.y_ram, self.e.load(pointer(self.e, ea), 16), 0)

    # -- program memory ---------------------------------------------------------------------------------------------
    def prog(self, address: Number) -> Number:
        """Table read from flash; everything else is the interpreter's."""
        word = address >> 1
        self.guard(word < self.around.flash_words)
        return self.e.load(pointer(self.e, (word << 2) + self.around.offset["flash"]), 32)

    def table_write(self, address: Number, byte_mask: Number, v: Number) -> None:
        """Merge bytes into a programming latch; as a REPEAT target it is the interpreter's."""
        if self.repeating is not None:
            raise NeedsInterpreter
        to, (first, end) = self.around.latches, self.around.latches.eeprom_range
        stored = (address >= first) & (address < end)
        bits = (byte_mask & 1) * 0xFF | (byte_mask >> 1 & 1) * 0xFF00 | (byte_mask >> 2 & 1) * 0xFF0000
        self.pending.touches_sfr = True

        def now() -> None:
            for place, count, size, here in (
                (to.flash, to.flash_count, 4, stored == 0),
                (to.eeprom, to.eeprom_count, 2, stored),
            ):
                latch = pointer(self.e, (address >> 1 & count - 1) * size + place)
                old = self.e.load(latch, 8 * size)
                self.e.store(latch, self.select(here, (old & (bits ^ 0xFFFFFF)) | (v & bits), old), 8 * size)
            if to.captured_in is not None:
                self.e.store(pointer(self.e, to.captured_in[0]), address & 0xFFFF, 16)
                self.e.store(pointer(self.e, to.captured_in[1]), address >> 16 & 0xFF, 16)

        self.pending.stores.append(now)

    # -- status, core registers -------------------------------------------------------------------------------------
    def flag(self, name: str) -> Number:
        """An SR bit."""
        return self.pending.flags[name] if name in self.pending.flags else self.v.get(name)

    def set_flags(self, **flags: Number) -> None:
        """Change SR bits."""
        self.pending.flags.update(flags)

    def sr_word(self) -> Value:
        """SR as an instruction reads it: flags from the variables, the rest from the record."""
        if self.dsp_region or self.repeating is not None:
            raise NeedsInterpreter
        word: Number = self.e.load(pointer(self.e, self.around.offset["SR"]), 16)
        ordinary = ("C", "Z", "OV", "N", "DC")
        word = word & (0xFFFF & ~sum(1 << FLAGS[name] for name in ordinary))
        for name in ordinary:
            bit = self.v.get(name)
            word = word | (bit << FLAGS[name])
        assert isinstance(word, Value)
        return word

    def _commit_sr(self, placed: Number, free: int) -> None:
        """The data write to the bits `free` of SR; it comes behind the flags that the instruction sets by itself."""
        word = (self.sr_word() & (0xFFFF & ~free)) | (placed & free)
        self.e.store(pointer(self.e, self.around.offset["SR"]), word, 16)
        self.v.set_flags({name: (word & (1 << FLAGS[name])) != 0 for name in ("C", "Z", "OV", "N", "DC")})

    def reg(self, name: str) -> Number:
        """A core register."""
        if name == "RCOUNT" and self.repeating is not None:
            return self.repeating
        if name in self.pending.registers:
            return self.pending.registers[name]
        return self.e.load(pointer(self.e, self.around.offset[name]), 16)

    def set_reg(self, name: str, v: Number) -> None:
        """Write a core register."""
        self.pending.registers[name] = v

    def acc(self, i: int) -> Number:
        """An accumulator."""
        return self.pending.acc[i] if i in self.pending.acc else self.v.get(f"A{i}")

    def set_acc(self, i: int, v: Number) -> None:
        """Write an accumulator."""
        self.pending.acc[i] = v

    def when(self, c: Number, fn: Callable[[], None]) -> None:
        """Conditional effects: only constant conditions are native."""
        if not isinstance(c, int):
            raise NeedsInterpreter
        if c:
            fn()

    def trap_math(self, c: Number) -> None:
        """A math trap is the interpreter's."""
        self.guard(c == 0)
