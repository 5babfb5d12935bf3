"""Native code for the dsPIC30F core: regions translated through the instruction table to LLVM IR."""
