"""C front end: command line options, clang, XC16's dialect, checks of the generated LLVM IR."""
