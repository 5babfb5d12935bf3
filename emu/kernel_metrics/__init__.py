"""Measurements of the OpenSwarm kernel, using symbols of the `footprint`, `latency` and `options` applications."""
