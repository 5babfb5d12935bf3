"""Somebody else's reader of waveforms, `VCDVCD`. It is a script first: importing it lets a broken pipe end the process,
which a worker that runs other tests must not do; so it is imported here and nowhere else."""

from __future__ import annotations

import signal

import pytest

_pipe = signal.getsignal(signal.SIGPIPE)
VCDVCD = pytest.importorskip("vcdvcd", reason="the independent reader is not installed (extra: test)").VCDVCD
signal.signal(signal.SIGPIPE, _pipe)
