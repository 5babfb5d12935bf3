"""Run the commands of docs/first-steps.md with the installed wheel, in an empty folder and HOME.

`python docs/tools/first_steps.py` replaces the output of each command on the page. With `--check` the page is not
written; the exit status is 1, with a diff, if the output differs in more than what depends on the computer. `--keep
FOLDER` runs the commands in FOLDER and keeps it.

The wheel is installed in a virtual environment that shares only the dependencies with the current one, so nothing is
downloaded. Files that a command writes outside its working folder and the cache are an error.
"""

from __future__ import annotations

import argparse
import difflib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "first-steps.md"
SPEED = re.compile(r"[\d.e-]+(?= x real time)|(?<=passed in )[\d.]+s.*")
"""Duration and speed of a run, which depend on the computer."""
EPOCH = "1767225600"
"""2026-01-01 as Unix time: the date of all files in a wheel, which makes its bytes independent of the time of the
build."""


def build_wheel(folder: Path) -> Path:
    """Return a wheel that is built from an sdist of the tracked files, outside the checkout."""
    source = folder / "source"
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, source / name)
    words = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(source)]
    done = subprocess.run(
        words, env=os.environ | {"SOURCE_DATE_EPOCH": EPOCH}, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(done.stdout + done.stderr)
    return next(folder.glob("*.whl"))


def install_wheel(wheel: Path, folder: Path) -> dict[str, str]:
    """Install the wheel in a new virtual environment and return the environment variables of a shell that uses it."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    python = folder / "bin" / "python"
    # PYTHONPATH may contain this checkout.
    alone = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    subprocess.run([sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index",
                    "--no-compile", "--disable-pip-version-check", wheel], check=True, env=alone)  # fmt: skip
    packages = next((folder / "lib").glob("python*")) / "site-packages"
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    home = folder.parent / "home"
    home.mkdir()
    return {
        "HOME": str(home),
        "PATH": f"{folder / 'bin'}:/usr/bin:/bin",
        # The commands share compiled modules, which are not written beside the installed files.
        "PYTHONPYCACHEPREFIX": os.environ.get("PYTHONPYCACHEPREFIX", str(folder.parent / "compiled")),
        "LANG": "C.UTF-8",
    }


def run_sessions(text: str, where: Path, environment: dict[str, str]) -> str:
    """Run the commands of a page and return the page with their current output. Raises SystemExit if a command
    fails."""

    def session(found: re.Match[str]) -> str:
        nonlocal where
        lines = []
        for command in (line[2:] for line in found[1].splitlines() if line.startswith("$ ")):
            lines.append(f"$ {command}")
            if command.startswith("cd "):
                where /= command[3:]
                continue
            done = subprocess.run(
                ["bash", "-c", command], cwd=where, env=environment, stdin=subprocess.DEVNULL, text=True,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
            )  # fmt: skip
            if done.returncode:
                sys.exit(f"{command}: status {done.returncode}\n{done.stdout}")
            said = done.stdout
            for place in (f"{where}/", f"{folder_of(environment)}/"):
                said = said.replace(place, "")
            lines += [line.rstrip() for line in said.splitlines()]
        return "\n".join(lines) + "\n"

    return re.sub(r"(?<=```\n)(\$ .*?)(?=```)", session, text, flags=re.DOTALL)


def folder_of(environment: dict[str, str]) -> str:
    """Return the folder of the environment's programs."""
    return environment["PATH"].partition(":")[0]


def listing(folder: Path) -> set[str]:
    """Return the relative paths of all files below a folder."""
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--check", action="store_true")
    options.add_argument("--keep", type=Path, metavar="FOLDER")
    options.add_argument("--wheel", type=Path, metavar="FILE", help="wheel to install (default: build it)")
    options.add_argument("--cache", type=Path, metavar="FOLDER", help="cache (default: a new one in HOME)")
    wanted = options.parse_args()
    with tempfile.TemporaryDirectory(prefix="newcomer-") as scratch:
        folder = (wanted.keep or Path(scratch)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        environment = install_wheel(wanted.wheel or build_wheel(folder), folder / "venv")
        if wanted.cache is not None:
            environment["OPENSWARM_CACHE"] = str(wanted.cache)
        before = listing(folder / "venv")
        (folder / "work").mkdir()
        old = PAGE.read_text(encoding="utf-8")
        new = run_sessions(old, folder / "work", environment)
        strange = listing(folder / "venv") - before
        strange |= {
            name for name in listing(folder / "home") if not name.startswith((".cache/openswarm/", ".cache/matplotlib"))
        }
    if strange:
        sys.exit(f"written where nothing belongs: {sorted(strange)}")
    if not wanted.check:
        PAGE.write_text(new, encoding="utf-8")
        return 0
    lines = [SPEED.sub("", text).splitlines() for text in (old, new)]
    difference = list(difflib.unified_diff(*lines, "docs/first-steps.md", "now", lineterm="", n=1))
    for line in difference:
        print(line)
    return 1 if difference else 0


if __name__ == "__main__":
    sys.exit(main())
