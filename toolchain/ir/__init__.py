"""LLVM IR as Python objects: parser, model, builder, control-flow graph, dump, rules of well-formedness."""
