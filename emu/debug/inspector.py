"""Source-level view of a paused machine: call stack, variables in scope, and values by name.

Input: a machine between two instructions. Outputs: `Frame`s and `Value`s. Only `Value.set` changes the machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Final

from emu.debug.dspic30f import Dspic30f
from emu.debug.dwarf import location
from emu.debug.dwarf.types import UNSIGNED, Type
from emu.debug.dwarf.units import DebugInfo, Scope, Variable
from emu.debug.frame import Frame, FrameView
from emu.debug.processor import Debugged, Processor
from emu.debug.unwind import RawFrame
from emu.debug.value import Value
from emu.image.lines import SourceLine
from emu.image.model import Image

if TYPE_CHECKING:
    from emu.machine.machine import Machine

FRAME_OPERATIONS: Final = (location.FBREG, location.BREG0 + 28)
"""DWARF operations with which the location of a frame variable begins: the frame base, or avr-gcc's frame pointer Y."""
REMOVED_BY_LINKER: Final = bytes(location.ADDR_0)
"""Location expression that the linker writes for a removed variable."""


class Inspector:
    """Inspector of `machine` that uses its image's debug information. Raises ValueError if no image is loaded."""

    def __init__(self, machine: Machine) -> None:
        if machine.image is None:
            raise ValueError("nothing is loaded")
        self.machine: Final = machine
        self.image: Final[Image] = machine.image
        self.processor: Final[Processor] = machine.processor() if isinstance(machine, Debugged) else Dspic30f(machine)
        """Properties of the machine's processor and compiler."""
        self._bodies: Final[dict[int, int]] = {}

    @cached_property
    def debug(self) -> DebugInfo:
        """Functions, variables and types."""
        return self.processor.debug

    def is_code(self, pc: int) -> bool:
        """Whether the image contains an instruction at `pc`."""
        return self.processor.is_code(pc)

    def function_start(self, pc: int) -> int | None:
        """Return the address of the function that contains `pc`, None outside the program."""
        if not self.is_code(pc):
            return None
        function = self.debug.function(pc)
        if function is not None:
            return next(start for start, end in function.ranges if start <= pc < end)
        symbol = self.image.symbols.code(pc)
        return symbol[0].address if symbol is not None else None

    def prologue_end(self, start: int) -> int:
        """Return the end of the prologue of the function at `start`. The prologue stores the parameters.

        In the line table, the prologue has its own row for the function's opening line. A function without frame
        variables has no prologue; the result is then `start`.
        """
        if start not in self._bodies:
            self._bodies[start] = self._find_prologue_end(start)
        return self._bodies[start]

    def _find_prologue_end(self, start: int) -> int:
        function, first = self.debug.function(start), self.image.lines.find(start)
        if function is None or first is None or first.start != start or not has_frame_variables(function):
            return start
        return first.end if (start, first.end) not in function.ranges else start

    def is_handler(self, start: int | None) -> bool:
        """Whether `start` is the address of an exception handler."""
        return start is not None and start in self.processor.handlers

    def function_name(self, pc: int) -> str:
        """Return the C name of the function that contains `pc`."""
        function = self.debug.function(pc)
        if function is not None and function.name:
            return function.name
        symbol = self.image.symbols.code(pc) if self.is_code(pc) else None
        return symbol[0].name.removeprefix(self.processor.symbol_prefix) if symbol is not None else f"{pc:#08x}"

    def where(self, pc: int) -> str:
        """Return `pc` as text with function and source line: `0x000124 (worker+0x4, main.c:12)`."""
        start = self.function_start(pc)
        if start is None:
            return f"{pc:#08x}"
        distance = f"+{pc - start:#x}" if pc != start else ""
        line = self.image.lines.find(pc)
        return f"{pc:#08x} ({self.function_name(pc)}{distance}{f', {line}' if line is not None else ''})"

    # Call stacks

    def registers(self) -> tuple[int | None, ...]:
        """Return the current values of the registers, by DWARF number."""
        return tuple(self.machine.w[number] for number in range(len(self.processor.register_names)))

    def frames(self, pc: int | None = None, registers: tuple[int | None, ...] | None = None) -> list[Frame]:
        """Return the call stack for a PC and register values, by default those of the machine."""
        if pc is None:
            pc = self.machine.pc
        raws = self.processor.frames(pc, registers or self.registers(), self.function_start)
        found: list[Frame] = []
        for number, raw in enumerate(raws):
            exact = number == 0 or raws[number - 1].is_handler
            found += self._entries(raw, raw.pc if exact else raw.pc - 2)
        return found

    def _entries(self, raw: RawFrame, at: int) -> Iterator[Frame]:
        """Yield the entries of one physical frame: the functions inlined at `at`, then the function itself."""
        line = self.image.lines.find(at)
        function = self.debug.function(at)
        kind = "interrupt" if raw.is_handler else "call"
        if function is None:
            yield Frame(raw.pc, self.function_name(at), line, kind, (), raw, at)
            return
        scopes = function.chain(at)
        while True:
            first = max((n for n, scope in enumerate(scopes) if scope.kind != "block"), default=0)
            own = scopes[first]
            inlined = own.kind == "inlined"
            name = own.name or self.function_name(at)
            yield Frame(raw.pc, name, line, "inlined" if inlined else kind, tuple(scopes[first:]), raw, at)
            if not inlined:
                return
            line = SourceLine(at, at + 2, own.call_file, own.call_line) if own.call_line else line
            scopes = scopes[:first]

    # Variables

    def view(self, frame: Frame | None = None) -> FrameView:
        """Return the registers and memory as visible from `frame`; None means the machine's current registers."""
        return FrameView(self.machine, self.processor, frame)

    def variables(self, frame: Frame) -> list[Variable]:
        """Return the parameters and locals in scope, in order of declaration.

        An inner variable hides an outer one of the same name.
        """
        found: dict[str, Variable] = {}
        for scope in frame.scopes:
            for one in scope.variables:
                found.pop(one.name, None)
                found[one.name] = one
        return list(found.values())

    def variable(self, name: str, frame: Frame | None = None) -> Variable | None:
        """Return the variable called `name` that is visible in `frame`, None if there is none.

        It is a local, a static of the frame's file, or a global.
        """
        if frame is not None:
            for scope in reversed(frame.scopes):
                for one in scope.variables:
                    if one.name == name:
                        return one
            if frame.scopes:
                mine = self.debug.statics.get(frame.scopes[0].unit, {}).get(name)
                if mine is not None:
                    return mine
        same_name = self.debug.globals.get(name)
        return same_name[0] if same_name else None

    def value(self, variable: Variable, frame: Frame | None = None) -> Value:
        """Return the object denoted by `variable`. Raises Unavailable, for example if it was optimised out."""
        view = self.view(frame)
        if variable.location is None:
            if variable.constant is None:
                raise location.Unavailable("optimised out")
            data = variable.constant
            if isinstance(data, int):
                data = (data & (1 << 64) - 1).to_bytes(8, "little")
            return Value(variable.type, (location.Piece("value", 0, data=data),), view, variable.name)
        code = variable.location.at(view.pc)
        if code is None:
            raise location.Unavailable("optimised out")
        if code == REMOVED_BY_LINKER:
            raise location.Unavailable("not in the program: nothing uses it")
        if why := self.processor.unreadable(code):
            raise location.Unavailable(why)
        if (
            is_frame_variable(variable)
            and (start := self.function_start(view.pc)) is not None
            and view.pc < self.prologue_end(start)
        ):
            raise location.Unavailable("not set yet: the function is being entered")
        pieces = location.pieces_of(code, view, lambda: self._frame_base(frame))
        return Value(variable.type, pieces, view, variable.name)

    def _frame_base(self, frame: Frame | None) -> int:
        if frame is None or not frame.scopes:
            raise location.Unavailable("its frame is not known")
        entry = frame.raw.entry
        if entry is not None and frame.kind != "inlined" and self.processor.entry_is_frame_base:
            return entry
        view = self.view(frame)
        function = self.debug.function(view.pc)
        code = function.frame_base.at(view.pc) if function and function.frame_base else None
        if code is None:
            raise location.Unavailable("its frame is not known")
        pieces = location.pieces_of(code, view, lambda: entry or 0)
        is_register = len(pieces) == 1 and pieces[0].kind == "register"
        found = view.address_in(pieces[0].at) if is_register else location.address_of(pieces)
        if found is None:
            raise location.Unavailable("its frame is not known")
        return found

    def symbol(self, name: str) -> Value | None:
        """Return a variable that is only in the symbol table, as an unsigned number of its size; None if unknown."""
        found = self.image.symbols.find(name)
        if found is None or found.space not in ("data", "psv", "absolute"):
            return None
        kind = UNSIGNED.get(found.size)
        if kind is None:
            kind = Type("array", target=UNSIGNED[1], count=found.size) if found.size else UNSIGNED[2]
        return Value(kind, (location.Piece("memory", found.address),), self.view(), name)


def is_frame_variable(variable: Variable) -> bool:
    """Whether the variable has a fixed location in its function's frame."""
    entries = variable.location.entries if variable.location is not None else ()
    return len(entries) == 1 and entries[0][0] is None and bool(entries[0][2]) and entries[0][2][0] in FRAME_OPERATIONS


def has_frame_variables(scope: Scope) -> bool:
    """Whether a function has a variable with a fixed location in its frame."""
    return any(map(is_frame_variable, scope.variables)) or any(map(has_frame_variables, scope.inner))
