"""Measurements of speed, size and time bounds."""
