"""Entry point of `python -m toolchain COMMAND`."""

import gc
import sys

from toolchain.cli import main

gc.set_threshold(100_000)  # with Python's 700, collections take 8 % of a build
sys.exit(main(sys.argv[1:]))
