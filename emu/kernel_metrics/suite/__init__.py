"""The kernel's own suite of measurements: applications `latency`, `options` and `footprint`."""
