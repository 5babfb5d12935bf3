"""Register allocation by graph colouring, spill code and stack frames."""
