"""Time travel of a debugged Kilobot: single steps, searches for writes, and replays without output."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, cast

from emu.debug.history import History, StoredState, Write

if TYPE_CHECKING:
    from emu.debug.avr.machine import DebuggedKilobot
    from emu.machine.stops import Stop


class KilobotHistory(History):
    """Recorder of a `DebuggedKilobot`."""

    @property
    def _kilobot(self) -> DebuggedKilobot:
        return cast("DebuggedKilobot", self.machine)

    def _step_once(self, limit: int) -> Stop | None:
        return self._kilobot.step(limit)

    def _last_write(self, begin: StoredState, end: int, address: int, size: int, changes: bool) -> Write | None:
        """Return the last change before cycle `end`; a write of an equal value is not detected."""
        kilobot, found = self._kilobot, None
        with self._replaying(), kilobot.watching(address, size):
            kilobot.restore_state(self._unpacked(begin))
            old = kilobot.peek_bytes(address, size)
            while kilobot.cycle < end and kilobot.run_until(end) is not None:
                new = kilobot.peek_bytes(address, size)
                if new == old:
                    break
                found, old = Write(kilobot.last_cycle, kilobot.last_address, old, new), new
        return found

    @contextmanager
    def _replaying(self) -> Iterator[None]:
        before, self._kilobot.is_quiet = self._kilobot.is_quiet, True
        try:
            yield
        finally:
            self._kilobot.is_quiet = before
