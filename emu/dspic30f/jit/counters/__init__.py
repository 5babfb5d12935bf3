"""Counters and logs in native code: cycles, executions, changes of numbers, instructions."""
