"""Linker: objects and archives to an image."""
