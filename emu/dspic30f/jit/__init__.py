"""JIT for the dsPIC30F core: translates regions of firmware to LLVM IR by means of the instruction table."""
