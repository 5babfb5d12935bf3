"""The sub-commands of `python -m toolchain` except `cc`, one module each with `main(arguments) -> exit status`."""
