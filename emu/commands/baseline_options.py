"""The options --check, --update, --json and --markdown of commands that measure exact numbers."""

from __future__ import annotations

import argparse
import json
import shlex
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any, Final

from emu.host.command import CommandError
from emu.host.exit_status import DONE, FAULT
from emu.kernel_metrics import baseline
from emu.kernel_metrics.baseline import Baseline, Metric, MetricRow
from emu.kernel_metrics.check_report import CheckReport

CONDITIONS: Final = ("seconds", "board", "crystal", "selector", "camera", "sensor", "stimulus", "function", "interval")
"""Options that change the measured numbers. A baseline stores those that differ from their default."""

Blame = Callable[[MetricRow, Baseline], list[tuple[str, int]]]
"""blame(row, baseline) returns (source line, amount) of a row that failed."""


def add_baseline_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --check FILE, --update FILE, --json and --markdown."""
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--check", metavar="FILE", help="compare with a baseline; status 1 if a number is worse")
    group.add_argument("--update", metavar="FILE", help="write the baseline; limits in the file stay")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="print one JSON object")
    form.add_argument(
        "--markdown", action="store_true", help="with --check: print a table in Markdown, for a CI summary"
    )


def conditions_of(options: argparse.Namespace, parser: argparse.ArgumentParser) -> dict[str, str]:
    """Return the options of a measurement that differ from their defaults, as text."""
    found = {}
    for name in CONDITIONS:
        value = getattr(options, name, None)
        if value not in (None, [], parser.get_default(name)) or (name == "seconds" and value is not None):
            found[name] = " ".join(value) if isinstance(value, list) else _decimal(value)
    return found


def _decimal(value: object) -> str:
    """Return a value as text; a fraction as a decimal number if that is exact."""
    text = f"{float(value):.12g}" if isinstance(value, Fraction) else str(value)
    return text if not isinstance(value, Fraction) or Fraction(text) == value else str(value)


class BaselineCommand:
    """One run of a command that measures numbers: it updates or checks a baseline and prints the result."""

    def __init__(
        self, command: str, options: argparse.Namespace, conditions: Mapping[str, str], flags: str = ""
    ) -> None:
        self._command: Final = f"emu {command}"
        self._options: Final = options
        self._conditions: Final = conditions
        self._flags: Final = flags
        if options.markdown and not options.check:
            raise CommandError("--markdown needs --check FILE")
        self._stored: Final = self._load() if options.check else self._limits() if options.update else None

    def _load(self) -> Baseline:
        """Read the baseline of --check before the measurement. Raises CommandError."""
        try:
            stored = baseline.load(self._options.check)
        except ValueError as error:
            raise CommandError(str(error)) from None
        path = self._options.check
        if stored.command != self._command + self._flags:
            raise CommandError(
                f"{path}: command: it was written by `{stored.command}`, not by `{self._command}{self._flags}`"
            )
        for name in sorted(stored.conditions.keys() | self._conditions.keys()):
            old, new = stored.conditions.get(name), self._conditions.get(name)
            if old != new:
                raise CommandError(
                    f"{path}: conditions.{name}: measured with {_option(name, old)}, this run has {_option(name, new)}:"
                    " give the same options"
                )
        return stored

    def _limits(self) -> Baseline | None:
        """Return the present content of the file of --update, whose limits stay; None if there is none."""
        try:
            return baseline.load(self._options.update)
        except (ValueError, OSError):
            return None

    def finish(
        self,
        numbers: Mapping[str, Metric],
        facts: dict[str, Any],
        text: Callable[[], str],
        blame: Blame,
        code: Mapping[str, tuple[str, ...]],
    ) -> int:
        """Write, compare and print. Return 1 if a row of the check failed, else 0."""
        options = self._options
        if options.update:
            kept = self._stored.rows if self._stored is not None else {}
            made = Baseline(self._command + self._flags, self._conditions, kept, code)
            baseline.save(options.update, made, numbers)
        if not options.check or self._stored is None:
            print(json.dumps(facts, indent=2) if options.json else text())
            return DONE
        rows = baseline.compare(self._stored.rows, numbers)
        found = {row.name: blame(row, self._stored) for row in rows if row.fails and row.new is not None}
        report = CheckReport(self._command + self._flags, options.check, rows, found, self._accept())
        if options.json:
            print(json.dumps(facts | {"check": report.facts()}, indent=2))
        else:
            print(report.markdown() if options.markdown else report.text())
        return FAULT if report.fails else DONE

    def _accept(self) -> str:
        words = [*self._command.split(), self._options.image, *self._flags.split()]
        for name, value in self._conditions.items():
            for one in value.split(" ") if name in ("function", "interval") else [value]:
                words += [f"--{name}", one]
        return shlex.join([*words, "--update", self._options.check])


def _option(name: str, value: str | None) -> str:
    return f"--{name} {value}" if value is not None else f"no --{name}"
