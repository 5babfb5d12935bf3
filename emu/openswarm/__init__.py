"""What the measuring commands know of our kernel: symbols of the `footprint` and `latency` applications."""
