"""Source files of a program with the kernel: in coverage, HTML pages, `emu disasm --source` and the prompt's `list`."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import pytest

import emu
from emu.cli import main
from emu.dap.server import Server
from emu.host.sources import SourceFinder
from emu.prompt.reader import Prompt
from toolchain.driver import driver

ROOT = Path(__file__).resolve().parents[3]
OWN = "int sum(int n)\n{\n    int s = 0;\n    while (n) {\n        s += n--;\n    }\n    return s;\n}\n"
KERNEL = "volatile int ticks;\nvoid tick(void)\n{\n    ticks++;\n}\n"
MAIN = "int sum(int n); void tick(void);\nvolatile int n = 3;\nint main(void)\n{\n    tick();\n    return sum(n);\n}\n"


@pytest.fixture(scope="module")
def image(tmp_path_factory):
    """Return an image whose sources have relative names of a project, and of a kernel that is elsewhere."""
    folder = tmp_path_factory.mktemp("project")
    (folder / "src").mkdir()
    (folder / "build").mkdir()
    (folder / "kernel-elsewhere").mkdir()
    for name, text in (("src/own.c", OWN), ("src/main.c", MAIN), ("kernel-elsewhere/clock.c", KERNEL)):
        (folder / name).write_text(text)
    maps = (f"-ffile-prefix-map={folder}/=", f"-ffile-prefix-map={folder}/kernel-elsewhere=firmware/openswarm/kernel")
    sources = [str(folder / name) for name in ("src/own.c", "src/main.c", "kernel-elsewhere/clock.c")]
    elf = folder / "build" / "firmware.elf"
    assert driver.main(["-g", "-O1", "-fno-inline-functions", *maps, *sources, "-o", str(elf)]) == 0
    return elf


def sources_of(info):
    return [line[3:] for line in info.read_text().splitlines() if line.startswith("SF:")]


def test_reports_name_files_that_exist_wherever_the_command_runs(image, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["coverage", str(image), "--lcov", "out.info", "--seconds", "0.001"]) == 0
    project = image.parents[1]
    assert sources_of(tmp_path / "out.info") == [str(project / "src/main.c"), str(project / "src/own.c")]
    out = capsys.readouterr().out
    assert "src/own.c" in out
    assert "100.0 %" in out
    assert "kernel/clock.c" not in out
    assert main(["coverage", str(image), "--lcov", "out.info", "--seconds", "0.001", "--kernel"]) == 0
    assert str(ROOT / "firmware/openswarm/kernel/clock.c") in sources_of(tmp_path / "out.info")


def test_files_are_selected_by_folder_or_pattern(image, capsys):
    words = ["coverage", str(image), "--seconds", "0.001", "--json"]
    for patterns, names in (
        (["src/"], ["src/main.c", "src/own.c"]),
        (["*/own.c"], ["src/own.c"]),
        (["firmware"], ["firmware/openswarm/kernel/clock.c"]),
    ):
        assert main([*words, *(word for pattern in patterns for word in ("--only", pattern))]) == 0
        facts = json.loads(capsys.readouterr().out.splitlines()[-1])
        assert list(facts["files"]) == names
        assert facts["lines"]["all"] == sum(one["lines"]["all"] for one in facts["files"].values())
        assert 0 < facts["instructions"]["run"] <= facts["instructions"]["all"] < 40
    assert main([*words, "--only", "nothing/"]) == 2
    said = capsys.readouterr().err
    assert "--only nothing/: no source file of" in said
    assert said.endswith(" matches; its own files: src/main.c, src/own.c\n")


def test_pages_show_lines_with_counts(image, tmp_path, capsys):
    folder = tmp_path / "pages"
    assert main(["coverage", str(image), "--seconds", "0.001", "--html", str(folder)]) == 0
    capsys.readouterr()
    index = (folder / "index.html").read_text()
    assert '<a href="1-own.c.html">src/own.c</a>' in index
    page = (folder / "1-own.c.html").read_text()
    counts = dict(re.findall(r"<td>(\d+)</td><td>(\d+)</td>", page))
    assert sum(map(int, counts.values())) > 0
    assert "<pre>        s += n--;</pre>" in page


def test_the_root_is_searched_first(tmp_path):
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "main.c").write_text("")
    finder = SourceFinder("/elsewhere/build/firmware.elf", tmp_path)
    assert finder.find("src/main.c") == (tmp_path / "src/main.c").resolve()
    assert finder.find("src/other.c") is None
    assert finder.path("src/other.c") == tmp_path.resolve() / "src/other.c"
    assert finder.find("openswarm/kernel/event.c") == ROOT / "firmware/openswarm/kernel/event.c"


def test_listings_show_the_kernels_sources(image, tmp_path, monkeypatch, capsys):
    """The kernel's sources are found from any folder, also those of a wheel; the code is in line 4 of `clock.c`."""
    monkeypatch.chdir(tmp_path)
    fourth = (ROOT / "firmware/openswarm/kernel/clock.c").read_text().splitlines()[3]
    assert main(["disasm", str(image), "--source", "--from", "tick"]) == 0
    assert f"clock.c:4: {fourth.strip()}" in capsys.readouterr().out
    prompt = Prompt("emu debug", lambda client: Server(client, lambda _launch: emu.load(image)))
    assert prompt.serve({}, io.StringIO("break tick\nrun\nlist tick\nlist sum\n")) == 0
    shown = capsys.readouterr()
    assert f">    4 {fourth}\n" in shown.out
    assert "s += n--;" in shown.out
    assert shown.err == ""
