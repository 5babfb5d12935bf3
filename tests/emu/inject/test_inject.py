"""`emu inject`: effect of every kind of fault, classification of outcomes, output that is independent of --jobs."""

from __future__ import annotations

import csv
import json
import re
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest

from emu.api import Machine
from emu.cli import main
from emu.image.loader import load_image
from emu.inject.campaign import CampaignError, read
from emu.inject.faults import KINDS, Fault, choose_fault, inject_fault
from emu.inject.report import summary
from emu.inject.trial import OUTCOMES, Trials
from tests.json_schemas import validated
from toolchain.driver.driver import main as compile_program

SOURCE = """
#include <p30F6014A.h>
volatile unsigned total, unused[500], check, mode;
static void say(const char *text) { while (*text) { while (U1STAbits.UTXBF) {} U1TXREG = *text++; } }
static void number(unsigned n) {
    char text[] = "0000 ";
    for (int i = 3; i >= 0; i--, n >>= 4) text[i] = "0123456789ABCDEF"[n & 15];
    say(text);
}
int main(void) {
    U1BRG = 3; U1MODE = 0x8000; U1STA = 0x400; unused[1] = 1;
    for (unsigned n = 0;; n++) {
        for (unsigned i = 0; i < 3000; i++) __asm__ volatile("nop");
        while (mode == 7) {}
        if (mode == 8) *(volatile int *)0x3001 = 1;
        total += n; check += n;
        if (total != check) { say("mismatch"); check = total; }
        number(total);
        while (U1STAbits.URXDA) say(U1RXREG == 'x' ? "x" : "?");
    }
}
"""
CAMPAIGN = """seed = 3
trials = 24
[run]
seconds = 0.02
start = 0.002
[input]
uart1 = [[0.004, "xxxxxxxx"]]
[detect]
uart1 = ["mismatch"]
[faults]
ram = 2
register = 3
flash = 2
skip = 3
uart = 1
sensor = 1
brownout = 1
"""


