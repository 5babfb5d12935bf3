"""The command `openswarm`: sets up projects, tells what is installed, says where things lie. The wheel's copy of the
kernel (`firmware/`), CMake's toolchain file (`cmake/`) and the files of a new project (`template/`) are beside it."""
