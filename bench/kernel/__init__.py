"""Bounds, stacks and structures of the kernel, and the comparison with other systems."""
