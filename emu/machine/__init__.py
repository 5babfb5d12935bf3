"""One microcontroller: record, bus, CPU and devices wired together, its main loop, and fault reports."""
