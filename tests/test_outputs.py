"""What is no regular file is opened and written, never replaced by one: /dev/null stays what it is, also for root."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from arena.record import write_bytes
from emu.boards.picture import write_picture
from emu.outfile import is_opened, whole_file, whole_text_file
from toolchain.files import write_outputs


def text(path: Path) -> None:
    with whole_text_file(path) as stream:
        stream.write("text")


def part_of(path: Path) -> None:
    with whole_file(path) as part:
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


def test_names_of_open_files_are_opened(tmp_path: Path) -> None:
    """/dev/stdout leads to a regular file when standard output does; a symbolic link of one's own is one's own."""
    plain, link = tmp_path / "plain", tmp_path / "link"
    with plain.open("w") as stream:
        assert is_opened(f"/proc/self/fd/{stream.fileno()}") == Path("/proc/self/fd").exists()
    link.symlink_to(plain)
    assert [is_opened(path) for path in (plain, link, tmp_path / "absent", os.devnull)] == [False, False, False, True]
