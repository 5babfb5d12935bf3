"""Assembler: pic30-as source text to relocatable objects."""
