"""Words of the native environment: data of native code that are not machine state, each 64 bits wide.

Native code gets the environment as its second argument. It never enters the record or an object file.
"""

from __future__ import annotations

from typing import Final

from emu.system.native_handle import FRESH_ROOM

LIMIT: Final = 0
"""Cycle at which native code returns."""
BLOCKS: Final = 1
"""Address of the table of block code, by program word."""
STEPS: Final = 2
"""Address of the table of exact code, by program word."""
INTERRUPTS: Final = 3
"""Number of interrupts that native code has entered."""
AT_BOUNDARY: Final = 4
"""Whether the call begins with the boundary before PC."""
RESUME: Final = 5
"""Hooked address whose hook Python has just called, or NOWHERE."""
NOWHERE: Final = -1
ACCOUNTING: Final = 6
"""Address of the cells of cycle accounting."""
PERIOD: Final = 7
"""Cycles from one passed limit to the next (`Engine.pass_limits`)."""
LAST_LIMIT: Final = 8
"""Limit that is not passed; 0 if none is."""
PASSED_COUNT: Final = 9
"""Number of entries in PASSED."""
ARRIVED: Final = 10
"""Start cycle of the instruction before whose access all events have fired; while the exit reason is ARRIVE, the cycle
of that access."""
INDIRECT_SFR: Final = 11
"""Address of the function for indirect SFR access."""
PASSED: Final = 12
"""First of the boundaries, in Tcy, at or after the limits that were passed."""
PASSED_ROOM: Final = 1024
"""Capacity of PASSED."""
REFRESHED: Final = PASSED + PASSED_ROOM
"""First of the instructions for which a device was brought up to date (`NativeHandle.fresh`)."""
ENV_WORDS: Final = REFRESHED + FRESH_ROOM
