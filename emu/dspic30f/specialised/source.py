"""The builder that writes Python source: the meaning of instructions as statements on the state record.

One `Source` writes one function. W registers and SR are written through to the record, so the state is exact at every
instruction boundary except for two things that are settled on the way out: PC, CYCLE and STALL, which are constants of
the place, and flags, which stay expressions until somebody needs them. Every access is tested first; if it is not
plain RAM, or if anything else asks for the sequencer, the function leaves *before* the instruction with nothing of it
done, and the plain interpreter runs it. All effects of an instruction come behind its last test.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from emu.dspic30f.interpreter.expressions import Expr, Number, choose, interval
from emu.dspic30f.isa.builder import Context, Side, Size
from emu.dspic30f.layout import Places
from emu.dspic30f.state.data_space import W_END
from emu.dspic30f.state.state import FLAGS, OA, OAB, OB, SA, SAB, SB, STACK_POINTER

DONE, CHANGED, PLAIN = range(3)
"""What a function returns: go on; go on but processor modes may have changed; let the sequencer run one instruction."""


class Unsupported(Exception):
    """The instruction is left to the sequencer."""


@dataclass(slots=True)
class _Pending:
    """Effects of the instruction being written."""

    w: dict[int, tuple[Number, bool]] = field(default_factory=dict)
    """Register to (value, counts as a word write)."""
    effects: list[str] = field(default_factory=list)
    flags: dict[str, Number] = field(default_factory=dict)
    stall: int = 0
    bus_write: bool = False
    mode_write: bool = False
    side_effect: bool = False


class Source:
    """A builder (isa/builder.py) whose values are `Expr` or int."""

    def __init__(self, places: Places, context: Context, initialised: int, limit_armed: bool) -> None:
        self.context = context
        self.places: Final = places
        self.lines: Final[list[str]] = []
        self.initialised = initialised
        self.pc = 0
        self.start = 0
        """Cycle of the present instruction (behind its stall) relative to `c`."""
        self.last = 0
        self.stall = 0
        """Registers the previous instruction wrote on its destination side."""
        self.modes_changed = False
        self.at_entry = True
        """The record is as it was when the function, or this round of its loop, began."""
        self.watches_events = False
        """Something here depends on events that may be due while it runs."""
        self._limit_armed: Final = limit_armed
        self._names = 0
        self._w: dict[int, Expr] = {}
        self._acc: dict[int, Number] = {}
        self._flags: dict[str, Number] = {}
        self._sr = ""
        self._pending = _Pending()
        self._indent = "    "
        self._before: tuple[int, dict[int, Expr], dict[int, Number], dict[str, Number], str] = (0, {}, {}, {}, "")

    # Writing text

    def emit(self, line: str) -> None:
        """Append a statement."""
        self.lines.append(self._indent + line)

    def nested(self, levels: int) -> None:
        """Statements from now on are `levels` deeper in the function."""
        self._indent = "    " * (1 + levels)

    def name(self, text: str, low: int, high: int) -> Expr:
        """Assign `text` to a new name."""
        self._names += 1
        name = f"t{self._names}"
        self.emit(f"{name} = {text}")
        return Expr(name, low, high, atom=True)

    def forget_values(self) -> None:
        """Nothing about registers is known in names any more (loop heads)."""
        self._w.clear()
        self._acc.clear()
        self._sr = ""

    def settle_flags(self) -> list[str]:
        """Statements that bring SR up to date with the flags of finished instructions."""
        if not self._flags:
            return []
        mask = sum(1 << FLAGS[name] for name in self._flags)
        terms = [f"{self._status()} & {~mask & 0xFFFF}"]
        for name, value in self._flags.items():
            terms.append(f"{value} << {FLAGS[name]}" if FLAGS[name] else f"{value}")
        text = " | ".join(terms)
        if not mask & (OA | OB | SA | SB):
            return [f"u16[{self.places.at['SR']}] = {text}"]
        return [
            f"f = {text}",
            f"f = f | {OAB} if f & {OA | OB} else f & {~OAB & 0xFFFF}",
            f"u16[{self.places.at['SR']}] = f | {SAB} if f & {SA | SB} else f & {~SAB & 0xFFFF}",
        ]

    def settle(self) -> None:
        """Bring SR up to date here."""
        for line in self.settle_flags():
            self.emit(line)
        self._flags.clear()
        self._sr = ""

    def leave(
        self,
        pc: Number,
        cycle: int,
        stall: int,
        status: int,
        under: str = "",
        write: Callable[[str], None] | None = None,
    ) -> None:
        """Return from the function with the next instruction at `pc`, starting `cycle` behind `c`.

        `under`: only if this condition holds; `write`: takes the lines instead of `emit`.
        """
        write = write or self.emit
        lines = self.settle_flags()
        at = self.places.at
        lines.append(f"u32[{at['cpu.pc']}] = {pc}")
        lines.append(f"u64[{at['cpu.cycle']}] = c + {cycle}" if cycle else f"u64[{at['cpu.cycle']}] = c")
        lines.append(f"u16[{at['cpu.stall']}] = {stall}")
        lines.append(f"return {CHANGED if status == DONE and self.modes_changed else status}")
        if under:
            write(f"if {under}:")
        for line in lines:
            write("    " + line if under else line)

    def bail(self, condition: str) -> None:
        """Leave before the present instruction if `condition`. At the entry nothing has been changed yet."""
        if self._pending.side_effect:
            raise Unsupported("a test behind a read with side effects")
        if self.at_entry:
            self.emit(f"if {condition}:")
            self.emit(f"    return {PLAIN}")
            return
        self.leave(self.pc, self.start, self.stall, PLAIN, under=condition)

    # One instruction

    def begin(self, pc: int, start: int, last: int) -> None:
        """The instruction at `pc` occupies cycles `start`..`last` behind `c`, its stall not counted."""
        self.pc, self.start, self.last = pc, start, last
        self._pending = _Pending()
        self._before = (len(self.lines), dict(self._w), dict(self._acc), dict(self._flags), self._sr)

    def abandon(self) -> None:
        """Take back what was written since `begin`."""
        count, self._w, self._acc, self._flags, self._sr = self._before
        del self.lines[count:]

    def commit(self) -> None:
        """Write the effects of the instruction, in the order of the plain interpreter: registers, then stores."""
        pending = self._pending
        for number, (value, word) in pending.w.items():
            self._commit_w(number, value, word)
        self._flags.update(pending.flags)
        if pending.bus_write or pending.side_effect:
            self.settle()
        for line in pending.effects:
            self.emit(line)
        if pending.bus_write:
            self.forget_values()
        self.modes_changed = self.modes_changed or pending.mode_write
        self.stall = pending.stall

    @property
    def writes_modes(self) -> bool:
        """Whether the instruction being written stores to a register that decides what instructions mean."""
        return self._pending.mode_write

    @property
    def ends_here(self) -> bool:
        """A device may have posted an event or asked for attention: the function must end behind this instruction."""
        return self._pending.bus_write or self._pending.side_effect

    def _commit_w(self, number: int, value: Number, word: bool) -> None:
        if number == STACK_POINTER:
            value = value & 0xFFFE
        known = value if isinstance(value, Expr) and value.atom else self.name(str(value), 0, 0xFFFF)
        self.emit(f"u16[{number}] = {known}")
        self._w[number] = known
        if word and not self.initialised >> number & 1:
            self.initialised |= 1 << number
            self.emit(f"u16[{self.places.at['cpu.initialised']}] |= {1 << number}")
            self.modes_changed = True

    # Pure operations

    def select(self, c: Number, a: Number, b: Number) -> Number:
        return choose(c, a, b)

    def div_trunc(self, a: Number, b: Number) -> Number:
        bound = max(abs(edge) for edge in interval(a))
        return Expr(f"div_trunc({a}, {b})", -bound, bound, atom=True)

    def rem_trunc(self, a: Number, b: Number) -> Number:
        bound = max(abs(edge) for edge in interval(a))
        return Expr(f"rem_trunc({a}, {b})", -bound, bound, atom=True)

    def clz16(self, v: Number) -> Number:
        return Expr(f"16 - {v}.bit_length()" if isinstance(v, Expr) else str(16 - v.bit_length()), 0, 16)

    def ctz16(self, v: Number) -> Number:
        return Expr(f"ctz16({v})", 0, 16, atom=True)

    def let(self, v: Number) -> Number:
        if not isinstance(v, Expr) or (v.atom and "(" not in v.text):
            return v
        return self.name(v.text, v.low, v.high)

    # Registers

    def w(self, n: int) -> Number:
        if n in self._pending.w:
            return self._pending.w[n][0]
        if n not in self._w:
            self._w[n] = self.name(f"u16[{n}]", 0, 0xFFFF)
        return self._w[n]

    def set_w(self, n: int, v: Number) -> None:
        self._pending.w[n] = (self._word(v), True)
        self._pending.stall |= 1 << n

    def set_wb(self, n: int, v: Number) -> None:
        _value, word = self._pending.w.get(n, (0, False))
        self._pending.w[n] = (self._word(self.w(n) & 0xFF00 | v & 0xFF), word)
        self._pending.stall |= 1 << n

    def ptr(self, n: int, side: Side) -> Number:
        if not self.initialised >> n & 1:
            raise Unsupported(f"W{n} may be uninitialised")
        return self.w(n)

    def set_ptr(self, n: int, v: Number, side: Side) -> None:
        value = self._word(v)
        self._pending.w[n] = (value & 0xFFFE if n == STACK_POINTER else value, True)
        if side == "dst":
            self._pending.stall |= 1 << n

    def _word(self, v: Number) -> Number:
        """The low 16 bits, under a name: they are read before any register changes."""
        v = v & 0xFFFF
        return self.let(v) if isinstance(v, Expr) else v

    def flag(self, name: str) -> Number:
        for flags in (self._pending.flags, self._flags):
            if name in flags:
                return flags[name]
        return Expr(f"{self._status()} >> {FLAGS[name]} & 1", 0, 1)

    def _status(self) -> str:
        """Name of SR as last settled."""
        if not self._sr:
            self._names += 1
            self._sr = f"s{self._names}"
            self.emit(f"{self._sr} = u16[{self.places.at['SR']}]")
        return self._sr

    def set_flags(self, **flags: Number) -> None:
        for name, value in flags.items():
            self._pending.flags[name] = value if isinstance(value, Expr) else int(bool(value))

    def reg(self, name: str) -> Number:
        return self.name(f"u16[{self.places.at[name]}]", 0, 0xFFFF)

    def set_reg(self, name: str, v: Number) -> None:
        self._pending.effects.append(f"u16[{self.places.at[name]}] = {self._word(v)}")

    def acc(self, i: int) -> Number:
        if i not in self._acc:
            low = self.places.at["ACCBL" if i else "ACCAL"]
            text = f"u16[{low}] | u16[{low + 1}] << 16 | ((u16[{low + 2}] & 255 ^ 128) - 128 << 32)"
            self._acc[i] = self.name(text, -(1 << 39), (1 << 39) - 1)
        return self._acc[i]

    def set_acc(self, i: int, v: Number) -> None:
        low = self.places.at["ACCBL" if i else "ACCAL"]
        value = self.let(v)
        self._acc[i] = value
        for word, mask in ((0, 0xFFFF), (1, 0xFFFF), (2, 0xFF)):
            self._pending.effects.append(f"u16[{low + word}] = {value} >> {16 * word} & {mask}")

    # Memory

    def load(self, ea: Number, size: Size, side: Side = "src", ptr: int | None = None) -> Number:
        if not isinstance(ea, Expr):
            return self._load_file(ea, size)
        ea = self.let(ea)
        self._test(ea, size, ptr)
        return self.name(f"u16[{ea} >> 1]", 0, 0xFFFF) if size == 2 else self.name(f"u8[{ea}]", 0, 0xFF)

    def store(self, ea: Number, v: Number, size: Size, ptr: int | None = None) -> None:
        value = v & (0xFFFF if size == 2 else 0xFF)
        value = self.let(value) if isinstance(value, Expr) else value
        if not isinstance(ea, Expr):
            self._store_file(ea, value, size)
            return
        ea = self.let(ea)
        self._test(ea, size, ptr)
        self._pending.effects.append(f"u16[{ea} >> 1] = {value}" if size == 2 else f"u8[{ea}] = {value}")

    def xload(self, ea: Number, ptr: int) -> Number:
        ea = self.let(ea)
        self._test(ea, 2, None)
        first, _end = self.places.y
        return self.name(f"u16[{ea} >> 1] if {ea} < {first} else 0", 0, 0xFFFF)

    def yload(self, ea: Number, ptr: int) -> Number:
        ea = self.let(ea)
        self._test(ea, 2, None)
        first, _end = self.places.y
        return self.name(f"u16[{ea} >> 1] if {ea} >= {first} else 0", 0, 0xFFFF)

    def _test(self, ea: Number, size: Size, ptr: int | None) -> None:
        """Leave unless `ea` is in RAM, aligned and, for the stack pointer, within the limit (isa.md §10)."""
        start, end = self.places.ram
        condition = f"not {start} <= {ea} < {end}" + (f" or {ea} & 1" if size == 2 else "")
        if ptr == STACK_POINTER and self._limit_armed:
            condition += f" or {ea} > u16[{self.places.at['SPLIM']}]"
        self.bail(condition)

    def _in_ram(self, ea: int, size: Size) -> bool:
        start, end = self.places.ram
        return start <= ea < end and not (size == 2 and ea & 1)

    def _load_file(self, ea: int, size: Size) -> Number:
        """A static address: RAM, a W register, or an SFR through the bus."""
        if self._in_ram(ea, size):
            return self.name(f"u16[{ea >> 1}]" if size == 2 else f"u8[{ea}]", 0, 0xFFFF if size == 2 else 0xFF)
        if ea >= self.places.ram[0] or (size == 2 and ea & 1):
            raise Unsupported("an address error or the window")
        word = self.w(ea >> 1) if ea < W_END else self._bus_read(ea & ~1)
        if size == 2:
            return word
        return self.let(word >> 8 if ea & 1 else word & 0xFF)

    def _bus_read(self, address: int) -> Expr:
        if address >> 1 in self.places.refused:
            raise Unsupported("the program counter")
        self.watches_events = True
        if not self.at_entry or self._flags:
            self.settle()
        self.emit(f"u64[{self.places.now}] = c + {self.last}")
        if address >> 1 in self.places.read_effects:
            if self._pending.side_effect:
                raise Unsupported("two reads with side effects")
            self._pending.side_effect = True
            self._show_place(self.emit)
        return self.name(f"read({address})", 0, 0xFFFF)

    def _show_place(self, write: Callable[[str], None]) -> None:
        """Let hooks see what the plain interpreter shows: the instruction's first cycle, PC behind it."""
        at = self.places.at
        write(f"u64[{at['cpu.cycle']}] = {'b' if self.at_entry else f'c + {self.start}'}")
        write(f"u32[{at['cpu.pc']}] = {self.pc + 2}")

    def _store_file(self, ea: int, value: Number, size: Size) -> None:
        if self._in_ram(ea, size):
            self._pending.effects.append(f"u16[{ea >> 1}] = {value}" if size == 2 else f"u8[{ea}] = {value}")
            return
        if ea < W_END or ea >= self.places.ram[0] or (size == 2 and ea & 1):
            raise Unsupported("a memory-mapped W register, an address error or the window")
        at = self.places.at
        if ea >> 1 == at["CORCON"]:
            raise Unsupported("EDT counts instructions")
        self.watches_events = True
        effects = self._pending.effects
        effects.append(f"u64[{self.places.now}] = c + {self.last}")
        self._show_place(effects.append)
        if size == 2:
            effects.append(f"write({ea}, {value})")
        else:
            lanes = 0xFF00 if ea & 1 else 0x00FF
            effects.append(f"write({ea & ~1}, {value} << 8, {lanes})" if ea & 1 else f"write({ea}, {value}, {lanes})")
        self._pending.bus_write = True
        if ea >> 1 in self.places.modes:
            self._pending.mode_write = True

    # Left to the sequencer

    def prog(self, address: Number) -> Number:
        raise Unsupported("table read")

    def table_write(self, address: Number, byte_mask: Number, v: Number) -> None:
        raise Unsupported("table write")

    def when(self, c: Number, fn: Callable[[], None]) -> None:
        raise Unsupported("conditional accesses")

    def trap_math(self, c: Number) -> None:
        if isinstance(c, Expr):
            self.bail(str(c))
        elif c:
            raise Unsupported("a math error")
