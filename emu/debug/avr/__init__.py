"""Debugger and profile of a Kilobot's ATmega328P: machine, call stacks by DWARF frames, faults."""
