"""Instruction table of the dsPIC30F, its codec and its assembly text. Imports no other package of the project."""
