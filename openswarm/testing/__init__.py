"""Tests of firmware with pytest: a plugin with the fixtures `firmware` and `robot` (docs/testing.md)."""
