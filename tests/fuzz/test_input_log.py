"""Logs of inputs are resumed after a kill, merged over hosts, and shown as a table."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.fuzz import input_log
from tests.fuzz.emulator.fuzz_inputs import ROOT
from tests.fuzz.file_formats import NAMES
from tests.fuzz.input_log import (
    AIM,
    BLOCK,
    FAILED,
    STORED,
    TABLE,
    Block,
    InputLog,
    InputLogError,
    merged,
    read_blocks,
    table,
)
from tests.watchdog import HANG


def block(kind: str, first: int, count: int = 10, done: int = 4, commit: str = "one") -> Block:
    return Block(kind, first, count, {"done": done, "refused": count - done}, [commit])


def test_adjacent_blocks_become_one_and_a_repeated_one_counts_once() -> None:
    found = merged([block("scene", 10, commit="two"), block("HEX", 0), block("scene", 0), block("scene", 0)])
    assert found == [block("HEX", 0), Block("scene", 0, 20, {"done": 8, "refused": 12}, ["one", "two"])]
    assert merged([*found, block("scene", 10), block("scene", 30)]) == [*found, block("scene", 30)]


def test_blocks_that_overlap_are_refused() -> None:
    with pytest.raises(InputLogError, match="scene: seeds 5 to 9 occur twice"):
        merged([block("scene", 0), block("scene", 5)])


def test_a_log_is_resumed_where_a_killed_process_has_left_it(tmp_path: Path) -> None:
    """An incomplete line is removed. Blocks of the repository count, and are not run again."""
    path = tmp_path / "log"
    log = InputLog(path)
    log.add(block("scene", 0))
    log.close()
    with path.open("ab") as file:
        file.write(b'{"kind": "sce')
    log = InputLog(path, [block("scene", 10), block("HEX", 0)])
    assert (log.count("scene"), log.count("HEX"), log.count("key")) == (20, 10, 0)
    assert (log.next_seed("scene", 0), log.next_seed("HEX", 0), log.next_seed("HEX", 1000)) == (20, 10, 1000)
    with pytest.raises(InputLogError, match="another process writes it"):
        InputLog(path)
    log.add(block("scene", 20))
    log.close()
    assert read_blocks(path) == [block("scene", 0), block("scene", 20)]


@pytest.mark.parametrize("line", [b"text\n", b'{"kind": "scene"}\n', json.dumps(vars(block("a", 0, 9)) | {"count": 8})])
def test_a_damaged_log_is_refused(line: bytes | str, tmp_path: Path) -> None:
    path = tmp_path / "log"
    path.write_bytes(line if isinstance(line, bytes) else line.encode() + b"\n")
    with pytest.raises(InputLogError, match=":1: "):
        read_blocks(path)


def test_the_table_counts_outcomes_of_each_kind() -> None:
    other = Block("scene", 10, 3, {"done": 1, "status 3": 2}, ["one"])
    rows = table([block("scene", 0), other], ["scene", "HEX"]).splitlines()[-3:]
    assert rows == ["| scene | 13 | 5 | 6 | 2 |", "| HEX | 0 | 0 | 0 | 0 |", "| all | 13 | 5 | 6 | 2 |"]


def test_a_block_with_a_failed_input_runs_again(tmp_path: Path) -> None:
    """The process that has seen the failure continues behind the block; the next one repeats it, and it counts once."""
    log = InputLog(tmp_path / "log")
    log.add(Block("scene", 0, 10, {FAILED: 1, "done": 9}, ["one"]))
    assert log.next_seed("scene", 0) == 10
    log.add(block("scene", 10))
    log.close()
    log = InputLog(tmp_path / "log")
    assert (log.next_seed("scene", 0), log.count("scene")) == (0, 10)
    log.add(block("scene", 0))
    log.close()
    assert merged(input_log.passed(read_blocks(tmp_path / "log"))) == [block("scene", 0, 20, 8)]


def test_the_page_shows_the_stored_log_and_no_failure() -> None:
    """The page is that of the log, every kind has run, and no input of the log has failed."""
    blocks = read_blocks(STORED)
    assert blocks == merged(blocks)
    assert TABLE.read_text() == table(blocks, NAMES)
    assert {one.kind for one in blocks} == set(NAMES)
    assert not any(one.outcomes.get(FAILED) for one in blocks)
    assert AIM % BLOCK == 0
    assert all(one.first % BLOCK == 0 for one in blocks)


def test_logs_of_two_hosts_are_merged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(input_log, "STORED", tmp_path / "stored")
    monkeypatch.setattr(input_log, "TABLE", tmp_path / "table")
    for name, first in (("a", 0), ("b", 1000)):
        (tmp_path / name).write_text(json.dumps(vars(block("scene", first))) + "\n")
    monkeypatch.setattr(sys, "argv", ["input_log", str(tmp_path / "a"), str(tmp_path / "b")])
    for _ in range(2):
        assert input_log.main() == 0
        assert read_blocks(tmp_path / "stored") == [block("scene", 0), block("scene", 1000)]
    assert "| scene | 20 | 8 | 12 | 0 |" in (tmp_path / "table").read_text()


@pytest.mark.slow
def test_a_run_is_stopped_between_blocks(tmp_path: Path) -> None:
    """SIGTERM ends a run with status 130; the log has all blocks that were finished, and the next run keeps them."""
    log = tmp_path / "log"
    command = [sys.executable, "tests/fuzz/emulator/fuzz_inputs.py", "--log", str(log), "--format", "archive", "--seed",
               str(10**9)]  # fmt: skip
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    try:
        while not log.exists() or not log.stat().st_size:
            assert process.poll() is None
            time.sleep(0.05)
        process.send_signal(signal.SIGTERM)
        assert (process.communicate(timeout=HANG)[0], process.returncode) == ("", 130)
    finally:
        process.kill()
        process.wait()
    before = read_blocks(log)
    subprocess.run([*command, "--seconds", "0.001"], cwd=ROOT, check=True, timeout=HANG)
    assert read_blocks(log) == before
    assert [one.first for one in before] == [10**9 + BLOCK * number for number in range(len(before))]
