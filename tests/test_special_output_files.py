"""Output to special files: a pipe or device is opened and written, never replaced by a regular file, also for root."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from arena.trial.record import RecordError, write_bytes
from emu.boards.picture import write_picture
from emu.host.files import atomic_file, atomic_text_file, is_opened, read_file
from tests.watchdog import HANG
from toolchain.errors import ToolError
from toolchain.files import write_outputs


def text(path: Path) -> None:
    with atomic_text_file(path) as stream:
        stream.write("text")


def part_of(path: Path) -> None:
    with atomic_file(path) as part:
        part.write_bytes(b"part")


WRITERS: dict[str, tuple[Callable[[Path], None], bytes]] = {
    "toolchain": (lambda path: write_outputs([(path, b"object")]), b"object"),
    "record": (lambda path: write_bytes(path, b"record"), b"record"),
    "text": (text, b"text"),
    "picture": (lambda path: write_picture(path, np.zeros((2, 2, 3), np.uint8)), b"\x89PNG"),
    "file": (part_of, b"part"),
}


@pytest.mark.parametrize("kind", WRITERS)
def test_a_pipe_is_written_and_stays_a_pipe(kind: str, tmp_path: Path) -> None:
    write, said = WRITERS[kind]
    pipe, got = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = Thread(target=lambda: got.append(pipe.read_bytes()), daemon=True)
    reader.start()
    write(pipe)
    assert pipe.is_fifo()
    reader.join(10)
    assert got[0].startswith(said)
    assert [path.name for path in tmp_path.iterdir()] == ["pipe"]


@pytest.mark.parametrize("kind", WRITERS)
def test_a_link_leads_on_and_permissions_stay(kind: str, tmp_path: Path) -> None:
    """Output through a symbolic link goes to its target, whose permissions are kept; a new file has those of the
    umask, and a name may have 250 characters."""
    write, said = WRITERS[kind]
    secret, link, new = tmp_path / "secret", tmp_path / "folder" / "link", tmp_path / ("n" * 250)
    link.parent.mkdir()
    secret.write_bytes(b"old")
    secret.chmod(0o600)
    link.symlink_to(secret)
    write(link)
    write(new)
    assert link.is_symlink()
    assert secret.read_bytes().startswith(said)
    assert [path.stat().st_mode & 0o777 for path in (secret, new)] == [0o600, 0o666 & ~umask()]
    assert len(list(tmp_path.iterdir())) == 3


def umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


@pytest.mark.parametrize("kind", WRITERS)
def test_what_cannot_be_written_is_named(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """If a file cannot be written, the message has its own name, not that of the temporary file. A file without write
    permission is not replaced."""
    write, _ = WRITERS[kind]
    with pytest.raises((OSError, ToolError, RecordError), match=r"absent/name[':]"):
        write(tmp_path / "absent" / "name")
    kept = tmp_path / "kept"
    kept.write_bytes(b"old")
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # as for every user except root
    with pytest.raises((OSError, ToolError, RecordError), match=r"kept[':]"):
        write(kept)
    assert kept.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]


def test_a_file_may_be_called_dash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The path `./-` denotes a file with the name `-`, not a standard stream."""
    monkeypatch.chdir(tmp_path)
    write_outputs([("./-", b"object")])
    assert (tmp_path / "-").read_bytes() == b"object"
    with atomic_text_file("./-") as stream:
        stream.write("text")
    assert read_file("./-") == b"text"


def test_names_of_open_files_are_opened(tmp_path: Path) -> None:
    """`is_opened` is true for devices and for paths of open files such as /dev/stdout, and false for regular files
    and symbolic links to them."""
    plain, link = tmp_path / "plain", tmp_path / "link"
    with plain.open("w") as stream:
        assert is_opened(f"/proc/self/fd/{stream.fileno()}") == Path("/proc/self/fd").exists()
    link.symlink_to(plain)
    assert [is_opened(path) for path in (plain, link, tmp_path / "absent", os.devnull)] == [False, False, False, True]


HEX = Path(__file__).resolve().parent / "emu" / "cli" / "hello.hex"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "given", "start"),
    [
        ("emu info -", HEX.read_bytes(), b"-: Intel HEX"),
        ("emu run - --cycles 200 --trace - --uart1 none", HEX.read_bytes(), b"#      cycle"),
        ("emu screenshot - --output -", HEX.read_bytes(), b"\x89PNG"),
        ("toolchain as - -o -", b"nop\n", b"\x7fELF"),
        (
            "arena run - --brain scripted --trials 1 --minutes 0.01 --out t",
            b'name = "my"\n[robots]\ncount = 1',
            b"trial-0001",
        ),
    ],
)
def test_a_dash_is_standard_input_or_output(line: str, given: bytes, start: bytes, tmp_path: Path) -> None:
    """In every command, `-` denotes standard input or output for a file that is read or written as a whole; no file
    `-` is created."""
    done = subprocess.run([sys.executable, "-m", *line.split()], input=given, capture_output=True, cwd=tmp_path,
                          env={**os.environ, "PYTHONPATH": str(HEX.parents[3])}, timeout=HANG, check=False)  # fmt: skip
    assert (done.returncode, done.stdout[: len(start)]) == (0, start), done.stderr
    assert not (tmp_path / "-").exists()
