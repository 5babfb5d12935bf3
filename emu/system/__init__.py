"""Substrate of every machine: state record, event clock, bus, program memory, device base, rule language."""
