"""Every kind of file that a command reads: a valid sample, and the command to which a campaign passes damaged ones."""

from __future__ import annotations

import contextlib
import io
import json
import random
import shutil
import sys
import tomllib
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from unittest import mock

import pyarrow
from matplotlib.figure import Figure
from PIL import Image
from pyarrow import parquet

import arena.cli
import emu.cli
import openswarm.cli
import toolchain.cli
from arena.campaign import campaign as campaigns
from emu.host.exit_status import BAD_INPUT, MEANING
from tests.fuzz.damage import mutate_json, mutate_text
from tests.fuzz.emulator.fuzz_loader import mutate
from tests.fuzz.protocol import conversation, converse

PROGRAM = """
#include <p30F6014A.h>
struct { int speed[2]; long total; } robot;
__attribute__((noinline)) int step(int by) { robot.speed[1] += by; return robot.speed[1]; }
int main(void)
{
    U1MODEbits.UARTEN = 1;
    U1STAbits.UTXEN = 1;
    for (;;) {
        U1TXREG = 'a' + (step(3) & 7);
        robot.total += robot.speed[1];
    }
}
"""
STIMULUS = """0.5us selector 3
1us remote ok   # OK
1us ir 0 20
1us light 3 2500
2us battery 3.3
2us tilt 0.1 0 0.98
0.1us uart1 "hello\\r"
300 uart1 "x" framing
4us pin RF6 0
5us camera unplug
6us lamp 0.5
7us bluetooth down
8us i2c sda 5
0 noise 1
"""
SCENE = """name = "small"
description = "two robots, an object of each kind, walls, a patch and a lamp"
[arena]
width_cm = 120.0
height_cm = 100.0
[[robots]]
count = 1
selector = 1
[[robots]]
place = "poses"
poses = [[30.0, 40.0, 90.0]]
[[objects]]
count = 2
radius_cm = 5.0
[[obstacles]]
polygon = [[60.0, 60.0], [70.0, 60.0], [65.0, 70.0]]
[[patches]]
polygon = [[10.0, 10.0], [30.0, 10.0], [30.0, 30.0]]
colour = "#202020"
[[lamps]]
x_cm = 100.0
counts = 500.0
[camera]
range_cm = 150.0
[start]
remote = "ok"
"""
STAMPS = b"# cycle uart bytes\n100 1 616263\n200 1 0d\n300 2 ff00\n"
CAMPAIGN = b"""seed = 1
trials = 4
[run]
seconds = 0.001
[detect]
uart1 = ["h"]
[input]
uart1 = [[0.0001, "go"]]
[faults]
ram = 4
register = 2
flash = 1
"""
AVR_LOOP = b":02000000FFCF30\n:00000001FF\n"
"""An instruction of the ATmega328P that jumps to itself."""
AVR_PROGRAM = Path(__file__).with_name("programs") / "avr.elf"
"""Program for the ATmega328P; beside its source, because it needs a compiler for AVR."""
SESSION = """break {}
run
backtrace
info locals
info statics
print {}
disassemble {}
list
finish
step 3
reverse-step
frame 0
"""
"""Commands of a debug session that read all debug information: a function, an expression, and the function again."""
ASSEMBLY = b"""        .global __reset
        .text
__reset:
        mov     #__SP_init, w15
        mov     #tbloffset(table), w1
1:      tblrdl  [w1], w2
        cp      w2, #10
        bra     nz, 1b
table:  .pword  0x123456, __reset
        .section .ndata,data,near
word:   .word   0x1234, word
        .ascii  "text"
"""
RUN_CYCLES = "400"
"""Cycles of a run with damaged input; the events of the samples are in its first 300."""
RENDERED = 10
"""One of so many figures is rendered; of the others only the drawing commands run, which takes a third of the time."""
LONGEST_RUN = 0.01
"""Longest run of a campaign of faults, in simulated seconds."""
KEY = b"00112233445566778899aabbccddeeff\n"
ANNOTATIONS = b"calls main: step, *\ndepth step 40\nrecursion step 3\nthread step\n"
NAMES = (
    "ELF listed",
    "ELF bounded",
    "ELF debugged",
    "ELF for AVR",
    "ELF for AVR profiled",
    "HEX",
    "HEX for AVR",
    "scene",
    "stimulus",
    "stamps",
    "picture",
    "baseline",
    "counts",
    "annotations",
    "archive",
    "options",
    "assembly",
    "object",
    "program",
    "key",
    "record",
    "record continued",
    "record's head",
    "record's rows",
    "record's head drawn",
    "record's rows filmed",
    "manifest",
    "manifest again",
    "manifest reported",
    "bundle",
    "campaign",
    "state of faults",
    "C source",
    "protocol",
)
"""Names of the kinds of files."""
MOST_MEMORY = 8 << 30
"""Limit of the address space in bytes: an input that needs more memory is a failure."""
HOST = cache(campaigns.host)
LONGEST = 20_000
"""Maximum length of an error message in characters."""


