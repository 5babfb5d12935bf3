"""Fixtures: firmware images for robots, and full disks."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from arena.trial import checkpoints
from tests.arena.robot_programs import BEGIN
from tests.firmware.conftest import built_once
from tests.full_device import FULL_DEVICE, NO_FULL_DEVICE
from toolchain.driver import driver

needs_fork = pytest.mark.skipif(
    not checkpoints.CAN_FORK, reason="checkpoints are forked processes, which only Linux makes safely"
)


@pytest.fixture(scope="session")
def clustering_image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the project's clustering firmware, built once per test session."""
    return built_once(tmp_path_factory, "clustering")


@pytest.fixture(scope="session")
def talking_image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return firmware that sends a line, lights LED 0, and reaches an illegal opcode after about a second."""
    return _assembled(tmp_path_factory.mktemp("talking"), TALKING)


@pytest.fixture(scope="session")
def assembled(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return a function that assembles a source text to an image file, each text once."""
    return cache(lambda text: _assembled(tmp_path_factory.mktemp("assembled"), text))


def _assembled(folder: Path, text: str) -> Path:
    source, image = folder / "main.s", folder / "main.elf"
    source.write_text(text)
    assert driver.main([str(source), "-o", str(image)]) == 0
    return image


TALKING = f"""{BEGIN}
        mov     #'h', w0
        mov     w0, U1TXREG
        mov     #'i', w0
        mov     w0, U1TXREG
        mov     #10, w0
        mov     w0, U1TXREG
        bclr    TRISA, #6
        bset    LATA, #6                ; LED 0
        mov     #100, w1                ; 100 * 147456 Tcy = 1 s
2:      mov     #49151, w0
1:      dec     w0, w0
        bra     nz, 1b
        dec     w1, w1
        bra     nz, 2b
        .pword  0xDB0000                ; no instruction
3:      bra     3b
"""


@pytest.fixture
def full_disk() -> Path:
    """Return a file whose writes fail with ENOSPC. See `FULL_DEVICE`."""
    if not FULL_DEVICE.exists():
        pytest.skip(NO_FULL_DEVICE)
    return FULL_DEVICE


@pytest.fixture
def unwritable(full_disk: Path, monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Return a set of file names. While a name is in it, every write of such a file fails with ENOSPC."""
    names: set[str] = set()
    make = tempfile.mkstemp

    def make_full(*, dir: str | Path | None, prefix: str, suffix: str) -> tuple[int, str]:
        handle, name = make(dir=dir, prefix=prefix, suffix=suffix)
        if prefix.strip(".") in names:
            Path(name).unlink()
            Path(name).symlink_to(full_disk)
        return handle, name

    monkeypatch.setattr("emu.host.files.tempfile.mkstemp", make_full)
    return names
