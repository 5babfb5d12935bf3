"""The two stepper motors (epuck.md §3): phases to steps, lost and illegal sequences, coil time.

Software writes the four phase bits one after the other, so intermediate patterns appear for a few cycles. A pattern
counts once it has been constant for `SETTLE` Tcy. No event is posted for that: the next pattern or read evaluates it.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from ctypes import POINTER, Structure, addressof, c_int64, c_void_p, pointer
from functools import cache
from pathlib import Path
from typing import Final

from emu.boards.part import BoardPart
from emu.native_library import ADDRESS, INT, address_of, functions
from emu.peripherals import Peripherals

PORT: Final = 3
"""Port of the motors: left motor on bits 3:0, right motor on bits 7:4 of port D (epuck.md §2)."""

_NOWHERE: Final = 4
"""Phase index before the first coil pattern."""
_STEPS, _LOST, _ILLEGALS, _INDEX, _NIBBLE, _SINCE, _SETTLED, _ON_TIME = range(8)
"""Indices of members in `motor.<side>.state`; twin of `struct state` in motors.c."""


class _History(Structure):
    _fields_ = [("before", c_int64), ("count", c_int64), ("cycle", c_int64 * 4096), ("steps", c_int64 * 4096)]


class _Motor(Structure):
    _fields_ = [("state", c_void_p), ("shift", c_int64), ("forward", c_int64), ("history", POINTER(_History))]


class _Pair(Structure):
    _fields_ = [("left", c_void_p), ("right", c_void_p), ("port", c_int64),
                *((name, c_void_p) for name in ("changes", "count", "reported")), ("watched", c_int64)]  # fmt: skip


@cache
def _code() -> dict[str, Callable[..., int]]:
    """Return the functions of motors.c, loaded at the first coil pattern: a run without motors starts faster."""
    return functions(Path(__file__).with_name("motors.c"), {
        "settle_by": (None, (ADDRESS, INT)),
        "change": (None, (ADDRESS, INT, INT)),
        "decode": (None, (ADDRESS, ADDRESS, INT, INT)),
        "steps_of_both": (INT, (ADDRESS, INT, ADDRESS, INT, ADDRESS)),
    })  # fmt: skip


class Stepper(BoardPart):
    """A stepper motor. `steps` counts full steps, forward positive.

    The state is an array of signed 64-bit numbers in the record. The decoder in motors.c reads and writes it.
    """

    def __init__(self, name: str, chip: Peripherals, shift: int, forward: int) -> None:
        super().__init__(name, chip)
        self._shift: Final = shift
        field = self.record.reserve(f"{name}.state", "q", 8)
        self._state: Final = self.record.s64[field.index : field.index + 8]
        self._state[_INDEX] = _NOWHERE
        self._state[_SETTLED] = 1
        self._on_step: Callable[[int, int], None] | None = None
        self._motor: Final = _Motor(self.record.address + field.offset, shift, forward)
        self._history: _History | None = None
        self.address: Final = addressof(self._motor)
        """Host address of `struct motor` of motors.c."""
        self.pins.watch_port(PORT, 0xF << shift, self._changed, lazy=True, reader=self._read)
        chip.on_synchronize.append(self._catch_up)

    @property
    def steps(self) -> int:
        """Steps made so far; negative = backward."""
        self._catch_up()
        return self._state[_STEPS]

    @property
    def lost(self) -> int:
        """Jumps by two phases, which the rotor does not follow."""
        self._catch_up()
        return self._state[_LOST]

    @property
    def illegal(self) -> int:
        """Coil patterns that are not a phase and were constant for 1 us or more."""
        self._catch_up()
        return self._state[_ILLEGALS]

    @property
    def coil_cycles(self) -> int:
        """Tcy during which at least one coil was on, a measure of energy use."""
        self._catch_up()
        state = self._state
        running = max(self.now - state[_SINCE], 0) if state[_NIBBLE] else 0
        return state[_ON_TIME] + running

    def counts(self) -> tuple[int, int, int, int]:
        """Return `steps`, `lost`, `illegal` and `coil_cycles`."""
        coil_cycles = self.coil_cycles
        state = self._state
        return state[_STEPS], state[_LOST], state[_ILLEGALS], coil_cycles

    def listen(self, on_step: Callable[[int, int], None]) -> None:
        """Call on_step(cycle, direction) for each step; `cycle` is the start of the step's coil pattern."""
        self._on_step = on_step
        # an eager watcher makes every edge call Python
        self.pins.watch_port(PORT, 0xF << self._shift, lambda *_edge: None)

    def record_history(self) -> None:
        """Start to record the cycle of each step, for `Motors.steps_by`."""
        self._catch_up()
        self._history = _History(self._state[_STEPS], 0)
        self._motor.history = pointer(self._history)

    @contextmanager
    def history_paused(self) -> Iterator[None]:
        """Suspend the step history inside the block; see `Motors.history_paused`."""
        kept, self._motor.history = self._history, None
        try:
            yield
        finally:
            self._motor.history = pointer(kept) if kept is not None else None

    def _catch_up(self) -> None:
        self.pins.flush()
        self.settled_steps(self.now)

    def settled_steps(self, now: int) -> int:
        """Return the steps settled by cycle `now`. The recorded pin changes must already be processed."""
        state = self._state
        if not state[_SETTLED]:
            self._run_and_notify("settle_by", now)
        return state[_STEPS]

    def _changed(self, cycle: int, _changed: int, levels: int) -> None:
        """Handle a new coil pattern, which ends the previous one."""
        self._run_and_notify("change", cycle, levels)

    @property
    def has_listener(self) -> bool:
        """Whether a listener is called for each step."""
        return self._on_step is not None

    def _run_and_notify(self, function: str, *arguments: int) -> None:
        """Call a function of the decoder, then call the listener if the function has counted a step."""
        state = self._state
        before, since = state[_STEPS], state[_SINCE]
        _code()[function](self.address, *arguments)
        if state[_STEPS] != before and self._on_step is not None and not self.events.quiet:
            self._on_step(since, state[_STEPS] - before)

    def _read(self, changes: int, count: int) -> None:
        """Decode the ring of pin changes, which is only used while no step listener exists."""
        _code()["decode"](self.address, changes, count, PORT)


