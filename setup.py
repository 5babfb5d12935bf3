"""Puts the kernel's sources into sdist and wheel: `firmware/` stays one folder beside the Python packages, and a wheel
gets its text files as `openswarm/firmware`. All else is in pyproject.toml and MANIFEST.in."""

from __future__ import annotations

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

ROOT = Path(__file__).resolve().parent
SUFFIXES = {".c", ".cpp", ".h", ".S", ".inc", ".ld", ".mk", ".md", ".json", ".py"}


def firmware_files() -> list[Path]:
    """Everything of `firmware/` that was written by people, in one order everywhere."""
    found = (path for path in (ROOT / "firmware").rglob("*") if path.suffix in SUFFIXES or path.name == "Makefile")
    return sorted(path for path in found if not {"build", "__pycache__"} & set(path.relative_to(ROOT).parts))


class WithFirmware(build_py):
    """Builds the Python packages, then copies the kernel into them; not for a checkout that is used in place."""

    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return
        for source in firmware_files():
            target = Path(self.build_lib) / "openswarm" / source.relative_to(ROOT)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)


class WithFirmwareToo(sdist):
    """The same files for the source distribution."""

    def make_release_tree(self, base_dir: str, files: list[str]) -> None:
        kernel = [str(source.relative_to(ROOT)) for source in firmware_files()]
        super().make_release_tree(base_dir, sorted({*files, *kernel}))


setup(cmdclass={"build_py": WithFirmware, "sdist": WithFirmwareToo})
