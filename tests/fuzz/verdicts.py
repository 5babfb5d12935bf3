"""Long campaigns over programs: verdicts in a file that several processes can share and that can be resumed.

Input: seeds, and a function that examines one. Output: `Verdict`s, which are counted and written to the file. The
first line of the file names the campaign and the compiler, and each other line is a verdict in JSON. A process that
examines a seed locks the byte of that number in `FILE.lock`, so several processes share the seeds. The operating
system releases the locks of a killed process.
"""

from __future__ import annotations

import fcntl
import gc
import hashlib
import json
import os
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.fuzz.seeds import ROOT, Campaign

INTERRUPTED = 130
"""Exit status of a campaign that SIGINT or SIGTERM ended and that had no failure."""
JUDGED = ("toolchain", "emu")
"""Packages whose sources verdicts depend on, relative to the project."""
APART = tuple(ROOT / "toolchain" / name for name in ("bounds", "proof"))
"""Subpackages that only analyse the compiler's output; verdicts stay valid when they change."""
SUFFIXES = {".py", ".c", ".cpp", ".h", ".s", ".inc", ".csv"}
POLL_S = 1.0
"""Seconds between two checks for an interrupt, or for the death of the campaign's process."""
COLLECT_EVERY = 100_000
"""Allocations between two garbage collections; a compilation makes millions of objects but few reference cycles."""


@dataclass(frozen=True)
class Verdict:
    """Result of one seed. `kind` is "agreed", "skipped" or "failed"; `shapes` are the compared levels and link
    modes."""

    seed: int
    kind: str
    reason: str = ""
    shapes: tuple[str, ...] = ()

    @property
    def summary(self) -> str:
        """Return the key under which the verdict is counted."""
        return f"{self.kind} {self.reason if self.kind != 'failed' else ''}".strip()


class LogError(Exception):
    """A file of verdicts cannot be resumed."""


def source_hash() -> str:
    """Return a hash of the sources of compiler, run-time library and emulator."""
    digest = hashlib.sha256()
    for folder in JUDGED:
        for path in sorted(path for path in (ROOT / folder).rglob("*") if path.suffix in SUFFIXES):
            if any(part in APART for part in path.parents):
                continue
            digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:20]


