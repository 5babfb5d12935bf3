"""Worst-case time, stack and masking of a linked image, by running it on sets of values."""
