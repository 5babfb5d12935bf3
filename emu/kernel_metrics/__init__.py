"""What the measuring commands know of our kernel: symbols of the `footprint`, `latency` and `options` applications."""
