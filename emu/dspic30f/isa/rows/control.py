"""System instructions (isa.md §5.9, §11, §12)."""

from __future__ import annotations

from emu.dspic30f.isa.builder import Builder
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.flow import ClearWatchdog, Disi, Reset, Sleep
from emu.dspic30f.isa.row import Row


def nothing(m: Builder, x: Operands) -> None:
    """Execute NOP: no effect."""


def disable_interrupts(m: Builder, x: Operands) -> Disi:
    return Disi(x.k)


def power_save(m: Builder, x: Operands) -> Sleep:
    return Sleep("idle" if x.k else "sleep")


def clear_watchdog(m: Builder, x: Operands) -> ClearWatchdog:
    return ClearWatchdog()


def reset(m: Builder, x: Operands) -> Reset:
    return Reset()


# fmt: off
ROWS = (
    Row(215, "NOP",          "0000 0000 ---- ---- ---- ----", "", nothing),
    Row(216, "NOPR",         "1111 1111 ---- ---- ---- ----", "", nothing),
    Row(217, "DISI #lit14",  "1111 1100 00kk kkkk kkkk kkkk", "", disable_interrupts, repeat_ok=False),
    Row(218, "PWRSAV #lit1", "1111 1110 0100 0000 0000 000k", "", power_save, repeat_ok=False),
    Row(219, "CLRWDT",       "1111 1110 0110 0000 0000 0000", "", clear_watchdog),
    Row(220, "RESET",        "1111 1110 0000 0000 0000 0000", "", reset, repeat_ok=False),
)
# fmt: on
