"""Firmware images: ELF and HEX readers, symbols, source lines and static footprint."""
