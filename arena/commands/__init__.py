"""Commands of `arena`: one module each, with `parser()` and `run(options)`."""
