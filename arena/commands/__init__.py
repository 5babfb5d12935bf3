"""One module per command, each with `parser()` and `run(options)`."""
