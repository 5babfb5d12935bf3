"""Exit reasons: numbers by which native code states why it returned to its caller."""

from __future__ import annotations

NEXT, INTERPRET, DEADLINE, BOUNDARY_WORK, MISS, RETFIE, HOOK, MODES, ARRIVE, UNFINISHED, CHANGED = range(11)
"""Reasons:

- NEXT: continue at PC.
- INTERPRET: interpret the instruction at PC.
- DEADLINE: the block at PC does not end before the deadline.
- BOUNDARY_WORK: events or interrupts must be handled before the instruction at PC.
- MISS: PC has no native code.
- RETFIE: two cycles of a RETFIE have run; the boundary decides whether it has a third.
- HOOK: PC is hooked.
- MODES: the processor modes have changed; PC belongs to another table of code.
- ARRIVE: events are due before the access of the instruction at PC.
- UNFINISHED: the boundary before PC has begun and must be finished regardless of the limit.
- CHANGED: the consumer of the change log must be called before the instruction at PC.
"""
