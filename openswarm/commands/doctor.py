"""`openswarm doctor`: lists installed and missing packages and programs, with the features that depend on them."""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Final

from emu.host import paths
from emu.host.exit_status import DONE, FAULT
from emu.host.installation import install_command
from openswarm.commands import made_parser

DESCRIPTION: Final = """\
List what is installed, what is missing and what that disables. With --try also compile a program and run it.

Exit status: 0 everything that every project needs is installed, 1 something is missing."""

EXTRAS: Final = {
    "arena": "`arena`: several robots in one world, experiments, figures",
    "film": "`arena replay --export FILE.mp4` where there is no ffmpeg",
    "cluster": "`arena run --scheduler`: trials on a Dask cluster",
    "learning": "`arena.env`: the PettingZoo interface",
    "test": "this project's own tests",
    "docs": "this project's documentation site",
}
"""Features that each optional extra of the package enables."""


@dataclass(frozen=True, slots=True)
class ExternalProgram:
    """An external program: its names, its Debian package, and the feature that needs it."""

    names: tuple[str, ...]
    package: str
    purpose: str
    is_needed: bool = False


PROGRAMS: Final = (
    ExternalProgram(("make",), "make", "building applications with the kernel", is_needed=True),
    ExternalProgram(("cmake",), "cmake", "projects built with CMake"),
    ExternalProgram(("gcc",), "gcc", "the kernel on this host: make TARGET=posix"),
    ExternalProgram(("avr-gcc",), "gcc-avr", "the kernel on a Kilobot: make PORT=avr (also avr-libc)"),
    ExternalProgram(
        ("arm-none-eabi-gcc",), "gcc-arm-none-eabi", "an e-puck2: PORT=cortex_m (also libnewlib-arm-none-eabi)"
    ),
    ExternalProgram(
        ("riscv64-unknown-elf-gcc",),
        "gcc-riscv64-unknown-elf",
        "a RISC-V: PORT=riscv (also picolibc-riscv64-unknown-elf)",
    ),
    ExternalProgram(("xc16-gcc",), "", "make TOOLCHAIN=xc16, Microchip's compiler; not in Debian"),
    ExternalProgram(("ffmpeg",), "ffmpeg", "films as MP4 without the extra `film`"),
    ExternalProgram(("chromium", "chromium-browser", "google-chrome"), "chromium", "tests of the pages people look at"),
    ExternalProgram(("gtkwave",), "gtkwave", "looking at waveforms of `emu run --vcd`"),
    ExternalProgram(("genhtml",), "lcov", "coverage as pages, from `emu coverage --lcov`"),
)


@dataclass(frozen=True, slots=True)
class Finding:
    """Result of one check; one or two lines of the report."""

    kind: str
    name: str
    found: str
    """Version or path; empty if the package or program is missing."""
    purpose: str
    remedy: str
    is_needed: bool


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    made = made_parser("doctor", DESCRIPTION, "openswarm doctor --json")
    made.add_argument("--try", dest="tries", action="store_true", help="compile and run a program (some seconds)")
    made.add_argument("--json", action="store_true", help="the findings as data")
    return made


def run(options: argparse.Namespace) -> int:
    """Print the findings; return the exit status."""
    findings = [*packages(), *programs(), cache()]
    if options.tries:
        findings.append(compile_and_run())
    is_whole = all(one.found for one in findings if one.is_needed)
    if options.json:
        about = {
            "openswarm": version("openswarm"),
            "python": platform.python_version(),
            "checkout": paths.in_checkout(),
            "firmware": str(paths.firmware()),
            "complete": is_whole,
        }
        print(json.dumps(about | {"findings": [asdict(one) for one in findings]}, indent=1))
    else:
        where = "a checkout" if paths.in_checkout() else "an installed package"
        print(f"openswarm {version('openswarm')} from {where}, Python {platform.python_version()}")
        for one in findings:
            print(formatted(one))
    return DONE if is_whole else FAULT


def formatted(one: Finding) -> str:
    """Return a finding as one or two lines of text."""
    if one.found:
        return f"  ok       {one.name:18} {one.found}"
    lost = f"needed for {one.purpose}" if one.is_needed else f"not without it: {one.purpose}"
    remedy = f"\n{'':30}{one.remedy}" if one.remedy else ""
    return f"  {'MISSING' if one.is_needed else 'absent':8} {one.name:18} {lost}{remedy}"


def packages() -> Iterator[Finding]:
    """Yield a finding for each required Python package and for each extra as a whole."""
    wanted: dict[str, list[str]] = {}
    for line in requires("openswarm") or ():
        name = re.match(r"[\w.-]+", line)
        extra = re.search(r"extra *== *[\"'](\w+)", line)
        if name:
            wanted.setdefault(extra[1] if extra else "", []).append(name[0])
    for one in wanted.pop("", []):
        yield Finding("package", one, _version(one), "everything", f"pip install {one}", True)
    yield Finding("package", "pytest", _version("pytest"), "`make test` in a project", "pip install pytest", False)
    for group, names in wanted.items():
        lacking = [one for one in names if not _version(one)]
        found = "" if lacking else ", ".join(f"{one} {_version(one)}" for one in names)
        remedy = f"lacks {', '.join(lacking)}: {install_command(group)}"
        yield Finding("extra", f"[{group}]", found, EXTRAS.get(group, group), remedy, False)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def programs() -> Iterator[Finding]:
    """Yield a finding for each external program."""
    for one in PROGRAMS:
        found = next((place for name in one.names if (place := shutil.which(name))), "")
        remedy = f"Debian package {one.package}" if one.package else ""
        yield Finding("program", one.names[0], found, one.purpose, remedy, one.is_needed)


def cache() -> Finding:
    """Return a finding: whether the cache is writable. Without a cache all features work, but more slowly."""
    folder = paths.cache()
    there = next(one for one in (folder, *folder.parents) if one.exists())
    is_open = there.is_dir() and os.access(there, os.W_OK | os.X_OK)
    return Finding("cache", "cache", str(folder) if is_open else "", f"keeping compiled code in {folder}",
                   "set OPENSWARM_CACHE to a folder that can be written", False)  # fmt: skip


def compile_and_run() -> Finding:
    """Compile, link and run one program; return a finding: whether that works."""
    with tempfile.TemporaryDirectory(prefix="openswarm-doctor-") as name:
        source, image = Path(name) / "main.c", Path(name) / "main.elf"
        source.write_text('#include <stdio.h>\nint main(void) { printf("%d", 6 * 7); return 3; }\n')
        steps = (["toolchain", "cc", "-Os", str(source), "-o", str(image)], ["emu", "run", str(image), "--exit-code"])
        for module, *words in steps:
            done = subprocess.run([sys.executable, "-m", module, *words], capture_output=True, text=True, check=False)
        works = done.returncode == 3 and done.stdout == "42"
        said = "" if works else (done.stderr.strip().splitlines() or ["no message"])[-1]
    return Finding("trial", "compile and run", "works" if works else "", "everything", said, True)
