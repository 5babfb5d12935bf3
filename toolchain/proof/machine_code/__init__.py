"""Symbolic execution of machine code."""
