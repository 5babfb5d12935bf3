"""The physical world: walls, discs and robots in pymunk, and wheel speeds from motor steps."""
