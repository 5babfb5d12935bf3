"""`make -C firmware` rebuilds an image if and only if one of its inputs has changed.

Most tests replace the compiler by a script that writes its arguments and the sources into the image.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.firmware.conftest import FIRMWARE
from tests.watchdog import HANG

MAIN = """#include <openswarm.h>
#ifndef BLINK
#define BLINK 0
#endif
volatile uint16 count;
int main(void) { for (uint16 i = 0; i < 100; i++) { count += BLINK + i; } return 0; }
"""
WRITER = """#!/bin/sh
for image; do :; done
for source; do case "$source" in *.[cS]) cat "$source" || exit 1; esac; done >"$image"
echo "$@" >>"$image"
"""
"""Script in place of a compiler: the last argument is the image."""
MAKE = ["make", "-C", str(FIRMWARE)]


class Maker:
    """Builds a small application in one folder."""

    def __init__(self, folder: Path, python: str) -> None:
        self.app = folder / "apps" / "small"
        self.image = folder / "out" / "firmware.elf"
        self.fixed = ["APP=small", f"APPS={self.app.parent}", f"OUT={folder / 'out'}", f"PYTHON={python}"]
        self.app.mkdir(parents=True)
        (self.app / "main.c").write_text(MAIN)

    def __call__(self, *words: str) -> bool:
        """Run make and return whether it rebuilt files."""
        environment = {**os.environ, "MAKEFLAGS": "", "LC_ALL": "C"}
        done = subprocess.run(
            [*MAKE, *self.fixed, *words], capture_output=True, text=True, timeout=HANG, check=False, env=environment
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return "Nothing to be done" not in done.stdout


@pytest.fixture
def writer(tmp_path: Path) -> Path:
    """Return the script that replaces compilers."""
    path = tmp_path / "writer"
    path.write_text(WRITER)
    path.chmod(0o755)
    return path


@pytest.fixture
def make(tmp_path: Path, writer: Path) -> Maker:
    """Return a function that builds with the script and returns whether files were rebuilt."""
    return Maker(tmp_path, str(writer))


@pytest.mark.parametrize("words", [["DEFINES=-DBLINK=3"], ["OPTIMISE=-O2"], ["DEFINES=-DSYS_HEAP=2048 -DX='\"a  b\"'"]])
def test_a_changed_option_builds_anew_and_so_does_the_way_back(make: Maker, words: list[str]) -> None:
    assert make()
    plain = make.image.read_bytes()
    assert not make(), "twice the same does nothing"
    assert make(*words)
    assert make.image.read_bytes() != plain
    assert not make(*words)
    assert make()
    assert make.image.read_bytes() == plain


@pytest.mark.slow
def test_drivers_and_files_that_come_and_go_build_anew(make: Maker) -> None:
    """Removing a source file also causes a rebuild, although it leaves no newer file."""
    assert make()
    plain = make.image.read_bytes()
    (make.app / "app.mk").write_text("DEVICES := battery\n")
    assert make()
    assert not make()
    (make.app / "app.mk").unlink()
    assert make()
    (make.app / "more.c").write_text("int more(void); int more(void) { return 1; }\n")
    assert make()
    (make.app / "more.c").unlink()
    assert make()
    (make.app / "own.h").write_text("\n")
    assert make()
    (make.app / "own.h").unlink()
    assert make()
    assert not make()
    (make.app.parent / "shared").mkdir()
    (make.app.parent / "shared" / "shared.h").write_text("\n")
    (make.app / "app.mk").write_text("INCLUDES = -I$(APPS)/shared\n")
    assert make()
    assert not make()
    (make.app.parent / "shared" / "other.h").write_text("\n")
    assert make()
    (make.app / "app.mk").unlink()
    assert make()
    assert not make()
    assert make.image.read_bytes() == plain


@pytest.mark.slow
def test_another_toolchain_port_or_compiler_builds_anew(make: Maker, writer: Path) -> None:
    """Images of different compilers, ports and toolchains differ, and each is rebuilt only if it has changed."""
    microchip = ["TOOLCHAIN=xc16", f"XC16={writer}", "XC16_BIN2HEX=true"]
    assert make()
    ours = make.image.read_bytes()
    assert make(*microchip)
    assert make.image.read_bytes() != ours
    assert not make(*microchip)
    assert make()
    assert make.image.read_bytes() == ours
    if shutil.which("gcc"):
        assert make("TARGET=posix")
        assert not make("TARGET=posix")
        assert make("TARGET=posix", "HOST_FLAGS=-O0")
        assert make("TARGET=template")


@pytest.mark.slow
def test_a_failed_build_is_tried_again(tmp_path: Path) -> None:
    """The compiler itself builds here, without the kernel (BARE)."""
    make = Maker(tmp_path, sys.executable)
    (make.app / "app.mk").write_text("BARE := none\n")
    assert make()
    plain = make.image.read_bytes()
    (make.app / "main.c").write_text("int main(void) { return nothing; }\n")
    with pytest.raises(AssertionError, match="nothing"):
        make()
    with pytest.raises(AssertionError, match="nothing"):
        make()
    (make.app / "main.c").write_text(MAIN)
    assert make()
    assert make.image.read_bytes() == plain


def test_an_unknown_driver_is_named(make: Maker) -> None:
    (make.app / "app.mk").write_text("DEVICES := camra\n")
    with pytest.raises(AssertionError, match="camra"):
        make()
