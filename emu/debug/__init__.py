"""Seeing inside a program that runs: variables, call stacks, threads, and the way it came.

Nothing here is in an engine's way: a machine that nobody looks into pays nothing for it.
"""
