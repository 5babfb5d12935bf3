"""Toolchain for the dsPIC30F: compiler driver, assembler, linker, object file tools and analysis tools."""
