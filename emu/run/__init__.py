"""Runs from the command line: session, host ports of the UARTs, and the log of timestamped input."""
