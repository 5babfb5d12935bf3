"""The command `openswarm`: creates projects, checks the installation, flashes robots, prints paths for builds.

The folder also contains CMake's toolchain file (`cmake/`), the files of a new project (`template/`) and, in a wheel,
a copy of the kernel (`firmware/`).
"""
