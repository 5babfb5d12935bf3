"""Machine code on symbolic inputs."""
