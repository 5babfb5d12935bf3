"""LLVM IR of registers, of the rows of the instruction table, and of the rules of devices and of flow."""
