"""Optimisation passes over legal IR and the machine form."""
