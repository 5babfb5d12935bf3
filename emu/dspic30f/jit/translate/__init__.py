"""Translation of a region of instructions to LLVM IR: builder, lazy flags, polling loops, boundaries, counters."""
