"""Debugger prompt in a terminal: a client of the debug server in the same process."""
