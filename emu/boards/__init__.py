"""Boards: what a robot adds to the chip. `epuck` is the only one so far."""
