"""The Python interface: load an image, run it, and inspect it by the names of its source.

    >>> import emu
    >>> machine = emu.load("tests/emu/cli/hello.hex")
    >>> output = bytearray()
    >>> machine.uart[1].on_byte = lambda byte, cycle: output.append(byte)
    >>> stop = machine.run(cycles=14_745_600)       # one second of an e-puck
    >>> stop.reason, bytes(output)
    ('halt', b'hi!\\n')
    >>> machine.w[0], hex(machine.pc), machine.peek("U1BRG")
    (5, '0x11e', 7)

A snapshot is a copy of the whole state. It is valid in every engine:

    >>> other = emu.load("tests/emu/cli/hello.hex", engine="plain")
    >>> other.run(until=0x104).reason               # also: a name, or a function that returns a condition
    'until'
    >>> state = other.snapshot()
    >>> _ = other.run()
    >>> other.restore(state)
    >>> other.run().cycle == stop.cycle
    True
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from emu.boards import board_named
from emu.chips import chip_named
from emu.chips.chip import Chip, Vector
from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.image.loader import load_image
from emu.machine.machine import Machine as BareMachine
from emu.machine.state_access import MemoryObserver, NameOrAddress
from emu.machine.stops import Stop
from emu.peripherals import Peripherals
from emu.system.events import NEVER

if TYPE_CHECKING:
    from emu.debug.frame import Frame
    from emu.debug.inspector import Inspector
    from emu.debug.threads import Thread
    from emu.debug.value import Value
    from emu.dspic30f.change_log import Entries


class Machine(BareMachine):
    """A machine with a debugger attached: access by source names, and stops that explain firmware faults.

        >>> import emu
        >>> machine = emu.load("tests/emu/cli/hello.hex")
        >>> machine.run().reason, machine.var("U1BRG * 2"), machine.threads()
        ('halt', 14, [])

    With `strict`, null pointers, uninitialised reads and stores into other threads' stacks are faults
    (emu/debug/strict.py); this needs the plain engine. The other arguments are those of `emu.machine.machine.Machine`.
    Raises ValueError for an unknown engine, or for another engine than plain with `strict`.

    Debug information is loaded when it is first needed, because reading it costs time and memory.
    """

    def __init__(
        self,
        chip: Chip = DSPIC30F6014A,
        *,
        engine: str = "auto",
        ipl_slip: int = 0,
        board: Callable[[Peripherals], Any] | None = None,
        strict: bool = False,
    ) -> None:
        observer: Callable[[BareMachine], MemoryObserver] | None = None
        if strict:
            from emu.debug.strict import StrictMode

            if engine not in ("auto", "plain"):
                raise ValueError(f"a strict run needs the plain engine, not {engine!r}")
            engine, observer = "plain", StrictMode
        super().__init__(chip, engine=engine, ipl_slip=ipl_slip, board=board, observer=observer)
        self._inspector: Inspector | None = None
        self.diagnose = self._explain
        self._stops_at_overflow = False
        self._overflowed = False
        """Whether a thread of OpenSwarm hit its stack limit in the current `advance`."""

    def _explain(self, stop: Stop) -> Stop:
        from emu.debug.fault_report import explain  # imported only here, because most runs end without a fault

        return explain(self, stop)

    def advance(self, cycle: int) -> Stop | None:
        """Run as in the base class. The stack overflow of an OpenSwarm thread is a fault too.

        The kernel ends only that thread and continues. `stop_on_fault` False lets it do so.
        """
        self._overflowed, self._stops_at_overflow = False, self.stop_on_fault
        try:
            stop = super().advance(cycle)
        finally:
            self._stops_at_overflow = False
        if not self._overflowed or stop is None or stop.reason != "interrupted":
            return stop
        from emu.debug.fault_report import thread_overflow

        return thread_overflow(self, stop)

    def run(
        self,
        cycles: int | None = None,
        until: Callable[[], bool] | NameOrAddress | None = None,
        *,
        seconds: float | Fraction | None = None,
        when: str | None = None,
    ) -> Stop:
        """Run as in the base class. Conditions in C run natively: `run(until="mark", when="count > 40")`.

        With `when`, the run ends at the place `until` only while the condition holds. Without a place, `until` may be
        a condition itself, `run(until="count > 40")`: the run ends after the first instruction after which it holds.
        Comparisons of variables with numbers, joined by `&&`, cost little. Every other condition is slow, as is one
        about registers without a place. Raises ValueError also for an invalid condition, or one without a place.
        """
        if when is None and not (isinstance(until, str) and self._is_condition(until)):
            return super().run(cycles, until, seconds=seconds)
        from emu.instruments.conditions import run_to_place, run_until

        limit = self._limit_of(cycles, seconds)
        if when is None:
            return run_until(self, self.inspector, str(until), limit)
        if until is None or callable(until):
            raise ValueError("`when` needs a place: until=NAME or until=ADDRESS")
        return run_to_place(self, self.inspector, self.program_address(until), when, limit)

    def _is_condition(self, text: str) -> bool:
        """Whether `text` is a C expression, which is neither a single name nor a symbol of the image."""
        known = self.image is not None and self.image.symbols.find(text) is not None
        return not known and re.fullmatch(r"[\w.$@]*", text) is None

    def _on_trap(self, vector: Vector) -> None:
        super()._on_trap(vector)
        if self._stops_at_overflow and vector.name == "StackError" and not self.events.quiet:
            from emu.debug.fault_report import is_thread_overflow

            if is_thread_overflow(self):
                self._overflowed = True
                self.interrupt()

    @property
    def inspector(self) -> Inspector:
        """The loaded program with its names, types and call stacks. Raises ValueError if no image is loaded."""
        from emu.debug.inspector import Inspector

        if self._inspector is None or self._inspector.image is not self.image:
            self._inspector = Inspector(self)
        return self._inspector

    def program_address(self, place: str | int) -> int:
        """Return the program address of a function or label by name. An address is checked and returned.

        Raises KeyError for an unknown name, and for a function that was inlined everywhere: the text says where.
        Raises ValueError for an address at which no instruction can start.
        """
        try:
            return super().program_address(place)
        except KeyError as error:
            from emu.debug.inlining import address_of, missing_function

            if self.image is None or not isinstance(place, str):
                raise
            debug = self.inspector.debug
            address = address_of(debug, place)
            if address is not None:
                return address
            reason = missing_function(debug, place)
            raise KeyError(f"{error.args[0]}: {reason}" if reason else error.args[0]) from None

    def value(self, expression: str) -> Value:
        """Return the typed object that a C expression denotes: `machine.value("robot.speed[1]").set(3)`.

        The expression may use locals of the current function, statics and globals, registers and their fields, and the
        operators of C. Raises ValueError for an expression that denotes no object,
        `emu.debug.dwarf.location.Unavailable` for a value that was optimised out.
        """
        from emu.debug import symbolic

        return symbolic.variable(self.inspector, expression)

    def var(self, expression: str) -> Any:
        """Return the value of a C expression as a Python object: int, float, bool, list of elements, dict of members.

        Raises as `value`, but permits plain numbers: `machine.var("total / 2 + U1BRG")`.
        """
        from emu.debug import symbolic

        return symbolic.read(self.inspector, expression)

    def set_var(self, expression: str, value: float) -> None:
        """Assign to the object that a C expression denotes.

        Raises as `value`, and ValueError if `value` does not fit.
        """
        self.value(expression).set(value)

    def backtrace(self) -> list[Frame]:
        """Return the call stack, innermost first, through interrupts and inlined functions."""
        return self.inspector.frames()

    def threads(self) -> list[Thread]:
        """Return the threads of an OpenSwarm firmware with states, call stacks and stack use; empty for any other."""
        from emu.debug.threads import Threads

        return Threads(self.inspector).all()

    def call(self, function: str, *arguments: Any, cycles: int = 1_000_000) -> Any:
        """Call a function of the firmware and return its result: `machine.call("crc16", b"hello", 5)`.

        Numbers are converted to the parameters' types. Bytes are copied to the stack and passed as a pointer.
        Interrupts are masked during the call. The function's effects on memory persist. The optimiser may have
        changed a function, or inlined and removed it.

        Raises KeyError for an unknown function, ValueError for unsuitable arguments,
        `emu.debug.function_call.CallError` if the function does not return within `cycles`.
        """
        from emu.debug.function_call import call

        return call(self, function, arguments, cycles)


def load(
    path: str | os.PathLike[str],
    *,
    engine: str = "auto",
    ipl_slip: int = 0,
    board: Callable[[Peripherals], Any] | str | None = "epuck",
    strict: bool = False,
    chip: str | None = None,
) -> Machine:
    """Return a machine with the firmware file at `path` (ELF or Intel HEX), ready to run from reset.

    `board` is the circuit around the chip: "epuck" as on the command line, "none" or None for bare pins, or a callable
    that takes the chip's peripherals, for example `functools.partial(emu.boards.epuck.board.Epuck, selector=3)`.
    `engine` is "auto", "jit" or "plain"; all give the same run. With `strict`, null pointers, uninitialised
    reads and stores into other threads' stacks are faults; this needs the plain engine.
    `chip` is the device of a HEX file, one of `emu.chips.NAMES`. An ELF file names its device itself.
    Raises `emu.LoadError` if the file is no usable image, ValueError for an unknown engine, board or chip.
    """
    image = load_image(path, None if chip is None else chip_named(chip))
    maker = board_named(board) if isinstance(board, str) else board
    machine = Machine(image.chip, engine=engine, ipl_slip=ipl_slip, board=maker, strict=strict)
    machine.load(image)
    return machine


def build(
    *sources: str | os.PathLike[str], flags: Sequence[str] = ("-Os", "-g"), output: str | os.PathLike[str]
) -> Path:
    """Compile and link C files to the ELF file `output` with the project's own compiler, and return its path.

    The target is the e-puck's chip unless `flags` name another. Raises BuildError with the compiler's messages.
    """
    files = [*(os.fspath(source) for source in sources), "-o", os.fspath(output)]
    words = [sys.executable, "-m", "toolchain", "cc", *flags, *files]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BuildError(done.stderr.strip() or f"the compiler ended with status {done.returncode}")
    return Path(output)


class BuildError(RuntimeError):
    """A program cannot be compiled or linked. The text consists of the compiler's messages."""