@pytest.fixture(scope="module")
def firmware(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inject")
    (folder / "main.c").write_text(SOURCE)
    (folder / "campaign.toml").write_text(CAMPAIGN)
    assert compile_program(["-Os", "-g", str(folder / "main.c"), "-o", str(folder / "main.elf")]) == 0
    return folder


@pytest.fixture(scope="module")
def trials(firmware):
    return Trials(load_image(firmware / "main.elf"), read(firmware / "campaign.toml"))


def outcome_of_flip(trials, monkeypatch, place: str, bit: int, cycle: int = 60_000):
    """Return the outcome of a flipped bit in a variable."""
    address = load_image(trials._image.path).symbols.find(f"_{place}").address
    fault = Fault(0, "ram", cycle, address, bit)
    monkeypatch.setattr("emu.inject.trial.choose_fault", lambda *_: fault)
    return trials.run(0)


def test_outcomes_are_classified(trials, monkeypatch):
    """Faults of known effect have the expected outcomes: in unused RAM, in `total`, of which the program keeps a copy,
    and in `mode`, whose values can make it hang or trap."""
    one = partial(outcome_of_flip, trials, monkeypatch)
    assert (one("unused", 0).outcome, one("unused", 0).latent) == ("masked", True)
    assert one("total", 1).outcome == "detected"
    monkeypatch.setattr(trials, "_campaign", SimpleNamespace(**(vars(trials._campaign) | {"detect": {}})))
    silent = one("total", 1)
    assert silent.outcome == "silent"
    assert silent.why.startswith("uart1 from byte")
    machine = trials._machine
    monkeypatch.setattr("emu.inject.trial.inject_fault", lambda _fault, _machine: machine.poke("mode", 7) or "mode")
    assert one("mode", 0).outcome == "hang"
    monkeypatch.setattr("emu.inject.trial.inject_fault", lambda _fault, _machine: machine.poke("mode", 8) or "mode")
    trap = one("mode", 0)
    assert trap.outcome == "trap"
    assert "writing 2 bytes at 0x3001" in trap.why
    monkeypatch.setattr("emu.inject.trial.inject_fault", lambda _fault, _machine: "nothing")
    assert (one("mode", 0).outcome, one("mode", 0).latent) == ("masked", False)


def test_every_fault_has_its_documented_effect(firmware):
    image = load_image(firmware / "main.elf")
    machine = Machine(image.chip)
    machine.load(image)
    machine.run(cycles=100_000)
    place, register = image.symbols.find("_unused").address, machine.w[5]
    before = machine.peek(place, 1)
    inject_fault(Fault(0, "ram", 0, place, 3), machine)
    assert machine.peek(place, 1) == before ^ 8
    inject_fault(Fault(0, "register", 0, 5, 9), machine)
    assert machine.w[5] == register ^ 512
    start = image.symbols.find("_main").address
    word = machine.program.word(start)
    inject_fault(Fault(0, "flash", 0, start, 20), machine)
    assert machine.program.word(start) == word ^ 1 << 20
    inject_fault(Fault(0, "flash", 0, start, 20), machine)
    pc, cycle = machine.pc, machine.cycle
    assert inject_fault(Fault(0, "skip", 0, 0, 0), machine) == f"the instruction at {machine.inspector.where(pc)}"
    assert (machine.pc > pc, machine.cycle) == (True, cycle)
    assert inject_fault(Fault(0, "uart", 0, 1, 0), machine) == "no byte for UART1 was queued"
    machine.uart[1].feed(b"ab")
    machine.uart[1].listen(lambda byte, _: heard.append(chr(byte)))
    heard = []
    inject_fault(Fault(0, "uart", 0, 1, 0), machine)
    machine.run(cycles=60_000)
    assert heard.count("?") == 1
    inject_fault(Fault(0, "brownout", 0, 0, 1), machine)
    assert (machine.pc, machine.resets[-1][1]) == (0, "BOR")


@pytest.mark.slow
def test_output_does_not_depend_on_the_number_of_jobs(firmware, capsys):
    """The output is the same for any --jobs, also if the campaign continues from half of its state file."""
    written = []
    for name, jobs in (("one", 1), ("two", 2)):
        words = ["--campaign", firmware / "campaign.toml", "--jobs", jobs, "--out", firmware / f"{name}.csv"]
        words += ["--state", firmware / f"{name}.state", "--json"]
        assert main([str(word) for word in ["inject", firmware / "main.elf", *words]]) == 0
        written.append(((firmware / f"{name}.csv").read_bytes(), capsys.readouterr().out))
    assert written[0] == written[1]
    validated("emu", "inject", written[0][1])
    words = ["inject", firmware / "main.elf", "--campaign", firmware / "campaign.toml", "--only", 0, "--json"]
    assert main([str(word) for word in words]) == 0
    assert validated("emu", "inject-only", capsys.readouterr().out)["number"] == 0
    state = firmware / "one.state"
    text = state.read_text()
    state.write_text(text[: len(text) // 2])
    words = ["inject", firmware / "main.elf", "--campaign", firmware / "campaign.toml", "--out", firmware / "three.csv"]
    assert main([str(word) for word in [*words, "--state", state]]) == 0
    assert (firmware / "three.csv").read_bytes() == written[0][0]
    rows = list(csv.DictReader((firmware / "one.csv").open()))
    assert [int(row["number"]) for row in rows] == list(range(24))
    assert {row["outcome"] for row in rows} <= set(OUTCOMES)
    assert len({row["outcome"] for row in rows}) > 1
    facts = json.loads(written[0][1])["kinds"]["all"]
    assert facts["trials"] == 24 == sum(facts[outcome]["number"] for outcome in OUTCOMES)


def test_choices_follow_from_seed_and_number_and_keep_the_shares(firmware):
    image, campaign = load_image(firmware / "main.elf"), read(firmware / "campaign.toml")
    faults = [choose_fault(n, 5, campaign.faults, image, 100, 200) for n in range(2_600)]
    assert faults == [choose_fault(n, 5, campaign.faults, image, 100, 200) for n in range(2_600)]
    assert all(100 <= fault.cycle < 200 for fault in faults)
    for kind in KINDS:
        share = sum(fault.kind == kind for fault in faults) / 2_600
        assert share == pytest.approx(campaign.faults[kind] / 13, abs=0.04)


def test_intervals_are_wilson_s():
    """Wilson's interval of 12 in 1,000 is 0.69 to 2.09 % (Wilson, 1927)."""
    found = summary(
        [SimpleNamespace(kind="ram", outcome="silent")] * 12 + [SimpleNamespace(kind="ram", outcome="masked")] * 988
    )
    assert found["ram"]["silent"]["low"] == pytest.approx(0.0069, abs=5e-5)
    assert found["all"]["silent"]["high"] == pytest.approx(0.0209, abs=5e-5)


@pytest.mark.parametrize(
    ("old", "new", "line", "expected"),
    [
        ("trials = 24", "trials = 0", 2, "trials: expected a whole number from 1"),
        ("trials = 24\n", "", 1, "trials: expected a whole number"),
        ("seconds = 0.02", "secs = 0.02", 4, "unknown key 'secs'; expected seconds, start, selector, hang"),
        ("start = 0.002", "start = 1", 5, "expected a time before 0.02 s"),
        ('[[0.004, "xxxxxxxx"]]', '[["x", 1]]', 7, "expected a list of"),
        ("[[0.004,", "[[inf,", 7, "from 0 to 3600 s"),
        ("[[0.004,", "[[nan,", 7, "from 0 to 3600 s"),
        ("[[0.004,", f"[[1{'0' * 400},", 7, "from 0 to 3600 s"),
        ('["mismatch"]', '["("]', 9, "expected regular expressions"),
        ("flash = 2", "flash = -1", 13, "flash: expected a whole number from 0"),
        ("flash = 2", "flash = ", 13, "Invalid value"),
        ("flash = 2", f"flash = 0x{'f' * 5000}", 13, "from 0 to 1e+06, not one of 20000 bits"),
    ],
)
def test_errors_are_reported_with_their_line(tmp_path, old, new, line, expected):
    path = tmp_path / "campaign.toml"
    path.write_text(CAMPAIGN.replace(old, new))
    with pytest.raises(CampaignError) as raised:
        read(path)
    assert str(raised.value).startswith(f"{path}:{line}: ")
    assert expected in str(raised.value)


@pytest.mark.parametrize("value", ["[" * 2000, "{a = " * 2000, "9" * 5000], ids=["lists", "tables", "digits"])
def test_values_that_the_parser_gives_up_are_refused(tmp_path, value):
    path = tmp_path / "campaign.toml"
    path.write_text(CAMPAIGN.replace("flash = 2", f"flash = {value}"))
    with pytest.raises(CampaignError, match=re.escape(f"{path}: ")):
        read(path)


def test_the_campaign_of_the_documents_is_one():
    campaign = read(Path(__file__).resolve().parents[3] / "docs" / "examples" / "stress-faults.toml")
    assert (campaign.trials, campaign.seconds) == (400, 3.2)


def test_the_state_of_another_campaign_is_refused(firmware, capsys):
    state = firmware / "other.state"
    state.write_text('{"image": "1", "campaign": "2"}\n')
    words = ["inject", firmware / "main.elf", "--campaign", firmware / "campaign.toml", "--state", state]
    assert main([str(word) for word in words]) == 2
    assert "other.state:1: the state belongs to another image or campaign" in capsys.readouterr().err
