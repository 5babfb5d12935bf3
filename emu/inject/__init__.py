"""Fault injection:

`campaign` reads the configuration, `faults` injects, `trial` runs and classifies, `report` counts.
"""
