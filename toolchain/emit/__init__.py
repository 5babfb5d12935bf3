"""Machine form and data to assembly text."""
