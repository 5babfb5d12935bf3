"""`arena bundle FILE RUN...`: pack a study into one file. `arena verify FILE`: run its trials again and compare."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from arena.campaign import bundle
from arena.commands.options.arguments import count, removed_processes
from arena.commands.options.trust import add_trust_options
from arena.trial.strict_json import json_text
from emu.host.errors import CommandParser

DIFFERENT = 1


def parser() -> argparse.ArgumentParser:
    """Return the parser of the options of `bundle`."""
    command = CommandParser(
        description="pack runs with their firmware, experiments and manifests into one file, and print its hash",
        epilog="example: arena bundle study.zip results/openswarm-A results/bare-A",
    )
    command.add_argument("bundle", type=Path, metavar="FILE", help="zip archive to write")
    command.add_argument("--light", action="store_true", help="store hashes instead of records: can be verified only")
    command.add_argument("runs", nargs="+", type=Path, metavar="FOLDER", help="folder of a run")
    return command


def run(options: argparse.Namespace) -> int:
    """Write the bundle and print its size in MB and its SHA-256. Raises RecordError."""
    digest = bundle.pack(options.runs, options.bundle, options.light)
    size = options.bundle.stat().st_size / 1e6
    print(f"{options.bundle}: {size:.2f} MB, SHA-256 {digest}")
    return 0


def verify_parser() -> argparse.ArgumentParser:
    """Return the parser of the options of `verify`."""
    command = CommandParser(
        description="check the files of a bundle and run some of its trials again; exit status 1 if a result differs",
        epilog="example: arena verify study.zip --trials 1",
    )
    command.add_argument("bundle", type=Path, metavar="FILE", help="bundle to verify")
    command.add_argument(
        "--trials",
        type=count,
        default=1,
        metavar="N",
        help="run the first N trials of each run again (default 1)",
    )
    command.add_argument(
        "--number", type=count, action="append", metavar="N", help="run trial N of each run again; repeatable"
    )
    command.add_argument(
        "--beginning",
        action="store_true",
        help=f"run and compare only the first {bundle.BEGINNING_S:g} simulated seconds",
    )
    add_trust_options(command)
    command.add_argument("--strict", action="store_true", help="require equal bytes, and so equal versions")
    command.add_argument("--processes", type=removed_processes, help=argparse.SUPPRESS)
    command.add_argument("--json", action="store_true", help="print JSON")
    return command


def verify(options: argparse.Namespace) -> int:
    """Print the result of each repeated trial; exit status 1 if one differs.

    Raises RecordError, SceneError, and ValueError if the options select no trial."""

    def chosen(numbers: list[int]) -> list[int]:
        return [one for one in numbers if one in options.number] if options.number else numbers[: options.trials]

    status, checks = 0, []
    for one in bundle.verify(options.bundle, chosen, options.experiment, options.trust, options.beginning):
        good = one.equal and not (options.strict and one.versions)
        status = status if good else DIFFERENT
        checks.append(asdict(one))
        if not options.json:
            print(_result_line(one, options.beginning))
    if not checks:
        numbers = " or ".join(map(str, options.number))
        raise ValueError(f"{options.bundle}: verified nothing: no run has a trial {numbers}; choose another --number")
    if options.json:
        print(json_text({"equal": status == 0, "trials": checks}))
    else:
        print(f"{len(checks)} trials run again; all files match their hashes")
        if status and any(one["versions"] for one in checks):
            commits = ", ".join(sorted({one["commit"] for one in checks if one["versions"] and one["commit"]}))
            print("the bundle was made with other versions, which may compute other values: verify it with "
                  + (f"commit {commits}" if commits else "the versions that it names"))  # fmt: skip
    return status


def _result_line(one: bundle.Check, beginning: bool) -> str:
    place = f"{one.run}, trial {one.number}" + (f", first {bundle.BEGINNING_S:g} s" if beginning else "")
    if one.equal and not one.versions:
        return f"{place}: equal to the byte"
    other = f" ({'; '.join(one.versions)})" if one.versions else ""
    if one.equal:
        return f"{place}: all values equal, other versions{other}"
    return f"{place}: different in {', '.join(one.differs[:8]) or 'the metadata'}{other}"
