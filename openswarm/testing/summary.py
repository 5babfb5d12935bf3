"""Markdown table of a JUnit file, for the summary of a CI job: `python -m openswarm.testing.summary results.xml`.

Failed tests are listed with the report of the pytest plugin on their robot. The exit status is 0, or 2 if the file is
no JUnit file.
"""

from __future__ import annotations

import sys
from pathlib import Path
from xml.etree import ElementTree

CLOCK_HZ = 14_745_600
"""Cycles (Tcy) per second of an e-puck (dspic30f6014a.md §3)."""


def table(root: ElementTree.Element) -> list[str]:
    """Return the lines of the Markdown table of a JUnit file."""
    lines = ["| test | result | simulated |", "|---|---|---|"]
    failures = []
    for case in root.iter("testcase"):
        name = f"{case.get('classname')}::{case.get('name')}"
        failure = case.find("failure") if case.find("failure") is not None else case.find("error")
        result = "failed" if failure is not None else "skipped" if case.find("skipped") is not None else "passed"
        properties = {one.get("name"): one.get("value", "") for one in case.iter("property")}
        cycles = properties.get("robot_cycles")
        lines.append(f"| {name} | {result} | {f'{int(cycles) / CLOCK_HZ:.3f} s' if cycles else ''} |")
        if failure is not None:
            report = Path(properties.get("robot_artefacts", "")) / "report.txt"
            text = report.read_text(encoding="utf-8").rstrip() if report.is_file() else failure.get("message", "")
            failures += ["", f"**{name}**", "", "```", text, "```"]
            folder = properties.get("robot_artefacts")
            failures += [f"Reports and waveform: `{folder}`"] if folder else []
    return lines + failures


def main(arguments: list[str]) -> int:
    """Run the command line; return the exit status of the module's docstring."""
    try:
        (name,) = arguments
        root = ElementTree.parse(name).getroot()
    except (ValueError, OSError, ElementTree.ParseError) as error:
        print(f"summary: expected a JUnit file: {error}", file=sys.stderr)
        return 2
    print("\n".join(table(root)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
