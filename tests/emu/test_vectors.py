"""Recorded vectors: single instructions and short programs, whose result is compared with the recorded one word by
word.

``pytest tests/emu --vectors DIR`` runs another folder of the same format, ``--engine NAME`` one engine only. Formats:
``tests/vectors/README.md``. The engine "rows" is the instruction table alone, on the builder of rowmachine.py.
"""

from __future__ import annotations

import csv
import gzip
import json
import lzma
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from emu.dspic30f.isa import codec, text
from tests.emu.engines import ENGINES, Engine

RAM_START = 0x0800
NATIVE_STRIDE = 499
PARTS = 2  # tests per engine, which pytest-xdist can run in parallel
STEP_LIMIT = 100_000  # number of instructions after which a program that has not reached its end fails
CALL_WN_ROWS = {159: "goto", 161: "rcall"}  # known defect of the disassembler that wrote the vectors


RECORDED = Path(__file__).resolve().parents[1] / "vectors"
SEMANTIC_VECTORS, ENCODINGS, ASSEMBLED = 51_730, 8_298, 5_967  # for tests/vectors; other sets have other numbers
OPENERS = {".xz": lzma.open, ".gz": gzip.open}


def semantic_lines(folder: Path) -> Iterator[str]:
    """Yield the lines of all files of semantic vectors, one vector each."""
    for file in sorted(folder.glob("semantics*.jsonl.*")):
        with OPENERS[file.suffix](file, "rt") as lines:
            yield from lines


def differences(engine: Engine, vector: dict[str, Any]) -> list[str]:
    """Run one vector and return the differences from its recorded result."""
    before, after = vector["in"], vector["out"]
    engine.prepare(vector)
    ram = bytearray(engine.ram())
    engine.step()
    steps = 1
    while "until" in vector and engine.pc != vector["until"] and steps < STEP_LIMIT:
        engine.step()
        steps += 1
    for address, value in after.get("mem", {}).items():
        offset = int(address, 16) - RAM_START
        ram[offset : offset + 2] = value.to_bytes(2, "little")
    found = []

    def compare(name: str, got: int, expected: int, mask: int = -1) -> None:
        if (got ^ expected) & mask:
            found.append(f"{name} {got:#x}, expected {expected:#x}")

    compare("PC", engine.pc, after["pc"])
    for n in range(16):
        compare(f"W{n}", engine.w(n), after.get("W", {}).get(str(n), before["W"][n]))
    compare("SR", engine.register("SR"), after.get("SR", before["SR"]), vector.get("srmask", 0xFFFF))
    compare("CORCON", engine.register("CORCON"), after.get("CORCON", before["CORCON"]))
    for name in ("ACCA", "ACCB"):
        compare(name, engine.accumulator(name), after.get(name, before.get(name, 0)))
    if engine.ram() != ram:
        found += [f"RAM {a + RAM_START:#06x}" for a, (x, y) in enumerate(zip(engine.ram(), ram, strict=True)) if x != y]
    return found


@pytest.fixture(params=sorted(ENGINES))
def engine(request: pytest.FixtureRequest) -> Engine:
    chosen = request.config.getoption("--engine", default=None)
    if chosen and chosen not in ENGINES:
        pytest.fail(f"--engine {chosen}: there are {', '.join(sorted(ENGINES))}")
    if chosen and chosen != request.param:
        pytest.skip(f"--engine {chosen} was asked for")
    return ENGINES[request.param]()


def report(capsys: pytest.CaptureFixture[str], message: str) -> None:
    with capsys.disabled():
        print(f"\n{message}")


def test_the_recorded_set_is_complete() -> None:
    """tests/vectors/README.md: the recorded set has the stated numbers of vectors and of encodings."""
    assert sum(1 for _ in semantic_lines(RECORDED)) == SEMANTIC_VECTORS
    rows = encodings(RECORDED)
    assert (len(rows), sum(row["assembles"] == "yes" for row in rows)) == (ENCODINGS, ASSEMBLED)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_every_semantic_vector_gives_its_recorded_state(
    engine: Engine, part: int, vectors: Path, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    """Vectors README; isa.md §6-§8: every semantic vector gives its recorded state. Each part takes one vector in
    PARTS and prints the count.

    The JIT engine compiles every vector, so it runs one in NATIVE_STRIDE; ``--engine jit`` runs all of them.
    """
    stride = NATIVE_STRIDE if engine.name == "jit" and not request.config.getoption("--engine", default=None) else 1
    count, failed = 0, []
    for line in islice(semantic_lines(vectors), part * stride, None, PARTS * stride):
        vector = json.loads(line)
        count += 1
        if found := differences(engine, vector):
            failed.append(f"{vector['t']} ({vector['f']}): {'; '.join(found)}")
    passed = f"{count - len(failed)} of {count} semantic vectors pass"
    report(capsys, f"{passed}, engine {engine.name}, part {part + 1} of {PARTS}")
    assert count or part, f"no semantics*.jsonl.xz in {vectors}"
    assert not failed, f"{len(failed)} of {count} differ:\n" + "\n".join(failed[:20])


def encodings(folder: Path) -> list[dict[str, str]]:
    with open(folder / "encodings.csv", newline="") as lines:
        return list(csv.DictReader(lines))


def words_of(row: dict[str, str]) -> tuple[int, ...]:
    return tuple(int(row[word], 16) for word in ("word1", "word2") if row[word])


def failures(rows: list[dict[str, str]], check: Callable[[dict[str, str]], str | None]) -> list[str]:
    return [problem for row in rows if (problem := check(row)) is not None]


def test_every_encoding_decodes_to_its_recorded_text(vectors: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Vectors README: every row of encodings.csv decodes to its recorded text."""

    def check(row: dict[str, str]) -> str | None:
        words = words_of(row)
        insn = codec.decode_loosely(*words)
        if insn is None:
            return f"{row['word1']}: no instruction, expected {row['text']}"
        expected = row["text"]
        if insn.row.id in CALL_WN_ROWS:
            expected = expected.replace("call", CALL_WN_ROWS[insn.row.id])
        got = text.format(insn, int(row["at"], 16))
        return None if got == expected else f"{row['word1']}: {got}, expected {expected}"

    rows = encodings(vectors)
    failed = failures(rows, check)
    report(capsys, f"{len(rows) - len(failed)} of {len(rows)} encodings decode to their text")
    assert rows
    assert not failed, "\n".join(failed[:20])


def test_every_encoding_marked_yes_assembles_to_its_words(vectors: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Vectors README: every row of encodings.csv with "yes" in the column assembles is assembled to its words."""

    def check(row: dict[str, str]) -> str | None:
        try:
            got = text.parse(row["text"]).encode(int(row["at"], 16))
        except text.StatementError as error:
            return str(error)
        return None if got == words_of(row) else f"{row['text']}: {got}, expected {words_of(row)}"

    rows = [row for row in encodings(vectors) if row["assembles"] == "yes"]
    failed = failures(rows, check)
    report(capsys, f"{len(rows) - len(failed)} of {len(rows)} texts assemble to their words")
    assert rows
    assert not failed, "\n".join(failed[:20])
