"""Speed of the emulator and of its instruments."""
