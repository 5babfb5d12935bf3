"""ABI facts: registers, argument placement, assembler names, interrupt names, struct alignment."""
