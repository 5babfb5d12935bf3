"""Builds of the ports for other robots, and their runs in simavr and QEMU. A missing Debian package skips the test."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from firmware.tools.simulated import qemu
from firmware.tools.simulated.kilobot import HZ, Kilobot
from firmware.tools.simulated.machine import NotInstalled
from tests.firmware.conftest import FIRMWARE

BOARDS = {"epuck2": qemu.EPUCK2, "qemu_virt": qemu.QEMU_VIRT}
"""Targets that run in QEMU."""


def make(target: str, app: str, out: Path, *words: str, apps: Path | None = None) -> Path:
    """Build an image for another robot."""
    folder = [f"APPS={os.path.relpath(apps, FIRMWARE)}"] if apps else []
    command = ["make", "-s", "-C", str(FIRMWARE), f"TARGET={target}", f"APP={app}", f"OUT={out}", *folder, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "MAKEFLAGS": ""})
    if "is not installed" in done.stderr:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stdout + done.stderr
    return out / "firmware.elf"


def kilobot(image: Path) -> Kilobot:
    """Return a simulated Kilobot at its reset vector."""
    try:
        return Kilobot(image)
    except NotInstalled as missing:
        pytest.skip(str(missing))


def in_qemu(target: str, image: Path) -> qemu.Qemu:
    """Return a CPU in QEMU at its reset vector."""
    try:
        return qemu.Qemu(BOARDS[target], image)
    except NotInstalled as missing:
        pytest.skip(str(missing))


def said_by_kilobot(image: Path, seconds: float) -> bytes:
    """Return the UART's output of so many simulated seconds."""
    machine = kilobot(image)
    machine.run(int(seconds * HZ))
    return machine.uart()


def said_in_qemu(target: str, image: Path, text: bytes) -> bytes:
    """Return UART1's output up to a match of the regular expression `text`."""
    try:
        return qemu.run_until(BOARDS[target], image, text)
    except NotInstalled as missing:
        pytest.skip(str(missing))
