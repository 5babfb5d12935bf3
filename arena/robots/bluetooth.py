"""Bluetooth between robots: what one writes to UART1 its partners read there, a period later.

In: brains and the scene's links. Out: messages for the record. All robots have lived equally long when something is
carried, so neither their order nor the number of processes can show.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from arena.robots.controller import Brain
from arena.scene.loader import Scene


class Links:
    """The connections of a scene's robots; nothing where there are none."""

    def __init__(self, scene: Scene, brains: Sequence[Brain]) -> None:
        self._brains: Final = brains
        self._quantum: Final = scene.clock.quantum_tcy
        self._period: Final = max(round(scene.bluetooth.period_ms / scene.clock.quantum_ms), 1)
        self._partners: Final[dict[int, list[int]]] = {}
        for ends in scene.bluetooth.links:
            one, other = map(int, ends)
            self._partners.setdefault(one, []).append(other)
            self._partners.setdefault(other, []).append(one)
        for robot in self._partners:
            brains[robot].spoken()  # from now on it is kept
        self._carried: list[dict[str, Any]] = []

    def is_due(self, tick: int) -> bool:
        """Whether something may arrive after so many quanta."""
        return bool(self._partners) and tick % self._period == 0

    def carry(self, tick: int) -> None:
        """What was said since the last time arrives."""
        for robot, said in [(robot, self._brains[robot].spoken()) for robot in sorted(self._partners)]:
            for partner in sorted(self._partners[robot]) if said else ():
                self._brains[partner].tell(said)
                text = said.decode("ascii", "backslashreplace")
                self._carried.append({"robot": robot, "to": partner, "cycle": tick * self._quantum, "text": text})

    def messages(self) -> dict[str, list[dict[str, Any]]]:
        """The record's column of what has arrived since the last call: sender, receiver, Tcy of the trial, text."""
        if not self._partners:
            return {}
        carried, self._carried = self._carried, []
        return {"messages": carried}
