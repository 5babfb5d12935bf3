"""Source annotations of an image: parsing, and binding to loops and calls through the debug information."""
