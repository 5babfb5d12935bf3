"""Hooks on program addresses: by address, the functions to call and the filters that native code tests before."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.system.hook_filters import Filter

PcHook = Callable[[], bool | None]


class PcHooks:
    """Hooks by address. Each address has as many filters as hooks, None for a hook without one."""

    def __init__(self) -> None:
        self.by_address: Final[dict[int, list[PcHook]]] = {}
        self.filters: Final[dict[int, list[Filter | None]]] = {}

    def add(self, address: int, hook: PcHook, when: Filter | None, on_change: Callable[[], None]) -> Callable[[], None]:
        """Add a hook and return a function that removes it. `on_change` is called after addition and removal."""
        self.by_address.setdefault(address, []).append(hook)
        self.filters.setdefault(address, []).append(when)
        on_change()
        removed = False

        def remove() -> None:
            nonlocal removed
            if removed:
                return
            removed = True
            self.by_address[address].remove(hook)
            self.filters[address].remove(when)
            if not self.by_address[address]:
                del self.by_address[address], self.filters[address]
            on_change()

        return remove
