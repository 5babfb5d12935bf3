"""Samples of the campaigns `fuzz_inputs.py`, `fuzz_run.py` and `fuzz_loader.py`, and inputs that have made one fail."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from arena.trial.record import Columns, RecordError
from emu.image.loader import load_image
from emu.instruments.coverage import Counts
from tests.fuzz.emulator import fuzz_loader, fuzz_run
from tests.fuzz.emulator.fuzz_inputs import campaign
from tests.fuzz.file_formats import call
from tests.fuzz.protocol import converse
from tests.watchdog import HANG

HELLO = Path(__file__).with_name("hello.hex")


@pytest.mark.slow
def test_damaged_files_are_refused_or_read() -> None:
    outcomes = campaign(range(2026, 2146))
    assert sum(outcomes.values()) == 120
    assert sum(count for name, count in outcomes.items() if name.endswith("refused")) > 50
    assert sum(count for name, count in outcomes.items() if name.endswith("done")) > 10


def test_damaged_firmware_ends_with_a_reason_and_nothing_else() -> None:
    outcomes = fuzz_run.campaign(range(2016, 2076), ("plain", "jit"))
    assert sum(outcomes.values()) == 60
    assert outcomes["fault"] > 14
    assert outcomes["limit"] > 7


def test_mutated_files_are_loaded_or_refused_and_nothing_else_happens() -> None:
    outcomes = fuzz_loader.campaign(range(20160, 21160))
    assert sum(outcomes.values()) == 1000
    assert outcomes["refused"] > 70
    assert outcomes["loaded"] > 70


def requests(*asked: tuple[str, object]) -> bytes:
    """Return messages of the debug protocol, one per line."""
    lines = [
        {"seq": n, "type": "request", "command": name, "arguments": given} for n, (name, given) in enumerate(asked)
    ]
    return "\n".join(map(json.dumps, [*lines, {"seq": 99, "type": "request", "command": "disconnect"}])).encode()


@pytest.mark.parametrize(
    "asked",
    [
        ("configurationDone", {}),
        ("stackTrace", {"threadId": 1}),
        ("launch", ["no object"]),
        ("setBreakpoints", {"source": None, "breakpoints": 3}),
    ],
)
def test_a_request_out_of_order_or_shape_is_answered(asked: tuple[str, object]) -> None:
    assert converse(requests(asked)) == "answered"


def test_a_message_nested_too_deeply_ends_the_session() -> None:
    """A message nested too deeply for json (RecursionError) ends the session, because the reader thread reports the
    end of input."""
    assert converse(b'{"arguments": ' + b"[" * 100_000) == "answered"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "key"), [("disassemble", "instructionCount"), ("readMemory", "count")]
)  # fmt: skip
def test_a_request_for_more_than_there_is_is_refused(command: str, key: str) -> None:
    """A request for 10^20 rows is refused and does not exhaust the memory."""
    many = {"memoryReference": "0", key: 10**20}
    asked = requests(("launch", {"program": str(HELLO), "board": "none", "stopOnEntry": True}), (command, many))
    code = (
        "import resource, sys\n"
        "resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))\n"
        "from tests.fuzz.protocol import converse\n"
        "print(converse(sys.stdin.buffer.read()))"
    )
    ended = subprocess.run([sys.executable, "-c", code], input=asked, capture_output=True, check=False, timeout=HANG)
    assert ended.stdout == b"answered\n", ended.stderr.decode()


@pytest.mark.parametrize(("text", "words"), [("-O2 'x", "no closing quotation"), ("-O2 \0", "zero byte at offset 4")])
def test_a_bad_file_of_options_is_named(text: str, words: str, tmp_path: Path) -> None:
    options = tmp_path / "options"
    options.write_text(text)
    status, said = call(["toolchain", "cc", f"@{options}"])
    assert status == 2
    assert f"response file '{options}': " in said
    assert words in said


def test_a_record_without_a_column_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="column r0_x is missing"):
        Columns(tmp_path)["r0_x"]


def test_counts_nested_too_deeply_are_refused(tmp_path: Path) -> None:
    source, image, counts = tmp_path / "main.c", str(tmp_path / "main.elf"), tmp_path / "counts.json"
    source.write_text("int main(void) { for (;;) { } }\n")
    counts.write_text("[" * 100_000)
    assert call(["toolchain", "cc", "-g", str(source), "-o", image])[0] == 0
    status, said = call(["emu", "coverage", image, "--seconds", "0.0001", "--counts", str(counts)])
    assert status == 2
    assert said.startswith(f"emu coverage: {counts}: maximum recursion depth exceeded")


def test_counts_that_are_no_numbers_are_refused() -> None:
    from emu.instruments.coverage import fingerprint

    image = load_image(HELLO)
    with pytest.raises(ValueError, match="expected counts of an earlier run"):
        Counts.of({"image": fingerprint(image), "executed": {"0": None}, "taken": {}}, image)
