"""The C front end around clang: options, XC16's dialect, checks of the generated LLVM IR."""
