"""`openswarm clean`: empties the cache. It removes only files that this project's tools have written."""

from __future__ import annotations

import argparse
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from emu.host import paths
from emu.host.exit_status import DONE
from openswarm.commands import made_parser

KINDS: Final = {
    "native code": paths.native_code,
    "run-time libraries": paths.runtime_libraries,
    "images": paths.images,
}
DESCRIPTION: Final = """\
Empty the cache: native code that the emulator has compiled, the C library, images that `arena` has built.
The tools rebuild each file on demand. The cache is $OPENSWARM_CACHE, else `openswarm` in the user's cache folder
($XDG_CACHE_HOME or ~/.cache); other files in that folder stay.

Exit status: 0 done, 2 a file could not be removed."""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    made = made_parser("clean", DESCRIPTION, "openswarm clean --dry-run")
    made.add_argument("--cache", type=Path, metavar="DIR", help="empty this cache instead")
    made.add_argument("--dry-run", action="store_true", help="only report what would be removed")
    made.add_argument("--json", action="store_true", help="files and bytes by kind, for scripts")
    return made


def run(options: argparse.Namespace) -> int:
    """Empty the cache; return the exit status. Raises OSError for a file that cannot be removed."""
    root: Path = options.cache if options.cache is not None else paths.cache()
    counts_by_kind = {}
    for kind, where in KINDS.items():
        folder = root / where().name
        sizes = [path.lstat().st_size for path in _files(folder)]
        counts_by_kind[kind] = {"files": len(sizes), "bytes": sum(sizes)}
        if folder.is_dir() and not options.dry_run:
            shutil.rmtree(folder)
    if options.json:
        print(json.dumps({"cache": str(root), "removed": not options.dry_run, "kinds": counts_by_kind}, indent=1))
    else:
        for kind, counts in counts_by_kind.items():
            print(f"{kind:20}{counts['files']:8,} files{counts['bytes'] / 1e6:10.1f} MB")
        print(f"{'would be removed from' if options.dry_run else 'removed from'} {root}")
    return DONE


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
