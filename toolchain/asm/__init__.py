"""Assembler: translates source text in the syntax of pic30-as to relocatable objects."""
