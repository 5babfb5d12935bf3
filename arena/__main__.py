"""Entry point of `python -m arena`."""

import sys

from arena.entry import main

sys.exit(main())
