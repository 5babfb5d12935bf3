"""I/O ports, change notification and external interrupt pins."""
