"""Bluetooth link of the e-puck between UART1 and a computer (epuck.md §6)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from emu.boards.part import BoardPart
from emu.peripherals import Peripherals
from emu.system.observers import Listeners

_ONES: Final = (1 << 64) - 1


class Bluetooth(BoardPart):
    """Bluetooth link that carries the bytes of UART1 to and from a computer.

    Bytes are lost while the link is down, or at random (seeded). The interface is that of a `Uart`: `on_byte`, `listen`
    and `feed`.
    """

    def __init__(self, chip: Peripherals, loss: float = 0.0, seed: int = 0) -> None:
        super().__init__("bluetooth", chip)
        self._uart: Final = chip.uart[1]
        self._uart.listen(self._from_robot, part=True, lazy=True)
        self._remove_listener: Callable[[], None] | None = None
        """Removes the eager UART listener, which exists only while the link has an eager listener."""
        self.loss = loss
        """Probability that a byte is lost, 0..1, the same in both directions."""
        self.dropouts: Final[list[tuple[int, int]]] = []
        """Half-open cycle ranges in which all bytes are lost."""
        self._listeners: Final[Listeners[[int, int]]] = Listeners(self.events, self._urgency_changed)
        self._down: Final = self.cell("down", "B")
        self._random: Final = self.cell("random", "Q", seed * 2 + 1 & _ONES)
        self._lost: Final = self.cell("lost")

    @property
    def connected(self) -> bool:
        """Whether the radio link is up; assign it to interrupt and restore the link."""
        return not self._down.value

    @connected.setter
    def connected(self, up: bool) -> None:
        self._uart.deliver_sent()
        self._down.value = not up

    @property
    def lost(self) -> int:
        """Number of bytes lost, in both directions."""
        return self._lost.value

    def listen(self, listener: Callable[[int, int], object], *, lazy: bool = False) -> Callable[[], None]:
        """Call listener(byte, start_cycle) for each byte that reaches the computer.

        Return a function that removes the listener. `lazy`: see `Uart.listen`.
        """
        return self._listeners.add(listener, lazy=lazy)

    def _urgency_changed(self, urgent: bool) -> None:
        if self._remove_listener is not None:
            self._remove_listener()
        self._remove_listener = self._uart.listen(lambda _byte, _start: None) if urgent else None

    @property
    def on_byte(self) -> Callable[[int, int], object] | None:
        """A single listener, replaced by assignment, in addition to those added by `listen`."""
        return self._listeners.assigned

    @on_byte.setter
    def on_byte(self, listener: Callable[[int, int], object] | None) -> None:
        self._listeners.assigned = listener

    def feed(self, data: bytes | Iterable[int], cycle: int | None = None, *, errors: int = 0) -> None:
        """Send bytes from the computer to the robot; see `Uart.feed` for `cycle` and `errors`."""
        at = self.now if cycle is None else cycle
        self._uart.deliver_sent()
        self._uart.feed([byte for byte in data if not self._drops(at)], cycle, errors=errors)

    def _drops(self, cycle: int) -> bool:
        in_window = any(start <= cycle < end for start, end in self.dropouts)
        dropped = not self.connected or in_window or (self.loss > 0 and self._draw() < self.loss)
        self._lost.value += dropped
        return dropped

    def _draw(self) -> float:
        """Return a uniform random number in 0..1, from a xorshift generator with its state in the record."""
        x = self._random.value
        x ^= x << 13 & _ONES
        x ^= x >> 7
        x ^= x << 17 & _ONES
        self._random.value = x
        return (x >> 11) / (1 << 53)

    def _from_robot(self, byte: int, start: int) -> None:
        if not self._drops(start):
            self._listeners(byte, start)
