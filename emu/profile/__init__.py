"""Profiling: `cycle_shares` counts cycles, `call_graph` reconstructs calls, the other modules write viewer files."""
