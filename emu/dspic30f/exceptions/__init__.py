"""Interrupts, traps, core faults, Idle and Sleep: all that changes the control flow between two instructions."""
