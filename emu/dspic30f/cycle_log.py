"""Layout of the words after the cells of cycle accounting, for its writers (cycle_accounting.py and jit/counters).

The module does not import numpy, because the translator uses this layout without arrays.
"""

from __future__ import annotations

from typing import Final

IDLE, LOG_COUNT, RETFIE_CELL, LOG = range(4)
"""Indices of the words after the cells: cycles in Idle and Sleep; number of log entries; address of the cell of the
RETFIE that native code ran last; first log entry."""
ENTRY_WORDS: Final = 4
"""Words of a log entry:

0. cycle
1. kind | level << 8 | W15 << 16 | instruction address << 32, where W15 points to the return address
2. target address | cycles of an interrupt's entry or of a sleep << 32
3. cycle of the interrupt request
"""
CALLED, RETURNED, ENTERED, SLEPT, RESET = range(1, 6)
"""Kinds of log entries."""
LONGEST_RUN: Final = 1 << 20
"""Maximum length in Tcy of a native run between two flushes of the log; each cycle adds at most one entry."""
