"""Legalisation: LLVM IR to operations and widths that the machine has."""
