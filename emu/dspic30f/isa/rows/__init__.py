"""Rows of the instruction table in groups: one module per table in isa.md §5."""
