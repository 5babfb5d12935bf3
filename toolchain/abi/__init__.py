"""ABI facts: registers, locations of arguments, assembler names, interrupt names, struct alignment."""