@dataclass(frozen=True)
class Format:
    """Kind of file: a valid sample, the file name, and the arguments of the command that reads it, with {} for the
    path."""

    name: str
    sample: bytes
    file: str
    command: tuple[str, ...]
    is_text: bool = True
    session: str = ""
    """Standard input of the command."""
    wrap: Callable[[bytes], bytes] = bytes
    """Function that returns the file with the damaged text inside. Raises ValueError or ArrowException if no file can
    contain the text."""


class Bench:
    """Folder with a valid file of every kind, and the image to which they belong."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.image = folder / "program.elf"
        (folder / "program.c").write_text(PROGRAM)
        shutil.copy(AVR_PROGRAM.with_suffix(".c"), folder)
        self._must("toolchain", "cc", "-g", "-Os", str(folder / "program.c"), "-o", str(self.image))
        self._must("toolchain", "cc", "-c", str(folder / "program.c"), "-o", str(folder / "program.o"))
        self._must("openswarm", "program", str(folder / "program.c"), "--version", "2", "-o", str(folder / "sent.elf"))
        key = folder / "swarm.key"
        key.write_bytes(KEY)
        key.chmod(0o600)
        self._must("toolchain", "ar", "rcs", str(folder / "library.a"), str(folder / "program.o"))
        self._must("emu", "footprint", str(self.image), "--update", str(folder / "footprint.json"))
        self._must("emu", "coverage", str(self.image), "--seconds", "0.0003", "--counts", str(folder / "counts.json"))
        (folder / "faults.toml").write_bytes(CAMPAIGN)
        self._must("emu", "inject", str(self.image), "--campaign", str(folder / "faults.toml"),
                   "--state", str(folder / "faults.state"))  # fmt: skip
        self.run = folder / "run"
        picture = io.BytesIO()
        Image.new("RGB", (8, 6), (200, 30, 40)).save(picture, "PNG")
        run = ("emu", "run", str(self.image), "--cycles", RUN_CYCLES, "--engine", "plain", "--uart1", "null")
        short = ("--brain", "scripted", "--trials", "1", "--jobs", "1", "--out")
        small = ("--robots", "2", "--objects", "2", "--minutes", "0.005", *short)
        self._must("arena", "run", "clustering", *small, str(self.run))
        self._must("arena", "bundle", str(folder / "study.zip"), str(self.run))
        self.trial = parquet.read_table(self.run / "trial-0001.parquet")
        flash = ("openswarm", "flash", "--port", "/dev/null", "--key", str(key))
        page = ("arena", "replay", "{}", "--out", str(folder / "page.html"))
        manifest = ((self.run / "manifest.json").read_bytes(), "run/manifest.json")
        self._must("toolchain", "hex", str(self.image), "-o", str(folder / "program.hex"))
        elf, hexed = self.image.read_bytes(), (folder / "program.hex").read_bytes()
        self.formats = (
            Format("ELF listed", elf, "listed.elf", ("emu", "disasm", "{}", "--source"), is_text=False),
            Format("ELF bounded", elf, "bounded.elf", ("toolchain", "bounds", "{}"), is_text=False),
            Format("ELF debugged", elf, "debugged.elf",
                   ("emu", "debug", "--tui", "{}", "--board", "none", "--seconds", "0.001", "--engine", "plain"),
                   is_text=False, session=SESSION.format("step", "robot.speed[1]", "step")),
            Format("ELF for AVR", AVR_PROGRAM.read_bytes(), "avr.elf",
                   ("emu", "debug", "--tui", "{}", "--board", "kilobot", "--seconds", "0.001"),
                   is_text=False, session=SESSION.format("add", "where", "add")),
            Format("ELF for AVR profiled", AVR_PROGRAM.read_bytes(), "avr.elf",
                   ("emu", "profile", "{}", "--board", "kilobot", "--seconds", "0.0005", "--lines", "5"),
                   is_text=False),
            Format("HEX", hexed, "image.hex", ("emu", "info", "{}")),
            Format("HEX for AVR", AVR_LOOP, "avr.hex",
                   ("emu", "run", "{}", "--board", "kilobot", "--seconds", "0.0001")),
            Format("scene", SCENE.encode(), "scene.toml",
                   ("arena", "run", "{}", "--minutes", "0.02", *short, str(folder / "out"))),
            Format("stimulus", STIMULUS.encode(), "stimulus.txt", (*run, "--stimulus", "{}")),
            Format("stamps", STAMPS, "input.rec", (*run, "--replay", "{}")),
            Format("picture", picture.getvalue(), "picture.png", (*run, "--camera", "{}"), is_text=False),
            Format("baseline", (folder / "footprint.json").read_bytes(), "footprint.json",
                   ("emu", "footprint", str(self.image), "--check", "{}")),
            Format("counts", (folder / "counts.json").read_bytes(), "counts.json",
                   ("emu", "coverage", str(self.image), "--seconds", "0.0001", "--counts", "{}")),
            Format("annotations", ANNOTATIONS, "stack.txt", ("toolchain", "bounds", str(self.image), "-a", "{}")),
            Format("archive", (folder / "library.a").read_bytes(), "library.a", ("toolchain", "ar", "t", "{}"),
                   is_text=False),
            Format("options", b"-Os -g \"-DX=1\" '-DY' -Wall\n", "options",
                   ("toolchain", "cc", "@{}", "-c", str(folder / "program.c"), "-o", str(folder / "again.o"))),
            Format("assembly", ASSEMBLY, "odd.s", ("toolchain", "as", "{}", "-o", str(folder / "odd.o"))),
            Format("object", (folder / "program.o").read_bytes(), "object.o",
                   ("toolchain", "cc", "{}", "-o", str(folder / "linked.elf")), is_text=False),
            Format("program", (folder / "sent.elf").read_bytes(), "program-2.elf", (*flash[:2], "{}", *flash[2:]),
                   is_text=False),
            Format("key", KEY, key.name, (*flash[:2], str(folder / "sent.elf"), *flash[2:])),
            Format("record", (self.run / "trial-0001.parquet").read_bytes(), "trial-0001.parquet", page, is_text=False),
            Format("record continued", (self.run / "trial-0001.parquet").read_bytes(), "start.parquet",
                   ("arena", "run", "clustering", *small, str(folder / "out"), "--start", "{}"), is_text=False),
            Format("record's head", _head(self.trial), "headed.parquet", page, wrap=self._headed),
            Format("record's rows", _rows(self.trial), "rows.parquet", page, wrap=self._filled),
            Format("record's head drawn", _head(self.trial), "headed.parquet",
                   ("arena", "plot", "{}", "--out", str(folder / "plots")), wrap=self._headed),
            Format("record's rows filmed", _rows(self.trial), "rows.parquet",
                   ("arena", "replay", "{}", "--export", str(folder / "trial.gif")), wrap=self._filled),
            Format("manifest", manifest[0], "manifested.zip", ("arena", "verify", "{}", "--beginning"),
                   wrap=self._bundled),
            Format("manifest again", *manifest, ("arena", "run", "clustering", *small, str(self.run))),
            Format("manifest reported", *manifest, ("arena", "report", str(self.run))),
            Format("bundle", (folder / "study.zip").read_bytes(), "study.zip", ("arena", "verify", "{}"),
                   is_text=False),
            Format("campaign", CAMPAIGN, "faults.toml",
                   ("emu", "inject", str(self.image), "--campaign", "{}", "--only", "1"), wrap=_short),
            Format("state of faults", (folder / "faults.state").read_bytes(), "again.state",
                   ("emu", "inject", str(self.image), "--campaign", str(folder / "faults.toml"), "--state", "{}")),
            Format("C source", PROGRAM.encode(), "odd.c", ("toolchain", "cc", "-c", "{}", "-o", str(folder / "odd.o"))),
            Format("protocol", conversation(self.image), "messages", ()),
        )  # fmt: skip
        assert tuple(kind.name for kind in self.formats) == NAMES
        self._samples = {kind.name: kind.wrap(kind.sample) for kind in self.formats}

    def _must(self, *words: str) -> None:
        status, said = call(words)
        if status:
            raise RuntimeError(f"{' '.join(words)} ended with {status}: {said}")

    def _bundled(self, manifest: bytes) -> bytes:
        """Return a bundle of the run with another manifest, whose hash is right."""
        path, bundle = self.run / "manifest.json", self.folder / "again.zip"
        before = path.read_bytes()
        try:
            path.write_bytes(manifest)
            self._must("arena", "bundle", str(bundle), str(self.run))
        finally:
            path.write_bytes(before)
        return bundle.read_bytes()

    def _headed(self, head: bytes) -> bytes:
        """Return the trial's record with other metadata."""
        return _parquet(self.trial.replace_schema_metadata({"arena": head}))

    def _filled(self, rows: bytes) -> bytes:
        """Return the trial's record with other columns, of the original types if the values permit."""
        columns = json.loads(rows)
        if not isinstance(columns, dict):
            raise ValueError("no columns")
        for name in columns.keys() & set(self.trial.column_names):
            with contextlib.suppress(ValueError, TypeError, OverflowError, pyarrow.ArrowException):
                columns[name] = pyarrow.array(columns[name], self.trial.schema.field(name).type)
        return _parquet(pyarrow.table(columns).replace_schema_metadata(self.trial.schema.metadata))

    def attempt(self, kind: Format, data: bytes) -> str:
        """Pass a damaged file to its command. Return "done", "refused", "not made" or another documented status."""
        if kind.name == "protocol":
            return converse(data)
        path = self.folder / kind.file
        try:
            path.write_bytes(kind.wrap(data))
        except (ValueError, TypeError, RecursionError, OverflowError, pyarrow.ArrowException):
            return "not made"
        shutil.rmtree(self.folder / "out", ignore_errors=True)
        try:
            with _shortened(zlib.crc32(data) % RENDERED == 0):
                status, said = call([word.replace("{}", str(path)) for word in kind.command], kind.session)
        finally:
            path.write_bytes(self._samples[kind.name])
        assert status in MEANING, f"status {status}"
        assert "Traceback" not in said, said
        assert not status or said.strip(), f"status {status} without a word"
        if status == BAD_INPUT:
            assert len(said) < LONGEST, f"{len(said)} characters of message"
        return {0: "done", 2: "refused"}.get(status, f"status {status}")


