"""Profiling. `cycle_shares` counts cycles, `call_graph` reconstructs calls, other modules write files for viewers."""
