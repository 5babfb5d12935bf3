"""Peripheral module disable (§17): a disabled module reads 0, ignores writes and loses its state."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.peripherals.base import ChipContext, Peripheral
from emu.system.bus import RegisterWiring

_PREFIXES: Final = {
    "ADC": ("ADCBUF", "ADCON", "ADCHS", "ADCSSL"),
    "PWM": ("PT", "SEVTCMP", "PWMCON", "DTCON", "FLT", "OVDCON", "PDC"),
    "QEI": ("QEICON", "DFLTCON", "POSCNT", "MAXCNT"),
    "DCI": ("DCI", "TSCON", "RSCON", "RXBUF", "TXBUF"),
}
"""Name prefixes of registers that do not begin with their module's name."""


def _zero() -> int:
    return 0


_OFF: Final = RegisterWiring(0, 0, _zero, None, None, None)


class ModuleDisable(Peripheral):
    """PMD1 and PMD2. Their bits determine which modules are off; after a restored snapshot `restored` applies them."""

    def __init__(self, context: ChipContext, modules: dict[str, Peripheral]) -> None:
        super().__init__("pmd", context)
        self._modules: Final = modules
        self._off: Final[dict[int, RegisterWiring]] = {}
        self._bits: Final[list[tuple[Callable[[], int], str]]] = []
        self._words: Final[dict[str, list[int]]] = {}
        """Indices of each module's registers."""
        for name in ("PMD1", "PMD2"):
            register = self.register(name)
            register.written_by(lambda _old, _new, _lanes: self._written())
            for field in register_fields(context, name):
                self._bits.append((lambda register=register, field=field: register[field], field[:-2]))  # type: ignore[misc]
                self._words[field[:-2]] = self._words_of(field[:-2])
        if "PMD3" in context.chip.sfrs:
            self.register("PMD3")

    def stops_in(self, mode: int) -> bool:
        """Return False: this device has no clock."""
        return False

    def _words_of(self, module: str) -> list[int]:
        timer = module[1:] if module[0] == "T" else None
        prefixes = _PREFIXES.get(module, (module,))
        return sorted(
            {
                sfr.address >> 1
                for name, sfr in self.context.chip.sfrs.items()
                if (name in (f"TMR{timer}", f"PR{timer}", f"T{timer}CON") if timer else name.startswith(prefixes))
            }
        )

    def _written(self) -> None:
        for is_off, module in self._bits:
            first = self._words[module][0]
            if is_off() and first not in self._off:
                self._clear(module)
        self.restored()

    def _clear(self, module: str) -> None:
        """Reset one module and its registers."""
        device = self._modules.get(module)
        if device is not None:
            device.before_disable()
        for word in self._words[module]:
            self.record.u16[word] = self.bus.reset_value[word]
        if device is not None:
            device.restart()

    def restored(self) -> None:
        """Connect or disconnect each module's registers according to its PMD bit."""
        for is_off, module in self._bits:
            off = bool(is_off())
            for word in self._words[module]:
                if off and word not in self._off:
                    self._disconnect(word)
                elif not off and word in self._off:
                    self._reconnect(word)

    def reset(self, power_on: bool) -> None:
        """Reset: enable all modules."""
        self.restored()

    def _disconnect(self, word: int) -> None:
        self._off[word] = self.bus.access(word)
        self.bus.rewire(word, _OFF)
        self.bus.off |= {word}

    def _reconnect(self, word: int) -> None:
        self.bus.off -= {word}
        self.bus.rewire(word, self._off.pop(word))


def register_fields(context: ChipContext, name: str) -> list[str]:
    """Return the field names of a register, least significant first."""
    fields = context.chip.sfrs[name].fields
    return sorted(fields, key=lambda field: fields[field][0])
