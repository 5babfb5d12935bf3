"""Optimised LLVM IR on symbolic inputs."""
