"""Log of the inputs that campaigns over files have run, by kind of file: it is resumed, merged and shown as a table.

Input: one line of JSON per `Block` of consecutive seeds. A killed process loses at most the block that it ran. Logs of
several hosts begin at different seeds and are merged: `python -m tests.fuzz.input_log LOG...` merges them into
`tests/fuzz/inputs.jsonl`, which is in the repository, and writes its table, `tests/fuzz/inputs.md`. Blocks with a
failed input are not stored: the next run repeats them.
"""

from __future__ import annotations

import fcntl
import json
import os
import sys
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

BLOCK = 250
"""Inputs of a block."""
AIM = 100_000
"""Inputs of each kind that the project aims at."""
FAILED = "FAILED"
"""Outcome of an input that ended otherwise than with a documented status."""
HERE = Path(__file__).parent
STORED = HERE / "inputs.jsonl"
TABLE = HERE / "inputs.md"


class InputLogError(Exception):
    """A log cannot be used: it is damaged, another process writes it, or two logs have run some of the same seeds."""


@dataclass(frozen=True)
class Block:
    """Inputs of a kind: those of `count` seeds from `first`, the number of each outcome, and the commits that ran
    them."""

    kind: str
    first: int
    count: int
    outcomes: dict[str, int]
    commits: list[str]

    @property
    def end(self) -> int:
        """Return the first seed after the block."""
        return self.first + self.count


def read_blocks(path: Path) -> list[Block]:
    """Return the blocks of a log, none without a file. Raises InputLogError.

    An incomplete last line, of a killed process, is no block.
    """
    blocks = []
    lines = path.read_bytes().splitlines(keepends=True) if path.exists() else []
    for number, line in enumerate(lines, start=1):
        if not line.endswith(b"\n"):
            break
        try:
            block = Block(**json.loads(line))
        except (ValueError, TypeError):
            raise InputLogError(f"{path}:{number}: is no block of inputs") from None
        if sum(block.outcomes.values()) != block.count:
            raise InputLogError(f"{path}:{number}: {block.count} inputs with {sum(block.outcomes.values())} outcomes")
        blocks.append(block)
    return blocks


def passed(blocks: Iterable[Block]) -> list[Block]:
    """Return the blocks without a failed input. The others run again, as soon as the defect is fixed."""
    return [block for block in blocks if FAILED not in block.outcomes]


def merged(blocks: Iterable[Block]) -> list[Block]:
    """Return the blocks by kind and seed, with adjacent ones as one; a block inside another is omitted.

    Raises InputLogError for blocks that overlap: the outcomes of seeds in both would count twice.
    """
    found: list[Block] = []
    for block in sorted(blocks, key=lambda one: (one.kind, one.first, -one.count)):
        last = found[-1] if found and found[-1].kind == block.kind else None
        if last is not None and block.end <= last.end:
            continue
        if last is not None and block.first < last.end:
            raise InputLogError(f"{block.kind}: seeds {block.first} to {last.end - 1} occur twice; use another --seed")
        if last is None or block.first > last.end:
            found.append(block)
            continue
        found[-1] = Block(block.kind, last.first, last.count + block.count,
                          dict(sorted((Counter(last.outcomes) + Counter(block.outcomes)).items())),
                          sorted({*last.commits, *block.commits}))  # fmt: skip
    return found


class InputLog:
    """Log that this process extends. The process that has opened it is its only writer."""

    def __init__(self, path: Path, before: Iterable[Block] = ()) -> None:
        """Open a log; inputs of `before` are not run again. Raises InputLogError, OSError."""
        self._file = path.open("ab")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise InputLogError(f"{path}: another process writes it; use another file and another --seed") from None
        own = read_blocks(path)
        os.ftruncate(self._file.fileno(), sum(len(_line(block)) for block in own))  # an incomplete line is removed
        self.blocks = merged(passed([*own, *before]))

    def count(self, kind: str) -> int:
        """Return the number of inputs of a kind."""
        return sum(block.count for block in self.blocks if block.kind == kind)

    def next_seed(self, kind: str, first: int) -> int:
        """Return the first seed from `first` of which no input has run."""
        for block in self.blocks:
            if block.kind == kind and block.first <= first < block.end:
                first = block.end
        return first

    def add(self, block: Block) -> None:
        """Append a block."""
        self._file.write(_line(block))
        self._file.flush()
        self.blocks = merged([*self.blocks, block])

    def close(self) -> None:
        """Close the file, which another process can then extend."""
        self._file.close()


def _line(block: Block) -> bytes:
    return json.dumps(asdict(block)).encode() + b"\n"


def table(blocks: Iterable[Block], names: Iterable[str]) -> str:
    """Return the page `inputs.md`: inputs and outcomes of each kind in `names`."""
    rows = []
    totals: Counter[str] = Counter()
    for name in names:
        outcomes: Counter[str] = Counter()
        for block in blocks:
            if block.kind == name:
                outcomes.update(block.outcomes)
        totals.update(outcomes)
        rows.append(_row(name, outcomes))
    return "\n".join([*_HEAD, *rows, _row("all", totals), ""])


_HEAD = (
    "# Inputs of each kind of file",
    "",
    "For reviewers: how many damaged files each command has read, and how it ended. `python -m tests.fuzz.input_log`",
    "writes this page from `inputs.jsonl`; [README.md](README.md) says how a run is resumed.",
    f"The aim is {AIM:,} inputs of each kind.",
    "",
    "Done: exit status 0. Refused: one line and status 2. Other: another documented status, a debug session that was",
    "answered, or damage that the format cannot hold. Inputs with any other end are in no stored block: each became a",
    "test, and its block ran again.",
    "",
    "| kind | inputs | done | refused | other |",
    "|---|---:|---:|---:|---:|",
)


def _row(name: str, outcomes: Counter[str]) -> str:
    known = [outcomes["done"], outcomes["refused"]]
    numbers = [outcomes.total(), *known, outcomes.total() - sum(known)]
    return f"| {name} | {' | '.join(f'{number:,}' for number in numbers)} |"


def main() -> int:
    from tests.fuzz.file_formats import NAMES

    try:
        blocks = merged(passed(block for path in (STORED, *map(Path, sys.argv[1:])) for block in read_blocks(path)))
    except InputLogError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    STORED.write_bytes(b"".join(map(_line, blocks)))
    TABLE.write_text(table(blocks, NAMES))
    return 0


if __name__ == "__main__":
    sys.exit(main())
