"""The sub-commands of `python -m toolchain` but for `cc`, one module each with `main(arguments) -> exit status`."""