class Book:
    """Verdicts by seed, stored in `path` if one is given, with locks on the seeds that a process examines."""

    def __init__(self, path: Path | None, campaign: str) -> None:
        """Read the file. Raises LogError if it belongs to another campaign or compiler, or is damaged."""
        self.path = path
        self.verdicts: dict[int, Verdict] = {}
        self._head = {"campaign": campaign, "judged": source_hash() if path is not None else ""}
        self._read_to = 0
        if path is None:
            return
        self._locks = os.open(path.with_name(path.name + ".lock"), os.O_RDWR | os.O_CREAT, 0o666)
        with self._locked():
            if not path.exists() or not path.stat().st_size:
                self._append(self._head)
            self._read()

    def take(self, seed: int) -> bool:
        """Reserve a seed. Return whether to examine it: it has no verdict, and no other process has reserved it."""
        if self.path is None:
            return seed not in self.verdicts
        try:
            fcntl.lockf(self._locks, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, 1 + seed)
        except OSError:
            return False
        self._read()
        if seed in self.verdicts:
            self._release(seed)
        return seed not in self.verdicts

    def put(self, verdict: Verdict) -> None:
        """Store a verdict and release its seed."""
        self.verdicts[verdict.seed] = verdict
        if self.path is not None:
            with self._locked():
                self._append(asdict(verdict))
            self._release(verdict.seed)

    def _release(self, seed: int) -> None:
        fcntl.lockf(self._locks, fcntl.LOCK_UN, 1, 1 + seed)

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Lock the beginning of the file and the right to append (byte 0 of the lock file)."""
        fcntl.lockf(self._locks, fcntl.LOCK_EX, 1, 0)
        try:
            yield
        finally:
            fcntl.lockf(self._locks, fcntl.LOCK_UN, 1, 0)

    def _append(self, row: dict[str, object]) -> None:
        """Append one line, after completing a line that a killed process has left incomplete."""
        assert self.path is not None
        with self.path.open("a+b") as log:
            if log.tell():
                log.seek(-1, os.SEEK_END)
                if log.read(1) != b"\n":
                    log.write(b"\n")
            log.write(json.dumps(row).encode() + b"\n")

    def _read(self) -> None:
        """Read the lines added since the last call. An incomplete line, from a killed process, is no verdict."""
        assert self.path is not None
        with self.path.open("rb") as log:
            log.seek(self._read_to)
            lines = log.read().splitlines(keepends=True)
        for line in lines:
            if not line.endswith(b"\n"):
                break
            first = not self._read_to
            self._read_to += len(line)
            try:
                row = json.loads(line)
            except ValueError:
                if first:
                    raise LogError(f"{self.path}: line 1 is not that of a file of verdicts") from None
                continue
            if first:
                self._check(row)
                continue
            try:
                self.verdicts[row["seed"]] = Verdict(**row | {"shapes": tuple(row["shapes"])})
            except (TypeError, KeyError):
                raise LogError(f"{self.path}: no verdict before offset {self._read_to}") from None

    def _check(self, row: object) -> None:
        if not isinstance(row, dict) or row.get("campaign") != self._head["campaign"]:
            raise LogError(f"{self.path}: not a file of the campaign '{self._head['campaign']}'")
        if row.get("judged") != self._head["judged"]:
            raise LogError(f"{self.path}: its verdicts are about another compiler or emulator; begin another file")


def run_all(campaign: Campaign, examine: Callable[[int], Verdict], book: Book, jobs: int) -> int:
    """Examine the seeds of `campaign` in `jobs` processes and return the exit status.

    A failure does not stop the campaign. After SIGINT or SIGTERM the running programs are finished and recorded; a
    second signal ends the process at once.
    """
    stopped: list[int] = []

    def stop(number: int, _frame: object) -> None:
        stopped.append(number)
        signal.signal(number, signal.SIG_DFL)
        print("ending: what is being examined is written down", file=sys.stderr, flush=True)

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    done: dict[int, Verdict] = {}
    elsewhere: set[int] = set()
    try:
        with ProcessPoolExecutor(jobs, initializer=_worker) as pool:
            running: set[Future[Verdict]] = set()
            for seed in campaign:
                while len(running) > jobs and not stopped:
                    running = _record_verdicts(running, book, done, campaign)
                if stopped:
                    break
                if book.take(seed):
                    running.add(pool.submit(_examined, examine, seed))
                elif seed in book.verdicts:
                    done[seed] = book.verdicts[seed]
                else:
                    elsewhere.add(seed)
            for future in running if stopped else ():
                future.cancel()
            while running := {future for future in running if not future.cancelled()}:
                running = _record_verdicts(running, book, done, campaign)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    counts = Counter(verdict.summary for verdict in done.values())
    if elsewhere:
        counts["with another process"] = len(elsewhere)
    campaign.ended(", ".join(f"{count} {kind}" for kind, count in sorted(counts.items())) or "nothing")
    if counts["failed"]:
        return 1
    return INTERRUPTED if stopped else 0


def _worker() -> None:
    """Initialise a process of the pool: ignore SIGINT, which the campaign handles, and collect garbage rarely."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_exit_with, args=(os.getppid(),), daemon=True).start()
    gc.freeze()
    gc.set_threshold(COLLECT_EVERY)


def _exit_with(campaign: int) -> None:
    """End this process when the campaign's process has ended; the pool would leave it running."""
    while os.getppid() == campaign:
        time.sleep(POLL_S)
    os._exit(1)


def _record_verdicts(
    running: set[Future[Verdict]], book: Book, done: dict[int, Verdict], campaign: Campaign
) -> set[Future[Verdict]]:
    """Wait for verdicts, store those available, and return the futures that are still running."""
    finished, left = wait(running, POLL_S, FIRST_COMPLETED)
    for future in finished:
        if future.cancelled():
            continue
        verdict = future.result()
        book.put(verdict)
        done[verdict.seed] = verdict
        if verdict.kind == "failed":
            campaign.failed(verdict.reason, verdict.seed)
    return left


def _examined(examine: Callable[[int], Verdict], seed: int) -> Verdict:
    try:
        return examine(seed)
    except Exception as error:
        said = str(error).splitlines()
        return Verdict(seed, "failed", f"internal error: {type(error).__name__}: {said[0] if said else ''}")
