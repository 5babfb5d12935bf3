"""Endless inputs: every command refuses them in one line, within a limited address space."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from emu.host import files

resource = pytest.importorskip("resource")
ADDRESS_SPACE = 6_000_000_000


def limit_memory() -> None:
    """Limit the address space, so that a command without a limit of its own cannot use all memory of the host."""
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="needs /dev/zero")
@pytest.mark.parametrize(
    "line",
    [
        "emu run /dev/zero",
        "emu run --stimulus /dev/zero IMAGE",
        "emu inject --campaign /dev/zero IMAGE",
        "toolchain hex /dev/zero",
        "toolchain ar x /dev/zero",
        "toolchain hex -",
        "toolchain cc @/dev/zero",
    ],
)
def test_an_endless_file_is_one_line_and_status_2(line: str, tmp_path: Path) -> None:
    """An endless file is refused with one line and status 2 when it exceeds the size limit."""
    image = tmp_path / "image.hex"
    image.write_text(":04000000FFFF3700C7\n:00000001FF\n")
    words = [str(image) if word == "IMAGE" else word for word in line.split()]
    with open("/dev/zero", "rb") as zero:
        done = subprocess.run([sys.executable, "-m", *words], stdin=zero, capture_output=True, text=True, cwd=tmp_path,
                              env={"PYTHONPATH": str(Path(__file__).parents[1])}, check=False,
                              preexec_fn=limit_memory)  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert "is larger than" in done.stderr


def test_a_file_up_to_the_limit_is_read(tmp_path: Path) -> None:
    """A file of several read blocks below the limit, which is far above the largest image, is read completely."""
    path = tmp_path / "file"
    path.write_bytes(bytes(range(256)) * (3 * files.PIECE_OCTETS // 256) + b"end")
    assert files.read_file(path) == path.read_bytes()
    assert files.read_file(path, 5) == bytes(range(5))
