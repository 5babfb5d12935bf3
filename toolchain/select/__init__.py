"""Instruction selection: legal IR to machine instructions over virtual registers."""
