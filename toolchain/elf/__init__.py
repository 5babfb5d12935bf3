"""ELF for dsPIC30F: model, reader, writer."""
