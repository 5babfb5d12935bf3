"""Abstract values and states: sets of integers, and what a condition says about them."""
