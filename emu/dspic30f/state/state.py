"""CPU state: the complete state of the CPU as named fields of the state record.

Registers with a data address (W0..W15, SR, CORCON, RCOUNT, ...) are stored at that address (isa.md §2.1), which the
chip's table gives. Hidden state, which instructions cannot address, is stored after the data space.
"""

from __future__ import annotations

from typing import Final

from emu.chips.chip import Chip
from emu.system.record import Record

# SR bits, isa.md §2.3
C, Z, OV, N, RA, IPL0, DC, DA = (1 << bit for bit in (0, 1, 2, 3, 4, 5, 8, 9))
SAB, OAB, SB, SA, OB, OA = (1 << bit for bit in range(10, 16))
IPL_MASK: Final = 7 * IPL0
FLAGS: Final = {"C": 0, "Z": 1, "OV": 2, "N": 3, "DC": 8, "SB": 12, "SA": 13, "OB": 14, "OA": 15}
"""Bit numbers of the flags that rows may read or write."""

# CORCON bits, isa.md §2.4
IF, RND, PSV, IPL3, ACCSAT, SATDW, SATB, SATA = (1 << bit for bit in range(8))
DL_SHIFT: Final = 8
DL_MASK: Final = 7 << DL_SHIFT
EDT, US = 1 << 11, 1 << 12

RUN, IDLE, SLEEP = range(3)
"""Values of `State.mode`."""

NOT_REPEATING, FIRST, MIDDLE, LAST = range(4)
"""Values of `State.repeat`: kind of a REPEAT target's next iteration, which determines PSV cycles (isa.md §13.3)."""

STACK_POINTER: Final = 15
W15_INITIALISED: Final = 1 << STACK_POINTER


class _Register:
    """Descriptor of a 16-bit register at a data address."""

    def __init__(self, name: str) -> None:
        self.name: Final = name

    def __get__(self, state: State, owner: type[State]) -> int:
        return state.u16[state.at[self.name]]

    def __set__(self, state: State, value: int) -> None:
        state.u16[state.at[self.name]] = value


class _Hidden:
    """Descriptor of a scalar reserved in the record."""

    def __init__(self, name: str, kind: str) -> None:
        self.name: Final = name
        self.kind: Final = kind

    def __get__(self, state: State, owner: type[State]) -> int:
        return state.views[self.kind][state.at[self.name]]

    def __set__(self, state: State, value: int) -> None:
        state.views[self.kind][state.at[self.name]] = value


class State:
    """The CPU's part of a record: attributes for registers and hidden state.

    `at` maps their names to record indices.
    """

    sr = _Register("SR")
    corcon = _Register("CORCON")
    rcount = _Register("RCOUNT")
    dcount = _Register("DCOUNT")
    splim = _Register("SPLIM")
    intcon1 = _Register("INTCON1")
    intcon2 = _Register("INTCON2")

    cycle = _Hidden("cpu.cycle", "Q")
    """Cycle in which the next instruction starts, in Tcy since power-on."""
    pc = _Hidden("cpu.pc", "I")
    mode = _Hidden("cpu.mode", "H")
    initialised = _Hidden("cpu.initialised", "H")
    """Bit n is set if Wn has had a word write since reset (isa.md §2.2)."""
    stall = _Hidden("cpu.stall", "H")
    """Bit n is set if the last instruction wrote Wn on its destination side (isa.md §13.2)."""
    limit_armed = _Hidden("cpu.limit_armed", "H")
    """1 if SPLIM has been written since reset (isa.md §10.2), else 0."""
    repeat = _Hidden("cpu.repeat", "H")
    edt = _Hidden("cpu.edt", "H")
    """0, or 1 + the number of instructions completed since CORCON.EDT was written, at most 3 (isa.md §7.6)."""
    disi_end = _Hidden("cpu.disi_end", "Q")
    """First cycle that DISI does not block; DISICNT is computed from it (isa.md §12)."""

    def __init__(self, record: Record, chip: Chip) -> None:
        self.record: Final = record
        self.u8: Final = record.u8
        self.u16: Final = record.u16
        self.views: Final = {"H": record.u16, "I": record.u32, "Q": record.u64}
        self.at: Final = {name: sfr.address >> 1 for name, sfr in chip.sfrs.items()}
        for name, kind, count in (
            ("cpu.cycle", "Q", 1),
            ("cpu.disi_end", "Q", 1),
            ("cpu.pc", "I", 1),
            ("cpu.mode", "H", 1),
            ("cpu.initialised", "H", 1),
            ("cpu.stall", "H", 1),
            ("cpu.limit_armed", "H", 1),
            ("cpu.repeat", "H", 1),
            ("cpu.edt", "H", 1),
            ("cpu.shadow", "H", 5),  # PUSH.S: W0, W1, W2, W3, SR (isa.md §2.6)
            ("cpu.do_shadow", "H", 5),  # DCOUNT, DOSTARTL, DOSTARTH, DOENDL, DOENDH
        ):
            self.at[name] = record.reserve(name, kind, count).index
        for number, name in enumerate(("W0S", "W1S", "W2S", "W3S", "SRS")):
            self.at[name] = self.at["cpu.shadow"] + number
        self._reset_stack: Final = chip.data["ram"].start
        self.check_pointers = True
        """Whether a reset leaves W0..W14 uninitialised; using one as a pointer then resets the device (isa.md §2.2)."""

    @property
    def ipl(self) -> int:
        """Return the CPU priority 0..15: CORCON.IPL3 and SR.IPL<2:0>."""
        return (self.corcon & IPL3) | (self.sr & IPL_MASK) >> 5

    @ipl.setter
    def ipl(self, level: int) -> None:
        self.corcon = self.corcon & ~IPL3 | level & IPL3
        self.sr = self.sr & ~IPL_MASK | (level & 7) << 5

    def pair(self, low: str) -> int:
        """Return a program address that is stored in register `low` and the register after it (DOSTART, DOEND)."""
        index = self.at[low]
        return self.u16[index] | self.u16[index + 1] << 16

    def set_w(self, number: int, value: int) -> None:
        """Write a W register as an instruction does. Bit 0 of W15 stays 0, and the register becomes initialised."""
        self.u16[number] = value & (0xFFFE if number == STACK_POINTER else 0xFFFF)
        self.initialised |= 1 << number

    def set_w_low(self, number: int, value: int) -> None:
        """Write the low byte of a W register, which does not initialise it (isa.md §2.2)."""
        self.u8[2 * number] = value & (0xFE if number == STACK_POINTER else 0xFF)

    def reset(self) -> None:
        """Reset the W registers and hidden state, after any cause of reset (isa.md §9)."""
        for number in range(STACK_POINTER):
            self.u16[number] = 0
        self.u16[STACK_POINTER] = self._reset_stack  # isa.md §2.1
        self.pc = 0
        self.mode = RUN
        self.initialised = W15_INITIALISED if self.check_pointers else 0xFFFF
        self.stall = 0
        self.limit_armed = 0
        self.repeat = NOT_REPEATING
        self.edt = 0
        self.disi_end = 0
