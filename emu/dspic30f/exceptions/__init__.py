"""Interrupts, traps, core faults, Idle and Sleep: what changes the flow between two instructions."""
