"""Memory and cycles of the OpenSwarm kernel and its applications."""
