"""Translation validation: proofs by an SMT solver that machine code implements the optimised LLVM IR."""
