"""One microcontroller: record, bus, CPU and peripherals wired together, its run loop, and its stops."""
