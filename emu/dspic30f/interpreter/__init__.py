"""The plain interpreter: sequencing rules, instruction facts, and rows run on Python integers."""
