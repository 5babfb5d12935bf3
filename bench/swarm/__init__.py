"""Speed of the arena and of Kilobots in a crowd."""
