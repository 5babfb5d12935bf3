"""A chip as data: registers, memory, vectors, configuration words, and the pins of each device.

The tables contain no behaviour. Devices, the CPU, the assembler, the linker and the header generator read the same
tables. To add a second chip, add a folder of tables, not a subclass.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Sfr:
    """One special function register: data address, size in bytes (1 or 2), and its bits."""

    name: str
    address: int
    size: int
    reset: int
    """Value after a power-on reset; bits the silicon leaves undefined are 0 here."""
    mask: int
    """Implemented bits; the others read 0."""
    fields: Mapping[str, tuple[int, int]]
    """Bit fields: name to (least significant bit, width)."""
    hw_owned: int
    """Bits owned by hardware: a write by software has no effect on them."""
    clear_only: int
    """Bits that software can clear but not set."""

    @property
    def writable(self) -> int:
        """Bits that software can both set and clear."""
        return self.mask & ~self.hw_owned & ~self.clear_only


@dataclass(frozen=True, slots=True)
class Region:
    """Half-open address range. Data space counts bytes; program space counts PC units (2 per 24-bit word)."""

    name: str
    start: int
    end: int

    def __contains__(self, address: object) -> bool:
        return isinstance(address, int) and self.start <= address < self.end

    @property
    def size(self) -> int:
        """Length in bytes (data space) or PC units (program space)."""
        return self.end - self.start


@dataclass(frozen=True, slots=True)
class Vector:
    """One of the 62 exception vectors. C handlers are called `_` + name, object symbols `__` + name."""

    slot: int
    name: str
    ivt: int
    """Program address of the vector word in the interrupt vector table."""
    aivt: int
    """Program address of the vector word in the alternate table."""
    level: int
    """Fixed priority of a trap (11..14); 0 for interrupts and reserved vectors."""
    implemented: bool
    """Whether this chip has the exception's source."""

    @property
    def irq(self) -> int | None:
        """Interrupt number (natural order), None for traps."""
        return self.slot - 8 if self.slot >= 8 else None

    @property
    def symbol(self) -> str:
        """Linker symbol of the handler."""
        return "__" + self.name

    @property
    def alternate_symbol(self) -> str:
        """Linker symbol of a handler that the alternate table prefers."""
        return "__Alt" + self.name


@dataclass(frozen=True, slots=True)
class ConfigWord:
    """A configuration register in program space: address in PC units, implemented bits, fields, erased value."""

    name: str
    address: int
    mask: int
    fields: Mapping[str, tuple[int, int]]
    erased: int = 0xFFFF

    def field(self, word: int, name: str) -> int:
        """Return the named field of a stored word, right-aligned. Raises KeyError for an unknown field."""
        lsb, width = self.fields[name]
        return word >> lsb & (1 << width) - 1


@dataclass(frozen=True, slots=True)
class ClockModes:
    """How FOSC and OSCCON select the clock."""

    pll: int
    """Code of FOS, NOSC and COSC for the primary oscillator whose mode, with or without PLL, is in FPR."""
    external: int
    """Code of the primary oscillator without PLL. May equal `pll`."""
    multipliers: Mapping[int, tuple[str, float]]
    """PLL modes by FPR: source ("crystal" or "frc") and multiplier of its frequency."""
    other: tuple[str, float]
    """Source and multiplier for every other FPR. A multiplier of 1 means that no PLL runs."""
    without_pll: frozenset[int]
    """Codes of FPR for the primary oscillator without PLL."""

    def is_valid(self, fos: int, fpr: int) -> bool:
        """Whether FOS and FPR select a documented clock. The internal oscillators ignore FPR."""
        modes = set(self.multipliers) if fos == self.pll else set()
        if fos == self.external:
            modes |= self.without_pll
        return fpr in modes or fos < min(self.pll, self.external)


@dataclass(frozen=True, slots=True)
class InterruptSource:
    """Register bits of one interrupt: flag, enable and priority."""

    irq: int
    name: str
    flag: tuple[str, int]
    enable: tuple[str, int]
    priority: tuple[str, int]


@dataclass(frozen=True, slots=True)
class TimerSite:
    """A timer. Type A can count asynchronously. Type B is the low half of a 32-bit pair, type C the high half."""

    number: int
    kind: str
    clock_pin: str
    """Clock input pin; empty if the timer has none."""
    irq: int
    partner: int
    """Number of the pair's other timer, 0 for type A."""


@dataclass(frozen=True, slots=True)
class UartSite:
    number: int
    tx_pin: str
    rx_pin: str
    rx_irq: int
    tx_irq: int
    autobaud_capture: int
    """Input capture module to which ABAUD connects the receive pin."""


