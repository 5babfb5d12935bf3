"""Infrared light between robots: the proximity ring, propagation, and the channel that all emitters share."""
