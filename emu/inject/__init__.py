"""Fault injection: `campaign` reads what is wanted, `faults` does it, `trial` runs and judges, `report` counts."""
