"""The command `openswarm`: project set-up, diagnosis of the installation, flashing, paths for build files.

The folder also has CMake's toolchain file (`cmake/`), the files of a new project (`template/`) and, in a wheel, a copy
of the kernel (`firmware/`).
"""
