"""DWARF readers: compile units, locations of variables, C types."""
