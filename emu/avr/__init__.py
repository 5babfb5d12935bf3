"""Cycle-exact emulator of the ATmega328P: instruction table, core and devices in C, firmware images, machine."""
