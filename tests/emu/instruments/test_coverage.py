"""Coverage equals a full trace, and third-party tools can read the reports."""

from __future__ import annotations

import itertools
import json
import random
import shutil
import subprocess
from collections import Counter
from xml.etree import ElementTree

import pytest

import emu
from emu.cli import main
from emu.instruments.coverage import Counts, count_executions
from tests.watchdog import HANG
from toolchain.driver import driver

SOURCE = """\
#include <stdio.h>
static int classify(int n)
{
    if (n < 0) {
        return -1;
    }
    if (n > 100) {
        return 2; /* LCOV_EXCL_LINE */
    }
    return n % 2 ? 1 : 0;
}
int __attribute__((noinline)) never(int n)
{
    return n + 1;
}
int (*volatile unused)(int) = never;
volatile int limit = 6;
int main(void)
{
    int sum = limit == 99 ? unused(1) : 0;
    for (int i = 0; i < limit; i++) {
        sum += classify(i);
    }
    printf("%d\\n", sum);
    return 0;
}
"""


@pytest.fixture
def build(tmp_path):
    def make(source, *options):
        path, image = tmp_path / "p.c", tmp_path / "p.elf"
        path.write_text(source)
        assert driver.main(["-g", *options, str(path), "-o", str(image)]) == 0
        return str(image)

    return make


def random_program(seed):
    """Return a program of branches, loops and calls that depend on data."""
    rng = random.Random(seed)
    functions = []
    for number in range(4):
        body = []
        for _ in range(rng.randrange(2, 6)):
            a, b = rng.choice(["x", "y", "total"]), rng.randrange(-20, 60)
            body.append(rng.choice([
                f"if ({a} {rng.choice(['<', '>', '=='])} {b}) {{ y += {rng.randrange(9)}; }} else {{ total ^= x; }}",
                f"for (int i = 0; i < (x & {rng.randrange(1, 8)}); i++) {{ total += y * i; }}",
                f"switch (x & 7) {{ case 1: y = 3; break; case {rng.randrange(2, 7)}: total++; break; default: y--; }}",
                f"total += {f'f{rng.randrange(number)}(y, x)' if number else 'x'};",
                "if (x > y && total & 1 || y == 5) { return total; }",
            ]))  # fmt: skip
        functions.append(f"int f{number}(int x, int y) {{ {' '.join(body)} return x + y; }}")
    calls = " ".join(f"total += f{rng.randrange(4)}({rng.randrange(-9, 90)}, total);" for _ in range(5))
    return "volatile int total; " + "\n".join(functions) + f"\nint main(void) {{ {calls} return total & 0x7F; }}\n"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_what_is_counted_is_what_a_trace_shows(build, tmp_path, seed, level):
    path = build(random_program(seed), level)
    machine = emu.load(path, engine="plain")
    counts = Counts()
    count_executions(machine, counts)
    assert machine.run(cycles=200_000).reason == "halt"
    trace = tmp_path / "trace"
    assert main(["run", path, "--cycles", "200000", "--trace", str(trace)]) == 0
    pcs = [int(line.split()[1], 16) for line in trace.read_text().splitlines()[1:] if line.split()[1].startswith("0x")]
    assert counts.executed == Counter(pcs)
    for pc, count in counts.taken.items():
        ways = Counter(after for before, after in itertools.pairwise(pcs) if before == pc)
        assert sum(ways.values()) - ways[pc + 2] == count
    plain = emu.load(path, engine="plain")
    plain.run(cycles=200_000)
    assert plain.snapshot() == machine.snapshot()


def read_lcov(path):
    return [line.strip() for line in path.read_text().splitlines()]


def test_lines_branches_and_functions(build, tmp_path, capfd):
    path, info, xml = build(SOURCE, "-O0"), tmp_path / "out.info", tmp_path / "out.xml"
    assert main(["coverage", path, "--lcov", str(info), "--cobertura", str(xml), "--seconds", "0.1"]) == 0
    assert "3\n" in capfd.readouterr().out
    lines = read_lcov(info)
    assert f"SF:{tmp_path / 'p.c'}" in lines
    hits = dict(map(int, line[3:].split(",")) for line in lines if line.startswith("DA:"))
    assert (hits[4], hits[5], hits[7], hits[10], hits[14], hits[22], hits[24]) == (6, 0, 6, 6, 0, 6, 1)
    assert 8 not in hits
    assert {"FNDA:6,classify", "FNDA:0,never", "FNDA:1,main"} <= set(lines)
    ways = [line for line in lines if line.startswith("BRDA:4,")]
    assert sorted(way.rsplit(",", 1)[1] for way in ways) == ["0", "6"]
    top = ElementTree.parse(xml).getroot()
    assert {int(one.get("number")): int(one.get("hits")) for one in top.iter("line")} == hits
    assert next(one for one in top.iter("line") if one.get("number") == "4").get("condition-coverage") == "50% (1/2)"
    genhtml = shutil.which("genhtml")
    if genhtml is not None:
        command = [genhtml, "--branch-coverage", "-o", str(tmp_path / "html"), str(info)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=HANG, check=False)
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "html" / "index.html").exists()


def test_counts_of_runs_are_added_and_guarded(build, tmp_path, capfd):
    path, counts = build(SOURCE, "-Os"), tmp_path / "counts.json"
    for times in (1, 2):
        assert main(["coverage", path, "--counts", str(counts), "--seconds", "0.1", "--json"]) == 0
        totals = json.loads(capfd.readouterr().out.splitlines()[-1])
        executed = json.loads(counts.read_text())["executed"]
        assert executed["0"] == times
        assert totals["instructions"]["run"] == len(executed)
    other = build(SOURCE.replace("n > 100", "n > 101"), "-Os")
    assert main(["coverage", other, "--counts", str(counts)]) == 2
    assert "another image" in capfd.readouterr().err
    counts.write_text("[]")
    assert main(["coverage", other, "--counts", str(counts)]) == 2
