"""A run from the command line: session, UART consoles and the log of timestamped input."""