@contextlib.contextmanager
def _shortened(is_rendered: bool) -> Iterator[None]:
    """Describe the host once and not for each run, which starts git; without `is_rendered`, only draw figures."""
    with contextlib.ExitStack() as patches:
        patches.enter_context(mock.patch.object(campaigns, "host", HOST))
        if not is_rendered:
            patches.enter_context(mock.patch.object(Figure, "savefig"))
        yield


def damaged(kind: Format, data: bytes, rng: random.Random) -> bytes:
    """Return a file of this kind with random damage: to its text or JSON, which may stay valid, or to its bytes."""
    change = mutate_text if kind.is_text and rng.random() < 0.7 else mutate
    if data[:1] == b"{" and kind.name != "protocol" and rng.random() < 0.5:
        with contextlib.suppress(ValueError):
            return mutate_json(data, rng)
    return change(data, rng)


MAINS: dict[str, Callable[[list[str]], int]] = {
    "emu": emu.cli.main, "arena": arena.cli.main, "toolchain": toolchain.cli.main, "openswarm": openswarm.cli.main,
}  # fmt: skip


def call(words: Iterable[str], session: str = "") -> tuple[int, str]:
    """Run a command in this process, with `session` as its standard input. Return its status and its output."""
    program, *rest = words
    main = MAINS[program]
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
        before, sys.stdin = sys.stdin, io.StringIO(session)
        try:
            status = main(rest)
        except SystemExit as ended:
            status = ended.code if isinstance(ended.code, int) else 1
        finally:
            sys.stdin = before
    return status, said.getvalue()


def _short(campaign: bytes) -> bytes:
    """Return a campaign of faults. Raises OverflowError for one whose runs are long."""
    with contextlib.suppress(ValueError, RecursionError):
        if float(tomllib.loads(campaign.decode()).get("run", {}).get("seconds", 0)) > LONGEST_RUN:
            raise OverflowError
    return campaign


def _head(trial: pyarrow.Table) -> bytes:
    """Return the metadata of a record."""
    return bytes(trial.schema.metadata[b"arena"])


def _rows(trial: pyarrow.Table) -> bytes:
    """Return the columns of a record as JSON, without columns of raw bytes."""
    shown = [name for name in trial.column_names if not name.endswith("_strip")]
    empty = {name: [""] * len(trial) for name in trial.column_names if name not in shown}
    return json.dumps(trial.select(shown).to_pydict() | empty).encode()


def _parquet(table: pyarrow.Table) -> bytes:
    sink = io.BytesIO()
    parquet.write_table(table, sink)
    return sink.getvalue()
