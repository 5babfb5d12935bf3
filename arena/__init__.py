"""Swarm simulator: robots with firmware, or with a scripted controller, in a world of walls and objects."""
