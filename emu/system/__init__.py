"""Basis of every machine: state record, event schedule, bus, program memory, device base class, rule language."""
