"""Run the command line as `python -m openswarm`."""

import sys

from openswarm.cli import main

sys.exit(main())
