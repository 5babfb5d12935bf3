"""Timers 1-5, input capture and output compare."""
