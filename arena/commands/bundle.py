"""`arena bundle FILE RUN...`: a study as one file; `arena verify FILE`: computes its trials again and compares."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from arena.campaign import bundle
from arena.commands.arguments import count, count_or_none
from arena.trial.json_numbers import json_text

DIFFERENT = 1


def parser() -> argparse.ArgumentParser:
    """Options of `bundle`."""
    made = argparse.ArgumentParser(
        description="put runs with everything they were made from into one file, and print its hash",
        epilog="example: arena bundle study.zip results/openswarm-A results/bare-A",
    )
    made.add_argument("bundle", type=Path, metavar="FILE")
    made.add_argument("--light", action="store_true", help="hashes instead of records: verify works, replay does not")
    made.add_argument("runs", nargs="+", type=Path, metavar="FOLDER")
    return made


def run(options: argparse.Namespace) -> int:
    """Write the file. Raises RecordError."""
    digest = bundle.pack(options.runs, options.bundle, options.light)
    size = options.bundle.stat().st_size / 1e6
    print(f"{options.bundle}: {size:.2f} MB, SHA-256 {digest}")
    return 0


def verify_parser() -> argparse.ArgumentParser:
    """Options of `verify`."""
    made = argparse.ArgumentParser(
        description="check a bundle's files and compute some of its trials again; exit status 1 if one differs",
        epilog="example: arena verify study.zip --trials 1",
    )
    made.add_argument("bundle", type=Path, metavar="FILE")
    made.add_argument(
        "--trials", type=count_or_none, default=1, metavar="N", help="of each run, the first N (default 1)"
    )
    made.add_argument("--number", type=count, action="append", metavar="N", help="this trial of each run that has it")
    made.add_argument("--strict", action="store_true", help="versions must be the same too: equal to the byte")
    made.add_argument("--processes", type=count, default=1, metavar="N", help="as for `arena run` (default 1)")
    made.add_argument("--json", action="store_true")
    return made


def verify(options: argparse.Namespace) -> int:
    """0 if every trial is equal. Raises RecordError, SceneError."""

    def chosen(numbers: list[int]) -> list[int]:
        return [one for one in numbers if one in options.number] if options.number else numbers[: options.trials]

    status, checks = 0, []
    for one in bundle.verify(options.bundle, chosen, options.processes):
        good = one.equal and not (options.strict and one.versions)
        status = status if good else DIFFERENT
        checks.append(asdict(one))
        if not options.json:
            print(_said(one))
    if options.json:
        print(json_text({"equal": status == 0, "trials": checks}))
    else:
        print(f"{len(checks)} trials computed again, all files as their hashes say")
    return status


def _said(one: bundle.Check) -> str:
    place = f"{one.run}, trial {one.number}"
    if one.equal and not one.versions:
        return f"{place}: equal to the byte"
    other = f" ({'; '.join(one.versions)})" if one.versions else ""
    if one.equal:
        return f"{place}: all values equal, other versions{other}"
    return f"{place}: different in {', '.join(one.differs[:8]) or 'the metadata'}{other}"
