"""Worst-case stack use of a linked image, from its instructions."""
