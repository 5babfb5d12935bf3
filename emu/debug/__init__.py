"""Debugger: variables, call stacks, threads, expressions, fault diagnosis, strict mode and time travel.

The debugger attaches to a machine from outside, so a machine that is not debugged runs at full speed.
"""

from emu.debug.inspector import Inspector as Inspector
