"""Independent reader of waveforms in VCD files: `VCDVCD`.

That package is written as a script: its import changes how the process handles broken pipes. Tests therefore import it
only through this module, which restores the handling.
"""

from __future__ import annotations

import signal

import pytest

_pipe = signal.getsignal(signal.SIGPIPE)
VCDVCD = pytest.importorskip("vcdvcd", reason="the independent reader is not installed (extra: test)").VCDVCD
signal.signal(signal.SIGPIPE, _pipe)
