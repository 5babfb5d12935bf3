"""`emu inject`: run a fault injection campaign and classify the outcomes."""

from __future__ import annotations

import argparse
import csv
import json
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import asdict, astuple, fields
from multiprocessing import get_context
from pathlib import Path
from typing import Final, TextIO

from emu.commands.image_option import add_chip_option, image_of
from emu.host.command import CommandError, Parser, count
from emu.host.exit_status import DONE
from emu.host.files import atomic_text_file, read_file
from emu.host.installation import install_command
from emu.host.paths import use_cache
from emu.image.model import Image
from emu.inject.campaign import Campaign, CampaignError, read
from emu.inject.faults import KINDS
from emu.inject.report import lines, summary
from emu.inject.trial import OUTCOMES, Outcome, Trials
from emu.instruments.coverage import fingerprint

DESCRIPTION: Final = """\
Run firmware many times with one fault each, chosen at random from the campaign's seed, and classify the outcomes:
masked, detected, silent (wrong output without detection), hang or trap, each with its 95 % Wilson interval.

Faults: bit flips in RAM, W registers and flash; a skipped instruction; a lost byte for a UART; a stuck sensor; a
brown-out. Every trial starts from a checkpoint before its fault, and ends when its state equals that of the run without
faults. The same campaign gives the same bytes for any --jobs; with --state FILE an interrupted campaign continues.

A campaign file (TOML):

    seed = 1
    trials = 400
    [run]
    seconds = 1.0               also: start, selector, hang
    [detect]
    uart1 = ["assert", "trap"]  messages of the firmware about a detected fault
    [input]
    uart1 = [[0.2, "go\\r"]]
    [faults]                    weights
    ram = 4
    register = 2
    flash = 1                   also: skip, uart, sensor, brownout

Exit status: 0 done, 2 bad input. Needs the extra `arena` (scipy)."""


def parser() -> Parser:
    made = Parser(
        "inject", DESCRIPTION, "emu inject firmware.elf --campaign bits.toml --jobs 4 --state bits.state --out bits.csv"
    )
    made.add_argument("image", metavar="IMAGE", help="ELF executable")
    add_chip_option(made)
    made.add_argument("--campaign", metavar="FILE", required=True, type=Path, help="campaign file")
    made.add_argument("--jobs", metavar="N", type=_jobs, default=1, help="processes (default 1)")
    made.add_argument("--state", metavar="FILE", type=Path, help="store finished trials, and continue from them")
    made.add_argument("--out", metavar="FILE", help="write one line for every trial, CSV")
    made.add_argument("--only", metavar="N", type=count, help="run trial N alone and print it")
    made.add_argument("--json", action="store_true", help="print one JSON object")
    made.add_argument("--cache", type=use_cache, metavar="DIR", help="keep native code in DIR instead of the cache")
    return made


def _jobs(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 1024:
        raise argparse.ArgumentTypeError(f"expected a number of processes from 1 to 1024, not {text!r}")
    return int(text)


def run(options: argparse.Namespace) -> int:
    """Run the command. Return the exit status as listed in DESCRIPTION."""
    image = image_of(options)
    try:
        campaign = read(options.campaign)
    except CampaignError as error:
        raise CommandError(str(error)) from None
    try:
        import scipy.stats  # noqa: F401
    except ImportError:
        raise CommandError(f"intervals need scipy: {install_command('arena')}") from None
    if options.only is not None:
        if not 0 <= options.only < campaign.trials:
            raise CommandError(f"--only: the campaign has trials 0 to {campaign.trials - 1}")
        print(json.dumps(asdict(_trials(image, campaign).run(options.only)), indent=2))
        return DONE
    outcomes = _all_outcomes(image, campaign, options)
    if options.out:
        with atomic_text_file(options.out) as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow([one.name for one in fields(Outcome)])
            writer.writerows(astuple(outcome) for outcome in outcomes)
    found = summary(outcomes)
    if options.json:
        print(json.dumps({"image": fingerprint(image), "campaign": campaign.fingerprint, "kinds": found}, indent=2))
    else:
        print("\n".join(lines(found)))
    return DONE


def _all_outcomes(image: Image, campaign: Campaign, options: argparse.Namespace) -> list[Outcome]:
    """Return every trial's outcome, sorted by trial number. Trials in the state file are not run again."""
    header = {"image": fingerprint(image), "campaign": campaign.fingerprint}
    done = (
        _read_state(options.state, header, campaign.trials)
        if options.state is not None and options.state.exists()
        else {}
    )
    missing = [number for number in range(campaign.trials) if number not in done]
    with ExitStack() as stack:
        state: TextIO | None = None
        if options.state is not None:
            state = stack.enter_context(options.state.open("a", encoding="utf-8"))
            if state.tell() == 0:
                print(json.dumps(header), file=state, flush=True)
        for outcome in _run(options, campaign, missing):
            done[outcome.number] = outcome
            if state is not None:
                print(json.dumps(asdict(outcome)), file=state, flush=True)
            if len(done) % 100 == 0 and sys.stderr.isatty():
                print(f"\r{len(done)} of {campaign.trials}", end="", file=sys.stderr)
    return [done[number] for number in sorted(done)]


def _read_state(path: Path, header: dict[str, str], trials: int) -> dict[int, Outcome]:
    """Read a state file; an incomplete last line is removed."""
    try:
        text = read_file(path).decode()
    except UnicodeDecodeError as error:
        raise CommandError(f"{path}: offset {error.start}: expected a state file of emu inject") from None
    whole = text[: text.rfind("\n") + 1]
    found: dict[int, Outcome] = {}
    for number, line in enumerate(whole.splitlines(), 1):
        try:
            facts = json.loads(line)
            if number == 1:
                if facts != header:
                    raise CommandError(f"{path}:1: the state belongs to another image or campaign")
                continue
            outcome = Outcome(**facts)
            if any(type(getattr(outcome, one.name)).__name__ != one.type for one in fields(Outcome)):
                raise TypeError
            if outcome.kind not in KINDS or outcome.outcome not in OUTCOMES or not 0 <= outcome.number < trials:
                raise ValueError
        except (ValueError, TypeError, RecursionError):
            raise CommandError(f"{path}:{number}: expected a state file of emu inject") from None
        found[outcome.number] = outcome
    if whole != text:
        os.truncate(path, len(whole.encode()))
    return found


_PROCESS_TRIALS: list[Trials] = []
"""Trial runner of this worker process."""


def _trials(image: Image, campaign: Campaign) -> Trials:
    try:
        return Trials(image, campaign)
    except ValueError as error:
        raise CommandError(str(error)) from None


def _begin(options: argparse.Namespace, campaign: Campaign) -> None:
    _PROCESS_TRIALS[:] = [_trials(image_of(options), campaign)]


def _run_trial(number: int) -> Outcome:
    return _PROCESS_TRIALS[0].run(number)


def _run(options: argparse.Namespace, campaign: Campaign, numbers: list[int]) -> Iterator[Outcome]:
    if not numbers:
        return
    _begin(options, campaign)  # also with several jobs: this process then reports errors of the golden run
    if options.jobs == 1:
        yield from map(_run_trial, numbers)
        return
    image_options = argparse.Namespace(image=options.image, chip=options.chip)
    with get_context("spawn").Pool(options.jobs, _begin, (image_options, campaign)) as pool:
        yield from pool.imap_unordered(_run_trial, numbers, chunksize=4)
