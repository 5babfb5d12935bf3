"""Symbolic execution of optimised LLVM IR."""
