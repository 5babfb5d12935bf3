"""Chips as data; `dspic30f6014a` is the only one so far."""