class Motors:
    """Both motors. For forward motion the left phase index falls and the right one rises (epuck.md §3)."""

    def __init__(self, chip: Peripherals) -> None:
        self.left: Final = Stepper("motor.left", chip, 0, -1)
        self.right: Final = Stepper("motor.right", chip, 4, 1)
        self._pins: Final = chip.pins
        self._pair: Final = _Pair(self.left.address, self.right.address, PORT, *chip.pins.ring_addresses, 0)
        self._pair_address: Final = addressof(self._pair)

    def steps(self) -> tuple[int, int]:
        """Return the steps of both motors so far (left, right)."""
        left = self.left
        left.pins.flush()
        now = left.events.now
        return left.settled_steps(now), self.right.settled_steps(now)

    def record_history(self) -> None:
        """Start to record the cycles of both motors' steps."""
        self.left.record_history()
        self.right.record_history()

    @contextmanager
    def history_paused(self) -> Iterator[None]:
        """Suspend the step history inside the block, for a replay whose steps are already recorded."""
        with self.left.history_paused(), self.right.history_paused():
            yield

    @property
    def code(self) -> int:
        """Host address of the function `steps_of_both` of motors.c."""
        return address_of(_code()["steps_of_both"])

    def native_pair(self) -> int:
        """Return the host address of `struct pair` for native code; 0 while a step listener exists.

        The struct is up to date until a pin watcher is added or removed.
        """
        self._pair.watched = self._pins.watched_ports(2)
        return 0 if self.left.has_listener or self.right.has_listener else self._pair_address

    def steps_by(self, cycles: Sequence[int]) -> array[int]:
        """Return the steps of both motors at the given cycles, as left, right, left and so on.

        The cycles must increase from call to call. Needs `record_history`.
        """
        left, right, pins = self.left, self.right, self._pins
        if left.has_listener or right.has_listener:
            self.steps()
        count = len(cycles)
        at, steps = array("q", cycles), array("q", bytes(16 * count))
        self._pair.watched = pins.watched_ports(2)
        arguments = self._pair_address, left.events.now, at.buffer_info()[0], count, steps.buffer_info()[0]
        steps_of_both = _code()["steps_of_both"]
        if not steps_of_both(*arguments):
            pins.flush()
            steps_of_both(*arguments)
        return steps
