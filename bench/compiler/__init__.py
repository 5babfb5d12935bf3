"""Size, speed and proofs of compiled code, and time of compilation."""
