"""C expressions on a paused machine: parser and evaluator, arithmetic, type names."""
