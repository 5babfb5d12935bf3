"""Layout of the native environment: 64-bit words that native code uses and that are not machine state.

Native code receives the environment as its second argument. It is never part of the record or of an object file.
"""

from __future__ import annotations

from typing import Final

from emu.system.native_handle import FRESH_ROOM

LIMIT: Final = 0
"""Cycle at which native code returns."""
BLOCKS: Final = 1
"""Address of the block code table, indexed by program word."""
STEPS: Final = 2
"""Address of the exact code table, indexed by program word."""
INTERRUPTS: Final = 3
"""Number of interrupts that native code has entered."""
AT_BOUNDARY: Final = 4
"""Whether the call begins with the boundary before the instruction at PC."""
RESUME: Final = 5
"""Hooked address whose hook Python has just called, or NOWHERE."""
NOWHERE: Final = -1
ACCOUNTING: Final = 6
"""Address of the cells of cycle accounting."""
PERIOD: Final = 7
"""Cycles between two passed limits (`Engine.pass_limits`)."""
LAST_LIMIT: Final = 8
"""Limit at which native code returns; 0 if limits are not passed."""
PASSED_COUNT: Final = 9
"""Number of entries in the list PASSED."""
ARRIVED: Final = 10
"""Start cycle of the instruction before whose access all events have fired. While the exit reason is ARRIVE, the cycle
of that access."""
INDIRECT_SFR: Final = 11
"""Address of the helper function for indirect SFR access."""
ARRIVALS: Final = 12
"""Address of the log of arrivals (emu/system/arrivals.py); 0 while nothing is recorded."""
SEEN: Final = 13
"""Start cycle of an instruction whose hooks Python called before an earlier run ended; NEVER if there is none."""
PASSED: Final = 14
"""First entry of a list: the boundaries (Tcy) at or after each passed limit."""
PASSED_ROOM: Final = 1024
"""Capacity of the list PASSED."""
REFRESHED: Final = PASSED + PASSED_ROOM
"""First entry of a list: instructions that read a register which a device refreshes (`Native.fresh`)."""
ENV_WORDS: Final = REFRESHED + FRESH_ROOM
