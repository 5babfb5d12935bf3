"""Load Python files that a scene or a command names: experiments and controllers.

The code runs from the bytes whose hash is recorded. Cached byte code is not used, because no hash covers it.
"""

from __future__ import annotations

import hashlib
import importlib.util
import re
import sys
from functools import cache
from pathlib import Path
from types import ModuleType

from arena.scene.loader import SceneError


def read_user_file(path: Path, kind: str, digest: str | None = None) -> bytes:
    """Return the content of a user's file; `kind` names it in messages.

    Raises SceneError if there is no such file, or if its SHA-256 is not `digest`."""
    if not path.is_file():
        raise SceneError(f"{path}: no such {kind} file")
    source = path.read_bytes()
    if digest is not None and hashlib.sha256(source).hexdigest() != digest:
        raise SceneError(f"{path}: is not the recorded {kind}: its SHA-256 differs from {digest}")
    return source


@cache
def run_module(path: Path, source: bytes) -> ModuleType:
    """Run the content of a user's file and return its module. Raises SceneError with file and line if it fails."""
    name = re.sub(r"\W", "_", str(path))
    spec = importlib.util.spec_from_file_location(f"arena_file_{name}_{hashlib.sha256(source).hexdigest()[:8]}", path)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[module.__name__] = module  # dataclasses look up their module here
    try:
        exec(compile(source, str(path), "exec", dont_inherit=True), module.__dict__)
    except (Exception, SystemExit) as error:
        raise SceneError(f"{path}:{line_of(error, path)}: {type(error).__name__}: {error}") from None
    return module


def line_of(error: BaseException, path: Path) -> int:
    """Return the line of a user's file at which an error arose; 1 if it is unknown."""
    line, trace = getattr(error, "lineno", None), error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(path):
            line = trace.tb_lineno
        trace = trace.tb_next
    return line or 1
