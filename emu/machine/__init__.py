"""One microcontroller: connected record, bus, CPU and peripherals, its run loop, and its stops."""
