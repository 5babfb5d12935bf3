"""Devices of the ATmega328P in C. One translation unit holds them all (native.py)."""
