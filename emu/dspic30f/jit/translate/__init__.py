"""Translation of a region of instructions to a function: blocks, flow, REPEAT, polling loops, boundaries, hooks."""
