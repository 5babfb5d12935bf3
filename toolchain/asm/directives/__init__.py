"""Assembler directives: sections, data, symbols, macros, repeats and include files."""
