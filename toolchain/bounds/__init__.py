"""Bounds of execution time, stack use and interrupt masking of a linked image, by abstract execution."""
