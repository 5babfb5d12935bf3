"""Scenes: TOML files to checked values, geometry, dimensions of bodies and start positions. Knows no physics."""