class Change(NamedTuple):
    """Change of a watched value.

        >>> import emu
        >>> first = next(emu.watch(emu.load("tests/emu/cli/hello.hex"), "U1BRG"))
        >>> first.old, first.new
        (0, 7)

    The instruction that ended before `cycle` (Tcy) made the change; `pc` is the next instruction.
    """

    cycle: int
    pc: int
    old: int
    new: int


WATCH_CYCLES = 1_000_000
"""Maximum length in Tcy of a run between two deliveries of the changes that were logged without a pause."""


def watch(
    machine: BareMachine, place: str | int, *, size: int = 2, cycles: int | None = None, pause: bool = True
) -> Iterator[Change]:
    """Run `machine` and yield every change of a variable, register or data address (`size` 1 or 2 bytes).

    The machine is paused at each change that the iterator yields. Without `pause` it runs ahead, by at most
    WATCH_CYCLES Tcy, which is much faster if the value changes often. Native code observes RAM; for a register, the
    machine makes single steps and is always paused. The iterator ends with the run, after at most `cycles` Tcy.
    Raises KeyError for an unknown name.
    """
    from emu.dspic30f.change_log import WatchedNumber
    from emu.instruments.changes import is_in_ram, log_changes

    address = machine.address_of(place)
    changes: list[Change] = []
    value, is_running = machine.peek(address, size), False

    def changed() -> bool:
        nonlocal value
        old, value = value, machine.peek(address, size)
        if value != old:
            changes.append(Change(machine.cycle, machine.pc, old, value))
        return bool(changes)

    def log(found: Entries) -> None:
        nonlocal value
        values = found["value"].tolist()
        changes.extend(map(Change, found["cycle"].tolist(), found["pc"].tolist(), [value, *values], values))
        value = values[-1]
        if is_running and pause:
            machine.interrupt()

    end = NEVER if cycles is None else machine.cycle + cycles
    is_logged = is_in_ram(machine, address, size)
    leaves = () if pause else None
    end_log = log_changes(machine, [WatchedNumber(address, size)], log, leaves) if is_logged else None
    try:
        while machine.cycle < end:
            limit = end if pause else min(end, machine.cycle + WATCH_CYCLES)
            is_running = True
            stop = machine.advance(limit) if is_logged else machine.step_until(changed, end)
            is_running = False
            is_paused = bool(changes) if pause or not is_logged else stop is None
            yield from changes
            changes.clear()
            if not is_paused or (stop is not None and stop.reason not in ("until", "interrupted")):
                return
    finally:
        if end_log is not None:
            end_log()
