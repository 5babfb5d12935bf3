"""Programs for the AVR emulator, built by avr-gcc; without it their tests are skipped."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from emu.avr.image import AvrImage, load_avr_image
from emu.avr.machine import Atmega328p
from firmware.tools.simulated.machine import NotInstalled
from tests.emu.avr.oracle import Pair

START = "#include <avr/io.h>\n#include <avr/interrupt.h>\n#include <avr/sleep.h>\n#include <stdint.h>\n"
Build = Callable[..., AvrImage]
Machine = Callable[..., Atmega328p]


def needs(program: str) -> None:
    """Skip the test if a program of Debian's binutils-avr or gcc-avr is missing: pip has no compiler for AVR."""
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed; Debian packages: gcc-avr, binutils-avr, avr-libc")


def compiled(source: Path, out: Path, *flags: str) -> AvrImage:
    """Build a C file for the ATmega328P."""
    needs("avr-gcc")
    command = ["avr-gcc", "-mmcu=atmega328p", "-DF_CPU=8000000UL", "-std=gnu99", "-gdwarf-2", *flags, str(source)]
    subprocess.run([*command, "-lm", "-o", str(out)], check=True)
    return load_avr_image(str(out))


@pytest.fixture
def build(tmp_path: Path) -> Build:
    """Return a function that builds C text preceded by the usual headers."""

    def one(text: str, *flags: str) -> AvrImage:
        source = tmp_path / "program.c"
        source.write_text(START + text)
        return compiled(source, tmp_path / "program.elf", *(flags or ("-Os",)))

    return one


@pytest.fixture
def machine(build: Build) -> Machine:
    """Return a function that builds C text and returns a machine at its reset vector."""

    def one(text: str, *flags: str) -> Atmega328p:
        return Atmega328p(build(text, *flags))

    return one


@pytest.fixture(scope="module")
def pair() -> Pair:
    """Return simavr and the emulator side by side."""
    try:
        return Pair()
    except NotInstalled as missing:
        pytest.skip(str(missing))
