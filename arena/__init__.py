"""Robots with firmware, or with the same controller in Python, in a world of walls and objects; and its experiment."""
