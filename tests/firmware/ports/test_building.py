"""`make -C firmware` rebuilds an image if and only if one of its inputs has changed."""

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
int main(void) { Sys_Init_Kernel(); for (uint16 i = 0; i < 100; i++) { count += BLINK + i; } return 0; }
"""


@pytest.fixture
def make(tmp_path: Path):
    """Return make(*arguments), which builds a small application in one folder and returns whether files were
    rebuilt."""
    app = tmp_path / "apps" / "small"
    app.mkdir(parents=True)
    (app / "main.c").write_text(MAIN)
    fixed = ["APP=small", f"APPS={app.parent}", f"OUT={tmp_path / 'out'}", f"PYTHON={sys.executable}"]

    def build(*words: str) -> bool:
        command = ["make", "-C", str(FIRMWARE), *fixed, *words]
        environment = {**os.environ, "MAKEFLAGS": "", "LC_ALL": "C"}
        done = subprocess.run(command, capture_output=True, text=True, timeout=HANG, check=False, env=environment)
        assert done.returncode == 0, done.stdout + done.stderr
        return "Nothing to be done" not in done.stdout

    build.app = app  # type: ignore[attr-defined]
    build.image = tmp_path / "out" / "firmware.elf"  # type: ignore[attr-defined]
    return build


@pytest.mark.slow
@pytest.mark.parametrize("words", [["DEFINES=-DBLINK=3"], ["OPTIMISE=-O2"], ["DEFINES=-DSYS_HEAP=2048 -DX='\"a  b\"'"]])
def test_a_changed_option_builds_anew_and_so_does_the_way_back(make, words: list[str]) -> None:
    assert make()
    plain = make.image.read_bytes()
    assert not make(), "twice the same does nothing"
    assert make(*words)
    assert make.image.read_bytes() != plain
    assert not make(*words)
    assert make()
    assert make.image.read_bytes() == plain


@pytest.mark.slow
def test_drivers_and_files_that_come_and_go_build_anew(make) -> None:
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
def test_another_toolchain_port_or_compiler_builds_anew(make, tmp_path: Path) -> None:
    """Images of different compilers, ports and toolchains have separate folders.

    The substitute compilers only print their arguments.
    """
    for name in ("xc16-gcc", "xc16-bin2hex"):
        tool = tmp_path / name
        tool.write_text(
            '#!/bin/sh\nfor last; do :; done\necho "$@" >"$last.txt"; [ "$1" = "$last" ] || echo x >"$last"\n'
        )
        tool.chmod(0o755)
    microchip = ["TOOLCHAIN=xc16", f"XC16={tmp_path / 'xc16-gcc'}", "XC16_BIN2HEX=true"]
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
def test_a_failed_build_leaves_no_image_and_is_tried_again(make) -> None:
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


def test_an_unknown_driver_is_named(make) -> None:
    (make.app / "app.mk").write_text("DEVICES := camra\n")
    with pytest.raises(AssertionError, match="camra"):
        make()
