"""What `emu.Machine` offers by the names of the program's source: variables, call stacks, threads, calls.

Reading debug information costs time and memory, so all of it is loaded when it is first asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from emu.debug.inspector import Frame, Inside, Value
    from emu.debug.threads import Thread
    from emu.machine.machine import Machine


class BySource:
    """Part of `emu.Machine`."""

    _inside: Inside | None = None

    @property
    def inside(self) -> Inside:
        """The loaded program with its names, types and call stacks. Raises ValueError if nothing is loaded."""
        from emu.debug.inspector import Inside

        machine = cast("Machine", self)
        if self._inside is None or self._inside.image is not machine.image:
            self._inside = Inside(machine)
        return self._inside

    def value(self, expression: str) -> Value:
        """The place an expression of C names, typed: `machine.value("robot.speed[1]").set(3)`.

        It may use locals of the function the machine stands in, statics and globals, registers and their fields,
        and C's operators. Raises ValueError for what names no place,
        `emu.debug.dwarf.location.Unavailable` for what was optimised out.
        """
        from emu.debug.expressions.expression import evaluate

        frames = self.inside.frames()
        found = evaluate(self.inside, expression, frames[0] if frames else None)
        if isinstance(found, (int, float)):
            raise ValueError(f"{expression!r} is the number {found} and names no place")
        return found

    def var(self, expression: str) -> Any:
        """The value of an expression of C as Python has it: int, float, bool, list of elements, dict of members.

        Raises as `value`, but plain numbers are fine: `machine.var("total / 2 + U1BRG")`.
        """
        from emu.debug.expressions.expression import evaluate, number_of

        frames = self.inside.frames()
        return number_of(evaluate(self.inside, expression, frames[0] if frames else None))

    def set_var(self, expression: str, value: float) -> None:
        """Set what an expression of C names. Raises as `value`, and ValueError for what does not fit."""
        self.value(expression).set(value)

    def backtrace(self) -> list[Frame]:
        """The call stack, innermost first, through interrupts and inlined functions."""
        return self.inside.frames()

    def threads(self) -> list[Thread]:
        """The threads of an OpenSwarm firmware with states, call stacks and stack use; empty for any other."""
        from emu.debug.threads import Threads

        return Threads(self.inside).all()

    def call(self, function: str, *arguments: Any, cycles: int = 1_000_000) -> Any:
        """The result of a function of the firmware: `machine.call("crc16", b"hello", 5)`.

        Numbers are converted to the parameters' types; bytes are put on the stack and passed as a pointer. Interrupts
        are held back meanwhile; what the function does to memory stays. Raises KeyError for an unknown function,
        ValueError for arguments it does not take, `emu.debug.function_call.CallError` if it is
        not back within `cycles`.
        A function that the optimiser has changed or inlined everywhere may not be there as it was written.
        """
        from emu.debug.function_call import call

        return call(cast("Machine", self), function, arguments, cycles)
