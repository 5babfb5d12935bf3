"""The physical world: walls, discs and robots in pymunk, and the wheels that the firmware's steppers turn."""
