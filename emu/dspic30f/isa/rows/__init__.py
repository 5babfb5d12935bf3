"""Rows of the instruction table by group, one module per section of isa.md §5."""
