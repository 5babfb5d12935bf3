"""An independent reader of waveforms: `VCDVCD`.

Importing that package changes how the process handles broken pipes, because it is written as a script. Tests therefore
import it only through this module, which restores the handling.
"""

from __future__ import annotations

import signal

import pytest

_pipe = signal.getsignal(signal.SIGPIPE)
VCDVCD = pytest.importorskip("vcdvcd", reason="the independent reader is not installed (extra: test)").VCDVCD
signal.signal(signal.SIGPIPE, _pipe)
