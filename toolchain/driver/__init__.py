"""The compiler driver: command line to ELF, the pass pipeline, link stage and run-time library."""
