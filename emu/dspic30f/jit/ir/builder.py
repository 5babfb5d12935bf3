"""Builder that translates an instruction row to LLVM IR (contract: isa/builder.py).

An instruction commits its effects only after all its addresses have been checked. If a check fails, or an access needs
Python, native code leaves through the *slow exit* of the instruction. The machine is then in its state before the
instruction, which the interpreter executes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.isa.builder import Context, Side, Size
from emu.dspic30f.jit.environment import INDIRECT_SFR
from emu.dspic30f.jit.exit_reasons import INTERPRET
from emu.dspic30f.jit.ir.deferred import DeferredEffects, IndirectStore
from emu.dspic30f.jit.ir.rule_emitter import AccessEmitter, LlvmRulePaths
from emu.dspic30f.jit.ir.values import Emitter, Number, Value, truth, wide
from emu.dspic30f.jit.ir.variables import Variables, pointer
from emu.dspic30f.jit.machine_layout import MachineLayout
from emu.dspic30f.state.data_space import W_END
from emu.dspic30f.state.registers import NSTDIS
from emu.dspic30f.state.state import FLAGS, SA, SAB, SB, STACK_POINTER
from emu.system.device import flag_row

CALLING_CONVENTION: Final = "preserve_mostcc"
"""Calling convention of the helper for indirect SFR access. The callee saves registers, because calls are rare."""


class NeedsInterpreter(Exception):
    """The instruction has no native translation, so the interpreter executes it."""


class LlvmBuilder:
    """Builder for the instructions of one function. `begin` and `commit` enclose each instruction."""

    def __init__(self, emitter: Emitter, variables: Variables, layout: MachineLayout, context: Context) -> None:
        self.e: Final = emitter
        self.v: Final = variables
        self.layout: Final = layout
        self.context: Final = context
        self.pc = 0
        self.now: Number = 0
        """Cycle in which the instruction being translated accesses data."""
        self.psv_cycles: int | None = 2
        self.deferred = DeferredEffects()
        self.repeating: Number | None = None
        """Value of RCOUNT that a REPEAT target reads; None outside a REPEAT target."""
        self.left_count: Number | None = None
        """Count of a REPEAT whose state is not stored in the record; None if it is."""
        self.dsp_region = False
        """Whether the function contains a write of accumulator flags; SR in the record may then lack them."""
        self.before_slow: Callable[[], None] = lambda: None
        """Function that emits the beginning of a slow exit."""
        self.reach: Callable[[Number], Number] | None = None
        """reach(waited): returns whether no event is due up to an indirect SFR access delayed by `waited` cycles.

        None means that the interpreter performs such an access.
        """
        self.loads_ahead = 0
        """Number of the instruction's loads that follow the next one. Each is one cycle later (engines.md §4.2)."""
        self.several_stores = False
        """Whether the instruction has several stores.

        The interpreter then performs a store to an SFR, because native code cannot undo the others.
        """
        self._slow: str | None = None

    # -- instruction frame ------------------------------------------------------------------------------------------
    def begin(self, pc: int, psv_cycles: int | None) -> None:
        """Begin the instruction at `pc`. `psv_cycles` is the number of additional cycles of a PSV read (isa.md §13.3).

        None marks a REPEAT target, whose PSV reads the interpreter performs. The caller then sets `repeating`.
        """
        self.pc = pc
        self.psv_cycles = psv_cycles
        self.deferred = DeferredEffects()
        self.reach = None
        self._slow = None

    def commit(self) -> None:
        """Emit the deferred effects after all addresses have been checked."""
        p = self.deferred
        if p.indirect_store is not None:
            self._store_indirect(p.indirect_store)
        for store in p.stores:
            store()
        for n, value in p.w.items():
            self.v.set(f"W{n}", value)
        if p.flags:
            self.v.set_flags(p.flags)
        for i, value in p.acc.items():
            self.v.set(f"A{i}", value)
        for name, value in p.registers.items():
            self.e.store(pointer(self.e, self.layout.offset[name]), value, 16)
        unknown = p.initialises & ~self.layout.initialised
        if unknown:
            place = pointer(self.e, self.layout.offset["cpu.initialised"])
            self.e.store(place, self.e.load(place, 16) | unknown, 16)
        if p.sr is not None:
            self._commit_sr(*p.sr)

    @property
    def slow_label(self) -> str:
        """Return the label of the slow exit, which is emitted at its first use."""
        if self._slow is None:
            self._slow = self.e.fresh("slow")
            current = self.e.block
            self.e.start(self._slow)
            self.before_slow()
            if self.repeating is not None and self.left_count is not None:
                count, left = self.left_count, self.repeating
                LlvmRulePaths(self.e).all(lambda m: flow_rules.restore_repeat(m, self.layout.flow, count, left))
            self.v.leave(self.pc, INTERPRET)
            self.e.block = current
        return self._slow

    def guard(self, ok: Number) -> None:
        """Leave through the slow exit unless `ok` holds."""
        if isinstance(ok, int):
            if not ok:
                raise NeedsInterpreter
            return
        label = self.e.fresh("ok")
        self.e.end(f"br i1 {truth(ok)}, label %{label}, label %{self.slow_label}, !prof !0")
        self.e.start(label)

    # -- values without side effects --------------------------------------------------------------------------------
    def select(self, c: Number, a: Number, b: Number) -> Number:
        """Emit a selection: `a` if `c` else `b`."""
        return self.e.select(c, a, b)

    def let(self, v: Number) -> Number:
        """Return `v` itself, because every SSA value already has a name."""
        return v

    def div_trunc(self, a: Number, b: Number) -> Number:
        """Emit the quotient rounded towards zero; 0 if b is 0."""
        return self._divide("sdiv", a, b)

    def rem_trunc(self, a: Number, b: Number) -> Number:
        """Emit the remainder, which has the sign of a; 0 if b is 0."""
        return self._divide("srem", a, b)

    def _divide(self, op: str, a: Number, b: Number) -> Number:
        zero = self.e.let(f"icmp eq i64 {wide(b)}, 0", bit=True)
        safe = self.select(zero, 1, b)
        return self.select(zero, 0, self.e.let(f"{op} i64 {wide(a)}, {wide(safe)}"))

    def clz16(self, v: Number) -> Number:
        """Emit the number of leading zeros of a 16-bit value; 16 for 0."""
        return self._count("ctlz", v)

    def ctz16(self, v: Number) -> Number:
        """Emit the number of trailing zeros of a 16-bit value; 16 for 0."""
        return self._count("cttz", v)

    def _count(self, which: str, v: Number) -> Value:
        half = self.e.let(f"trunc i64 {wide(v)} to i16").text
        count = self.e.let(f"call i16 @llvm.{which}.i16(i16 {half}, i1 false)").text
        return self.e.let(f"zext i16 {count} to i64")

    # -- working registers ------------------------------------------------------------------------------------------
    def w(self, n: int) -> Number:
        """Return Wn as data."""
        return self.deferred.w[n] if n in self.deferred.w else self.v.get(f"W{n}")

    def set_w(self, n: int, v: Number) -> None:
        """Defer a word write of Wn."""
        self.deferred.w[n] = v & (0xFFFE if n == STACK_POINTER else 0xFFFF)
        self.deferred.initialises |= 1 << n

    def set_wb(self, n: int, v: Number) -> None:
        """Defer a byte write of Wn."""
        self.deferred.w[n] = (self.w(n) & 0xFF00) | (v & (0xFE if n == STACK_POINTER else 0xFF))

    def ptr(self, n: int, side: Side) -> Number:
        """Return Wn as address pointer. The interpreter performs the reset that an uninitialised one causes."""
        if not (self.layout.initialised | self.deferred.initialises) >> n & 1:
            flags = self.e.load(pointer(self.e, self.layout.offset["cpu.initialised"]), 16)
            self.guard((flags & (1 << n)) != 0)
        return self.w(n)

    def set_ptr(self, n: int, v: Number, side: Side) -> None:
        """Defer a pointer update of Wn."""
        self.deferred.w[n] = v & (0xFFFE if n == STACK_POINTER else 0xFFFF)
        self.deferred.initialises |= 1 << n

    # -- data memory ------------------------------------------------------------------------------------------------
    def load(self, ea: Number, size: Size, side: Side = "src", ptr: int | None = None) -> Number:
        """Emit a read of data space."""
        ahead, self.loads_ahead = self.loads_ahead, max(self.loads_ahead - 1, 0)
        if isinstance(ea, int):
            return self._load_static(ea, size)
        in_ram = self._in_ram(ea, size, ptr)
        window = bool(self.context.psv) and self.psv_cycles is not None
        if ptr == STACK_POINTER or not (window or self.reach):
            self.guard(in_ram)
            return self.e.load(pointer(self.e, ea), 8 * size)
        return self._load_indirect(ea, size, in_ram, window, self.now - ahead)

    def _in_ram(self, ea: Value, size: int, ptr: int | None) -> Value:
        """Return whether an address is aligned, in RAM and, as stack pointer, not above SPLIM (engines.md §4.3)."""
        first, end = self.layout.ram
        half = self.e.let(f"trunc i64 {wide(ea - first)} to i16").text
        if size == 2:
            half = self.e.let(f"call i16 @llvm.fshl.i16(i16 {half}, i16 {half}, i16 15)").text
        span = (end - first) // size
        ok = self.e.let(f"icmp ult i16 {half}, {span}", bit=True)
        if ptr == STACK_POINTER and self.layout.limit_armed:
            limit = self.e.load(pointer(self.e, self.layout.offset["SPLIM"]), 16)
            return ok & (ea <= limit)
        return ok

    def _load_indirect(self, ea: Value, size: Size, in_ram: Value, window: bool, now: Number) -> Value:
        """Emit a read at cycle `now` from RAM, from the PSV window if `window`, or from an SFR."""
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
            word = self._indirect_access(now, ea & 0xFFFE, 0, 0, "memory(read)")
            self.guard(word >= 0)
            found.append((wide(word if size == 2 else (word >> ((ea & 1) << 3)) & 0xFF), e.block.label))
            e.end(f"br label %{done}")
        e.start(done)
        if window:
            edges = ", ".join(f"[ {str(i == 1).lower()}, %{label} ]" for i, (_, label) in enumerate(found))
            self.deferred.psv_reads.append(e.let(f"phi i1 {edges}", bit=True))
        return e.let(f"phi i64 {', '.join(f'[ {value}, %{label} ]' for value, label in found)}")

    def _load_window(self, ea: Value, size: Size) -> tuple[str, str, str]:
        """Emit a read of the PSV window.

        Return the value, the label of the reading block, and the label of the block for addresses outside the window.
        """
        e = self.e
        window, elsewhere = e.fresh("psv"), e.fresh("elsewhere")
        fits = (ea & 0x8000) != 0
        if size == 2:
            fits = fits & ((ea & 1) == 0)
        page = e.load(pointer(e, self.layout.offset["PSVPAG"]), 16)
        word = ((page << 15) | (ea & 0x7FFE)) >> 1
        fits = fits & (word < self.layout.flash_words)
        e.end(f"br i1 {truth(fits)}, label %{window}, label %{elsewhere}")
        e.start(window)
        code = e.load(pointer(e, (word << 2) + self.layout.offset["flash"]), 32)
        shifted = code >> ((ea & 1) << 3) if size == 1 else code
        return wide(shifted & (0xFF if size == 1 else 0xFFFF)), window, elsewhere

    def _indirect_access(self, now: Number, address: Number, lanes: Number, value: Number, effect: str = "") -> Value:
        """Emit a call of the helper for indirect SFR access."""
        e, word, function = self.e, self.e.name(), self.e.name()
        e.line(f"{word} = getelementptr i64, ptr %env, i64 {INDIRECT_SFR}")
        e.line(f"{function} = load ptr, ptr {word}")
        numbers = ", ".join(f"i64 {wide(one)}" for one in (now, address, lanes, value))
        return e.let(f"call {CALLING_CONVENTION} i64 {function}(ptr %rec, {numbers}) cold nounwind {effect}")

    def waited(self) -> Number:
        """Return by how many cycles the instruction's PSV window reads delay it (isa.md §13.3)."""
        if not self.deferred.psv_reads or self.psv_cycles is None:
            return 0
        any_window: Number = 0
        for read in self.deferred.psv_reads:
            any_window = any_window | read
        return self.select(any_window, self.psv_cycles, 0)

    def _load_static(self, ea: int, size: Size) -> Number:
        """Emit a read of a static address: directly from memory, or from the word that another source provides."""
        if size == 2 and ea & 1:
            raise NeedsInterpreter
        address = ea & ~1
        self.deferred.touches_sfr |= self.layout.offset["SR"] < address < self.layout.ram[0]
        source = self._static_source(address, size)
        if source is None:
            return self.e.load(pointer(self.e, ea), 8 * size)
        word = source(self, address)
        return word if size == 2 else (word >> 8 if ea & 1 else word & 0xFF)

    def _static_source(self, address: int, size: Size) -> Callable[[LlvmBuilder, int], Number] | None:
        """Return the function that reads the word at `address`; None if the record holds the value to read.

        Raises NeedsInterpreter for an address that only the interpreter can read.
        """
        layout = self.layout
        if address < W_END:
            return LlvmBuilder._static_w
        if address in layout.tapped:
            raise NeedsInterpreter
        if address == layout.offset["SR"]:
            return LlvmBuilder._static_sr
        if self.repeating is not None:
            if address == layout.offset["RCOUNT"] and size == 2:
                return LlvmBuilder._static_rcount
        else:
            rule = layout.rules.get(address)
            if rule is not None and rule.reads is not None:
                return LlvmBuilder._static_rule
            if rule is not None and rule.reads_with_effect is not None:
                return LlvmBuilder._static_rule_with_effect
            if layout.accumulator_at(address) is not None:
                return LlvmBuilder._static_accumulator
        is_memory = layout.reads.get(address) == "plain" and self.repeating is None
        if not (is_memory or layout.ram[0] <= address < layout.ram[1]):
            raise NeedsInterpreter
        return None

    def _static_w(self, address: int) -> Number:
        return self.w(address >> 1)

    def _static_sr(self, _address: int) -> Number:
        return self.sr_word()

    def _static_rcount(self, _address: int) -> Number:
        assert self.repeating is not None
        return self.repeating

    def _static_rule(self, address: int) -> Number:
        rule = self.layout.rules[address]
        assert rule.reads is not None
        word: Number = rule.reads(AccessEmitter(self), rule.operands)
        return word

    def _static_rule_with_effect(self, address: int) -> Number:
        rule = self.layout.rules[address]
        assert rule.reads_with_effect is not None
        self.deferred.read_effect = True
        word: Number = rule.reads_with_effect(AccessEmitter(self), rule.operands)
        return word

    def _static_accumulator(self, address: int) -> Number:
        """Read 16 bits of an accumulator. Block code keeps accumulators in variables, not in the record."""
        part = self.layout.accumulator_at(address)
        assert part is not None
        accumulator, shift = part
        return self.acc(accumulator) >> shift & 0xFFFF

    def store(self, ea: Number, v: Number, size: Size, ptr: int | None = None) -> None:
        """Defer or emit a data write."""
        if isinstance(ea, int):
            self._store_static(ea, v, size)
            return
        in_ram, target = self._in_ram(ea, size, ptr), ea
        self.deferred.ram_stores.append((ea, size))
        if self.reach is not None and ptr != STACK_POINTER and not self.several_stores:
            self.deferred.indirect_store = IndirectStore(ea, v, size, in_ram)
            return
        self.guard(in_ram)
        self.deferred.stores.append(lambda: self.e.store(pointer(self.e, target), v, 8 * size))

    def _store_indirect(self, s: IndirectStore) -> None:
        """Emit a store to RAM or to an SFR. The SFR access is the last check of the instruction that can fail."""
        assert self.reach is not None
        e = self.e
        ram, device, done = (e.fresh(name) for name in ("ram", "device", "done"))
        e.end(f"br i1 {truth(s.in_ram)}, label %{ram}, label %{device}, !prof !0")
        e.start(device)
        waited = self.waited()
        self.guard(self.reach(waited) & ((s.address & (s.size - 1)) == 0))
        odd = s.address & 1
        lanes, placed = (0xFFFF, s.value) if s.size == 2 else (0xFF << (odd << 3), s.value << (odd << 3))
        self.guard(self._indirect_access(self.now + waited, s.address & 0xFFFE, lanes, placed) != 0)
        written = e.block.label
        e.end(f"br label %{done}")
        e.start(ram)
        e.store(pointer(e, s.address), s.value, 8 * s.size)
        e.end(f"br label %{done}")
        e.start(done)
        self.deferred.sfr_written = e.let(f"phi i1 [ true, %{written} ], [ false, %{ram} ]", bit=True)

    def _store_static(self, ea: int, v: Number, size: Size) -> None:
        """Defer a write of a static address: a W register, RAM, or an SFR."""
        if (size == 2 and ea & 1) or ea >= self.layout.ram[1]:
            raise NeedsInterpreter
        address = ea & ~1
        if address < W_END:
            self._store_w(address >> 1, ea & 1, v, size)
        elif address >= self.layout.ram[0]:
            self.deferred.ram_stores.append((ea, size))
            self.deferred.stores.append(lambda: self.e.store(pointer(self.e, ea), v, 8 * size))
        else:
            lanes = 0xFFFF if size == 2 else (0xFF00 if ea & 1 else 0x00FF)
            self._store_sfr(address, v << 8 if lanes == 0xFF00 else v, lanes)

    def _store_sfr(self, address: int, placed: Number, lanes: int) -> None:
        """Defer a write of the bits `lanes` of an SFR, by the SFR's rule if it has one, else by its kind of access."""
        rule = self.layout.rules.get(address)
        kind, mask = self.layout.writes.get(address, ("slow", 0))
        is_of_cpu = kind == "plain" and address < self.layout.offset["SR"]  # no device event reads or writes it
        self.deferred.touches_sfr |= rule is not None or not is_of_cpu
        if rule is not None and self.deferred.read_effect:  # the rule would use the device's state before the read
            raise NeedsInterpreter
        if rule is not None and rule.writes is not None and self.repeating is None:
            if not rule.writes(AccessEmitter(self), rule.operands, placed, lanes):
                raise NeedsInterpreter
            return
        if kind == "slow" or self.repeating is not None:
            raise NeedsInterpreter
        free = mask & lanes
        accumulator = self.layout.accumulator_at(address)
        if accumulator is not None:
            self._store_accumulator(*accumulator, placed, free)
        elif kind == "sr":
            self._store_sr(placed, free)
        else:
            if kind == "flags":
                self._store_flags(address, placed, free)
            if kind in ("irq", "flags"):
                self.deferred.check_interrupts = True
            self.deferred.stores.append(lambda: self._store_masked(address, placed, free))

    def _store_sr(self, placed: Number, free: int) -> None:
        """Defer a data write to SR. With saturation flags or NSTDIS set, the interpreter performs it."""
        old = self.sr_word()
        nstdis = self.e.load(pointer(self.e, self.layout.offset["INTCON1"]), 16) & NSTDIS
        self.guard(((old & (SA | SB | SAB)) | nstdis) == 0)
        self.deferred.sr = placed, free
        self.deferred.check_interrupts = True

    def _store_flags(self, address: int, placed: Number, free: int) -> None:
        """Defer the store of the cycle in which software sets an interrupt flag. The interpreter performs a write that
        sets several flags."""
        old = self.e.load(pointer(self.e, address), 16)
        rises = placed & free & (old ^ 0xFFFF)
        self.guard((rises & (rises - 1)) == 0)
        self.deferred.stores.append(lambda: self._store_request_cycle(address, rises))

    def _store_request_cycle(self, address: int, rises: Number) -> None:
        """Emit the store of the next cycle as the request cycle of the flag in `rises`, which has one flag at most."""
        bit = self.ctz16(rises | 0x8000)
        since = pointer(self.e, (bit << 3) + self.layout.offset["irq.since"] + 8 * flag_row(address))
        self.e.store(since, self.select(rises == 0, self.e.load(since, 64), self.now + 1), 64)

    def _store_accumulator(self, i: int, shift: int, v: Number, free: int) -> None:
        """Defer a data write to 16 bits of accumulator `i`.

        In the upper word only 8 bits are implemented (isa.md §2.1).
        """
        kept = self.acc(i) & (0xFF_FFFF_FFFF ^ (free << shift))
        self.deferred.acc[i] = ((kept | ((v & free) << shift)) ^ (1 << 39)) - (1 << 39)

    def _store_masked(self, address: int, v: Number, free: int) -> None:
        place = pointer(self.e, address)
        old = self.e.load(place, 16)
        self.e.store(place, (old & (0xFFFF & ~free)) | (v & free), 16)

    def _store_w(self, n: int, odd: int, v: Number, size: Size) -> None:
        """Defer a data write to a memory-mapped W register. It overrides a pointer update (isa.md §2.2)."""

        def now() -> None:
            keep = 0xFFFE if n == STACK_POINTER else 0xFFFF
            if size == 2:
                self.deferred.w[n] = v & keep
            elif odd:
                self.deferred.w[n] = (self.w(n) & 0x00FF) | ((v & 0xFF) << 8)
            else:
                self.deferred.w[n] = (self.w(n) & 0xFF00) | (v & 0xFF & keep)

        self.deferred.stores.append(now)
        self.deferred.mapped_w |= 1 << n
        if size == 2:
            self.deferred.initialises |= 1 << n

    def xload(self, ea: Number, ptr: int) -> Number:
        """Emit a MAC X prefetch, which reads 0 from Y RAM. The interpreter performs PSV prefetches."""
        assert isinstance(ea, Value)
        self.guard(self._in_ram(ea, 2, None))
        return self.select(ea < self.layout.y_ram, self.e.load(pointer(self.e, ea), 16), 0)

    def yload(self, ea: Number, ptr: int) -> Number:
        """Emit a MAC Y prefetch, which reads 0 outside Y RAM."""
        assert isinstance(ea, Value)
        self.guard(self._in_ram(ea, 2, None))
        return self.select(ea >= self.layout.y_ram, self.e.load(pointer(self.e, ea), 16), 0)

    # -- program memory ---------------------------------------------------------------------------------------------
    def prog(self, address: Number) -> Number:
        """Emit a table read from flash. The interpreter reads the rest of program memory."""
        word = address >> 1
        self.guard(word < self.layout.flash_words)
        return self.e.load(pointer(self.e, (word << 2) + self.layout.offset["flash"]), 32)

    def table_write(self, address: Number, byte_mask: Number, v: Number) -> None:
        """Defer a table write, which merges bytes into a programming latch.

        Under REPEAT the interpreter performs it.
        """
        if self.repeating is not None:
            raise NeedsInterpreter
        to, (first, end) = self.layout.latches, self.layout.latches.eeprom_range
        stored = (address >= first) & (address < end)
        bits = (byte_mask & 1) * 0xFF | (byte_mask >> 1 & 1) * 0xFF00 | (byte_mask >> 2 & 1) * 0xFF0000
        self.deferred.touches_sfr = True

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

        self.deferred.stores.append(now)

    # -- status, core registers -------------------------------------------------------------------------------------
    def flag(self, name: str) -> Number:
        """Return an SR bit."""
        return self.deferred.flags[name] if name in self.deferred.flags else self.v.get(name)

    def set_flags(self, **flags: Number) -> None:
        """Defer a change of SR bits."""
        self.deferred.flags.update(flags)

    def sr_word(self) -> Value:
        """Emit SR as an instruction reads it, with flags from the variables and other bits from the record."""
        if self.dsp_region or self.repeating is not None:
            raise NeedsInterpreter
        word: Number = self.e.load(pointer(self.e, self.layout.offset["SR"]), 16)
        ordinary = ("C", "Z", "OV", "N", "DC")
        word = word & (0xFFFF & ~sum(1 << FLAGS[name] for name in ordinary))
        for name in ordinary:
            bit = self.v.get(name)
            word = word | (bit << FLAGS[name])
        assert isinstance(word, Value)
        return word

    def _commit_sr(self, placed: Number, free: int) -> None:
        """Emit the data write to the bits `free` of SR, after the flags that the instruction itself sets."""
        word = (self.sr_word() & (0xFFFF & ~free)) | (placed & free)
        self.e.store(pointer(self.e, self.layout.offset["SR"]), word, 16)
        self.v.set_flags({name: (word & (1 << FLAGS[name])) != 0 for name in ("C", "Z", "OV", "N", "DC")})

    def reg(self, name: str) -> Number:
        """Return a core register."""
        if name == "RCOUNT" and self.repeating is not None:
            return self.repeating
        if name in self.deferred.registers:
            return self.deferred.registers[name]
        return self.e.load(pointer(self.e, self.layout.offset[name]), 16)

    def set_reg(self, name: str, v: Number) -> None:
        """Defer a write of a core register."""
        self.deferred.registers[name] = v

    def acc(self, i: int) -> Number:
        """Return an accumulator."""
        return self.deferred.acc[i] if i in self.deferred.acc else self.v.get(f"A{i}")

    def set_acc(self, i: int, v: Number) -> None:
        """Defer a write of an accumulator."""
        self.deferred.acc[i] = v

    def when(self, c: Number, fn: Callable[[], None]) -> None:
        """Run `fn` if the condition is a true constant. A condition known only at run time needs the interpreter."""
        if not isinstance(c, int):
            raise NeedsInterpreter
        if c:
            fn()

    def trap_math(self, c: Number) -> None:
        """Leave to the interpreter if the condition of a math trap holds."""
        self.guard(c == 0)
