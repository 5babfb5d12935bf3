"""The camera of a robot: lens, appearance of bodies, and the native renderer."""
