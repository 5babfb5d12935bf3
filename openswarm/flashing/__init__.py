"""How an image gets into a robot by its boot loader: which rows, in which order, over which line."""
