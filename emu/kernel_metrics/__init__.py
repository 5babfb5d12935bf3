"""Measurements of the OpenSwarm kernel, by means of the applications `footprint`, `latency` and `options`."""
