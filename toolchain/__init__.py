"""A free toolchain for the dsPIC30F6014A: compiler driver, assembler, linker and object file tools."""
