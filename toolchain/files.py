"""Input and output files; a tool that fails leaves no incomplete output file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from emu.host.files import is_opened, is_standard, read_file, replace_file, temporary_beside, write_standard
from toolchain.errors import ToolError


def read_bytes(path: str | Path) -> bytes:
    """Return the content of `path`; raise `ToolError` naming the file and the reason."""
    try:
        return read_file(path)
    except OSError as error:
        raise ToolError(f"cannot read {path}: {error.strerror or error}") from None


def read_text(path: str | Path) -> str:
    """Return `path` as text; a file that is not UTF-8 is read as Latin-1, the encoding of old sources."""
    data = read_bytes(path)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def write_outputs(outputs: Iterable[tuple[str | Path, bytes]]) -> None:
    """Write all files or none: write temporaries beside the targets, then rename them.

    Standard output, devices and pipes are written directly, after the files. Raises `ToolError` if a target cannot be
    written; temporaries are removed in every case.
    """
    pending: list[tuple[Path, str | Path]] = []
    opened: list[tuple[str | Path, bytes]] = []
    target: str | Path = "output"
    try:
        for target, data in outputs:
            if is_standard(target) or is_opened(target):
                opened.append((target, data))
                continue
            part = temporary_beside(target)
            pending.append((part, target))
            part.write_bytes(data)
        for part, target in pending:
            replace_file(part, target)
        for target, data in opened:
            if is_standard(target):
                write_standard(data)
            else:
                Path(target).write_bytes(data)
    except OSError as error:
        raise ToolError(f"cannot write {target}: {error.strerror or error}") from None
    finally:
        for part, _ in pending:
            part.unlink(missing_ok=True)
