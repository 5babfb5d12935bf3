"""Firmware under pytest: a plugin with the fixtures `firmware` and `robot` (docs/testing.md)."""
