"""Files of verdicts can be resumed and shared between processes, and are bound to one compiler."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from tests.fuzz import verdicts
from tests.fuzz.seeds import ROOT, Campaign, parser
from tests.fuzz.verdicts import Book, LogError, Verdict, run_all
from tests.watchdog import HANG

OTHER = """
import sys, time
from pathlib import Path
from tests.fuzz.verdicts import Book, Verdict
book = Book(Path(sys.argv[1]), "made up")
print(*[seed for seed in range(4) if book.take(seed)], flush=True)
book.put(Verdict(0, "agreed"))
print("put", flush=True)
time.sleep(60)
"""
SLOW = """
import sys, time
from functools import partial
from pathlib import Path
from tests.fuzz.seeds import Campaign, parser
from tests.fuzz.verdicts import Book, Verdict, run_all
def examine(seed):
    Path(sys.argv[1] + ".begun").touch()
    time.sleep(0.5)
    return Verdict(seed, "agreed", "", ("-O0",))
campaign = Campaign(parser("text"), "programs", 1000, "programs")
campaign.parse(["--seed", "1"])
sys.exit(run_all(campaign, examine, Book(Path(sys.argv[1]), "made up"), 1))
"""


def judge(differing: set[int], seed: int) -> Verdict:
    """Return a verdict at once."""
    return Verdict(seed, "failed", "it differs") if seed in differing else Verdict(seed, "agreed", "", ("-O0", "-Os"))


def campaign(count: int) -> Campaign:
    """Return a campaign whose seeds start at 1."""
    made = Campaign(parser("text"), "programs", count, "programs")
    made.parse(["--seed", "1"])
    return made


def test_a_campaign_goes_on_where_its_file_ends(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A resumed campaign does not examine seeds with a verdict again, but counts them; a failure is reported and
    stops nothing."""
    log = tmp_path / "log"
    assert run_all(campaign(3), partial(judge, {2}), Book(log, "made up"), 1) == 1
    assert "FAILED at seed 2: it differs" in capsys.readouterr().out
    known = Book(log, "made up").verdicts
    assert known == {1: judge(set(), 1), 2: judge({2}, 2), 3: judge(set(), 3)}
    assert run_all(campaign(4), partial(judge, {1, 3}), Book(log, "made up"), 1) == 1
    assert "3 agreed, 1 failed" in capsys.readouterr().out
    assert len(log.read_text().splitlines()) == 1 + 4


def test_two_processes_share_the_seeds_and_a_killed_one_leaves_its_own(tmp_path: Path) -> None:
    """Two processes never examine the same seed, and each reads all verdicts; seeds of a killed process become free."""
    log = tmp_path / "log"
    with subprocess.Popen([sys.executable, "-c", OTHER, str(log)], cwd=ROOT, stdout=subprocess.PIPE, text=True) as one:
        assert one.stdout is not None
        assert one.stdout.readline().split() == ["0", "1", "2", "3"]
        assert one.stdout.readline() == "put\n"
        book = Book(log, "made up")
        assert [seed for seed in range(6) if book.take(seed)] == [4, 5]
        assert 0 in book.verdicts
        one.kill()
        one.wait()
        assert [seed for seed in range(4) if book.take(seed)] == [1, 2, 3]


def test_an_interrupted_campaign_writes_down_what_it_was_at(tmp_path: Path) -> None:
    """An interrupted campaign ends with status 130, and its file can be resumed."""
    log = tmp_path / "log"
    with subprocess.Popen([sys.executable, "-c", SLOW, str(log)], cwd=ROOT, stderr=subprocess.PIPE) as running:
        while not log.with_name("log.begun").exists():
            time.sleep(0.05)
        running.send_signal(signal.SIGINT)
        running.communicate(timeout=HANG)
    assert running.returncode == verdicts.INTERRUPTED
    done = Book(log, "made up").verdicts
    assert 1 in done
    assert len(done) < 10


def test_workers_do_not_outlive_a_killed_campaign(tmp_path: Path) -> None:
    """Worker processes end when their campaign is killed; otherwise they would wait for work for ever."""
    log = tmp_path / "log"
    with subprocess.Popen([sys.executable, "-c", SLOW, str(log)], cwd=ROOT, stderr=subprocess.PIPE) as running:
        while not log.with_name("log.begun").exists():
            time.sleep(0.05)
        running.kill()
        running.communicate(timeout=HANG)  # returns when no worker holds the other end of the pipe


def test_verdicts_on_another_compiler_or_of_another_campaign_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Verdicts of another compiler or campaign are refused, with the file's name and a remedy."""
    log = tmp_path / "log"
    Book(log, "made up").put(Verdict(1, "agreed"))
    with pytest.raises(LogError, match="not a file of the campaign 'other'"):
        Book(log, "other")
    monkeypatch.setattr(verdicts, "source_hash", lambda: "0123")
    with pytest.raises(LogError, match="another compiler or emulator; begin another file"):
        Book(log, "made up")


def test_damaged_files_are_refused_and_half_a_line_is_no_verdict(tmp_path: Path) -> None:
    """A damaged file is refused; a process that is killed while it writes loses only its own verdict."""
    log = tmp_path / "log"
    book = Book(log, "made up")
    book.put(Verdict(1, "agreed"))
    with log.open("ab") as stream:
        stream.write(b'{"seed": 2, "ki')
    book.put(Verdict(3, "agreed"))
    assert set(Book(log, "made up").verdicts) == {1, 3}
    with log.open("ab") as stream:
        stream.write(b"[]\n")
    size = os.path.getsize(log)
    with pytest.raises(LogError, match=f"no verdict before offset {size}"):
        Book(log, "made up")
    log.write_text("seeds\n")
    with pytest.raises(LogError, match="line 1"):
        Book(log, "made up")
