"""Instruction table of the ATmega328P, its decoder, its disassembler and the C code made from it."""
