"""The plain interpreter: sequencing rules, instruction facts, and table rows executed with Python integers."""
