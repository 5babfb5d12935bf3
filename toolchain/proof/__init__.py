"""Proofs by an SMT solver that machine code does what the optimised LLVM IR says."""
