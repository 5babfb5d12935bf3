"""An image depends on the commit alone, not on the path of the checkout.

Otherwise one clone could not resume a run of another, and results could not be traced to their firmware.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from emu.cli import main
from tests.firmware.conftest import Build
from tests.watchdog import HANG
from toolchain.driver import driver

ROOT = Path(__file__).resolve().parents[3]
PARTS = ("emu", "toolchain", "firmware")


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the project, whose path differs from that of this checkout in length and depth."""
    root = tmp_path_factory.mktemp("checkouts") / "another" / "and-deeper-than-this"
    for part in PARTS:
        shutil.copytree(ROOT / part, root / part, ignore=shutil.ignore_patterns("__pycache__", "build"))
    return root


def built(root: Path, scratch: Path, app: str, *words: str) -> Path:
    """Build an application of a checkout with the cache of a scratch folder: the shared one has a run-time library and
    IR of this checkout, which would hide differences."""
    out = scratch / root.name / app
    command = ["make", "-C", str(root / "firmware"), f"APP={app}", f"OUT={out}", f"PYTHON={sys.executable}", *words]
    environment = os.environ | {"OPENSWARM_CACHE": str(scratch / "cache")}
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANG, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    return out / "firmware.elf"


@pytest.mark.slow
def test_two_checkouts_of_one_commit_build_the_same_bytes(checkout: Path, image: Build) -> None:
    """Two checkouts of one commit build identical bytes from C, assembly, inline functions and library, all with -g.

    This checkout's image is that of all tests, which share the IR of kernel and drivers in the cache.
    """
    one = image("clustering").read_bytes()
    assert built(checkout, checkout.parent, "clustering").read_bytes() == one
    plain = one.replace(b"\0", b"")  # debug information has a phantom byte after every byte
    for root in (checkout, ROOT):
        assert str(root).encode() not in plain


@pytest.mark.slow
def test_an_application_of_another_folder_does_not_bring_that_folder_along(checkout: Path, tmp_path: Path) -> None:
    """Building an application by absolute path (`APPS=`) does not put that path into the image."""
    images = []
    for root, folder in ((checkout, tmp_path / "mine"), (ROOT, tmp_path / "some" / "other")):
        source = folder / "tiny" / "main.c"
        source.parent.mkdir(parents=True)
        source.write_text("const char *volatile name;\nint main(void) { name = __FILE__; return name[0]; }\n")
        (source.parent / "app.mk").write_text("BARE := none\n")
        images.append(built(root, checkout.parent, "tiny", f"APPS={folder}").read_bytes())
    assert images[0] == images[1]


@pytest.mark.slow
def test_source_lines_are_still_found(
    checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Source paths start at the project's folder, and the listing with sources resolves them from any working
    folder."""
    image = built(checkout, checkout.parent, "clustering")
    monkeypatch.chdir(tmp_path)
    assert main(["disasm", str(image), "--source"]) == 0
    listing = capsys.readouterr().out
    assert re.search(r"^firmware/apps/clustering/main\.c:\d+: \S", listing, re.MULTILINE)


def test_the_assembler_records_the_path_it_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The assembler records the path given by `cc -g -ffile-prefix-map=` for a file with an absolute path."""
    monkeypatch.chdir(tmp_path)
    source = tmp_path / "one.s"
    source.write_text("\t.text\n\t.global _main\n_main: return\n")
    assert driver.main(["-g", "-c", f"-ffile-prefix-map={tmp_path}=here", str(source), "-o", "one.o"]) == 0
    plain = (tmp_path / "one.o").read_bytes().replace(b"\0", b"")
    assert b"here/one.s" in plain
    assert str(tmp_path).encode() not in plain
