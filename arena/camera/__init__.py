"""What a robot's camera sees: lens, appearance of objects, the native renderer and its slower reference."""
