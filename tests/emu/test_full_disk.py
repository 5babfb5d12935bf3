"""Output files of `emu run` on a full disk: one line that names the file, status 2, and no incomplete file."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.full_device import FULL_DEVICE, NO_FULL_DEVICE
from toolchain.cli import main as toolchain

resource = pytest.importorskip("resource")
LARGEST_FILE = 40 << 10
SOURCE = "#include <p30F6014A.h>\nint main(void) { TRISD = 0; for (;;) LATD ^= 0xFFFF; }\n"


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return firmware that changes all pins of a port every few cycles."""
    folder = tmp_path_factory.mktemp("image")
    (folder / "main.c").write_text(SOURCE)
    assert toolchain(["cc", str(folder / "main.c"), "-o", str(folder / "main.elf")]) == 0
    return folder / "main.elf"


def limit_files() -> None:
    """Limit the size of files, which has the effect of a disk that becomes full. With -B Python writes no truncated
    byte code, which later processes would read."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_FILE, LARGEST_FILE))


@pytest.mark.parametrize("option", ["--vcd", "--trace"])
@pytest.mark.parametrize("target", ["/dev/full", "file"])
def test_a_full_disk_under_a_waveform_is_one_line(option: str, target: str, image: Path, tmp_path: Path) -> None:
    """If the disk becomes full while a waveform is written, the error is raised during the run, and the writer is not
    used afterwards."""
    if not Path(target).is_absolute():
        target = str(tmp_path / target)
    elif not FULL_DEVICE.exists():
        pytest.skip(NO_FULL_DEVICE)
    words = ["run", str(image), "--cycles", "60000", "--engine", "plain", option, target]
    done = subprocess.run([sys.executable, "-B", "-m", "emu", *words], capture_output=True, text=True, check=False,
                          cwd=Path(__file__).parents[2], preexec_fn=limit_files)  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"emu run: {target}: ")
    assert not list(tmp_path.iterdir())
