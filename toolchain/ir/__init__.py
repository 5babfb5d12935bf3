"""LLVM IR as Python objects: reader, model, dump, rules of well-formedness."""
