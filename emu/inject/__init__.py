"""Fault injection campaigns.

`campaign` reads the configuration, `faults` injects, `trial` runs and classifies, `report` computes statistics.
"""
