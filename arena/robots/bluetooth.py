"""Bluetooth links between robots: what a robot sends on UART1 reaches its partners one period later.

Input: the controllers and the links of the scene. Output: messages for the record. At a delivery all robots have
finished the same number of quanta. So the record depends neither on their order nor on the number of threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from arena.robots.controller import Controller
from arena.scene.loader import Scene


class BluetoothLinks:
    """The serial connections between the robots of a scene; inactive if the scene has none."""

    def __init__(self, scene: Scene, controllers: Sequence[Controller]) -> None:
        self._controllers: Final = controllers
        self._quantum: Final = scene.clock.quantum_tcy
        self._period: Final = max(round(scene.bluetooth.period_ms / scene.clock.quantum_ms), 1)
        self._partners: Final[dict[int, list[int]]] = {}
        for ends in scene.bluetooth.links:
            one, other = map(int, ends)
            self._partners.setdefault(one, []).append(other)
            self._partners.setdefault(other, []).append(one)
        for robot in self._partners:
            controllers[robot].take_uart()  # the first call begins the collection of bytes
        self._delivered: list[dict[str, Any]] = []

    def is_due(self, tick: int) -> bool:
        """Whether a delivery period ends after `tick` quanta."""
        return bool(self._partners) and tick % self._period == 0

    def deliver(self, tick: int) -> None:
        """Deliver to each partner what was sent since the last delivery."""
        for robot, sent in [(robot, self._controllers[robot].take_uart()) for robot in sorted(self._partners)]:
            for partner in sorted(self._partners[robot]) if sent else ():
                self._controllers[partner].feed_uart(sent)
                text = sent.decode("ascii", "backslashreplace")
                self._delivered.append({"robot": robot, "to": partner, "cycle": tick * self._quantum, "text": text})

    def take_messages(self) -> list[dict[str, Any]]:
        """Return the messages delivered since the last call, for the record: sender, receiver, trial cycle, text."""
        delivered, self._delivered = self._delivered, []
        return delivered