@dataclass(frozen=True, slots=True)
class SpiSite:
    number: int
    sck_pin: str
    sdi_pin: str
    sdo_pin: str
    ss_pin: str
    irq: int


@dataclass(frozen=True, slots=True)
class I2cSite:
    sda_pin: str
    scl_pin: str
    slave_irq: int
    master_irq: int


@dataclass(frozen=True, slots=True)
class CaptureSite:
    number: int
    pin: str
    irq: int


@dataclass(frozen=True, slots=True)
class CompareSite:
    number: int
    pin: str
    fault_pin: str
    irq: int


@dataclass(frozen=True, slots=True)
class AdcSite:
    pins: tuple[str, ...]
    irq: int
    bits: int = 12
    """Resolution, 12 or 10. The 10-bit converter has four sample-and-hold amplifiers."""
    conversion: int = 14
    """Duration of a conversion in TAD."""


@dataclass(frozen=True, slots=True)
class DciSite:
    csdi_pin: str
    csdo_pin: str
    csck_pin: str
    cofs_pin: str
    irq: int


@dataclass(frozen=True, slots=True)
class CanSite:
    number: int
    rx_pin: str
    tx_pin: str
    irq: int


@dataclass(frozen=True, slots=True)
class PwmSite:
    """Motor control PWM: (low, high) pins of each output pair, fault pin A."""

    pairs: tuple[tuple[str, str], ...]
    fault_pin: str
    irq: int
    fault_irq: int


@dataclass(frozen=True, slots=True)
class QeiSite:
    """Quadrature encoder interface."""

    a_pin: str
    b_pin: str
    index_pin: str
    irq: int


@dataclass(frozen=True, slots=True, repr=False)
class Chip:
    """All data about one chip for the machine, the toolchain and the documentation."""

    name: str
    sfrs: Mapping[str, Sfr]
    vectors: tuple[Vector, ...]
    interrupts: Mapping[int, InterruptSource]
    config: Mapping[str, ConfigWord]
    data: Mapping[str, Region]
    program: Mapping[str, Region]
    device_id: int
    revision: int
    processors: tuple[int, ...]
    """Accepted processor ids of ELF files. The linker writes the first one (abi-elf.md §6.1)."""
    ports: tuple[str, ...]
    change_pins: tuple[str, ...]
    """Pins of CN0, CN1, ...; an empty name where the chip lacks the input."""
    external_pins: tuple[tuple[str, int], ...]
    """(pin, interrupt number) of INT0, INT1, ..."""
    timers: tuple[TimerSite, ...]
    uarts: tuple[UartSite, ...]
    spis: tuple[SpiSite, ...]
    i2c: I2cSite | None
    captures: tuple[CaptureSite, ...]
    compares: tuple[CompareSite, ...]
    adc: AdcSite
    dci: DciSite | None
    cans: tuple[CanSite, ...]
    clock: ClockModes
    nvm_irq: int
    lvd_irq: int | None
    """Interrupt number of low-voltage detect; None if the chip lacks it."""
    pwm: PwmSite | None = None
    qei: QeiSite | None = None

    def __post_init__(self) -> None:
        sfr, ram, x, y = (self.data[name] for name in ("sfr", "ram", "xram", "yram"))
        if (sfr.start, sfr.end, ram.start, x.end, ram.end) != (0, ram.start, x.start, y.start, y.end):
            raise ValueError(f"{self.name}: SFRs, X RAM and Y RAM do not follow each other from address 0")

    def __repr__(self) -> str:
        return f"<{self.name}>"


def _fields(text: str) -> Mapping[str, tuple[int, int]]:
    """Parse bit fields written as `NAME:lsb:width;...`."""
    parts = (item.split(":") for item in text.split(";") if item)
    return MappingProxyType({name: (int(lsb), int(width)) for name, lsb, width in parts})


def load_sfrs(path: Path) -> Mapping[str, Sfr]:
    """Read a chip's register file: columns name, address, size, reset, mask, fields, hw_owned, clear_only."""
    with path.open(encoding="ascii", newline="") as file:
        return MappingProxyType(
            {
                row["name"]: Sfr(
                    name=row["name"],
                    address=int(row["address"], 16),
                    size=int(row["size"]),
                    reset=int(row["reset"], 16),
                    mask=int(row["mask"], 16),
                    fields=_fields(row["fields"]),
                    hw_owned=int(row["hw_owned"], 16),
                    clear_only=int(row["clear_only"], 16),
                )
                for row in csv.DictReader(file)
            }
        )
