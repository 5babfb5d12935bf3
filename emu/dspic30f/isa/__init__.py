"""The instruction table of the dsPIC30F and its readers: codec, text. A leaf: imports nothing else of the project."""
