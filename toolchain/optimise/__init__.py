"""Optimisation passes over legal IR and machine form."""
