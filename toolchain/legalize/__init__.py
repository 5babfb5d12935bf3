"""Legalisation: LLVM IR to the operations and widths of the CPU."""
