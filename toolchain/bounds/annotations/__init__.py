"""Annotations of an image: loop bounds and targets from notes, names and debug information."""
