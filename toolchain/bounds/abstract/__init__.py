"""Abstract domain: sets of integers, abstract states, and refinement by branch conditions."""
