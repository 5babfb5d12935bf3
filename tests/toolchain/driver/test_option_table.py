"""The table of options: every row acts as it says, the documentation is the table, and MPLAB X's command lines work."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest

from toolchain import cli
from toolchain.errors import ToolError
from toolchain.frontend import option_table
from toolchain.frontend.option_table import CLANG, DRIVER, IGNORED, REFUSED, TABLE, OptionRow, row_of
from toolchain.frontend.options import CcOptions, parse

PAGE = Path(__file__).parents[3] / "docs" / "xc16-options.md"
VALUES = {"-mcpu=<device>": "-mcpu=30F4013", "-p<device>": "-p30F4013", "-O[<level>]": "-O2", "-x[ ]<language>": "-xc",
          "-Wp,<options>": "-Wp,-DA", "-Wa,<options>": "-Wa,-g", "-Wl,<options>": "-Wl,--gc-sections"}  # fmt: skip


def parsed(words: list[str], folder: Path) -> CcOptions:
    """Options of a command line with one source; `output` and `inputs` are not compared."""
    source = folder / "main.c"
    source.touch()
    return replace(parse([*words, str(source)]), inputs=[], output=None)


def words_of(row: OptionRow) -> list[str]:
    words = [VALUES[row.spelling]] if row.spelling in VALUES else row.example()
    return ["-Xpreprocessor", "-DA"] if words[0] == "-Xpreprocessor" else (
        ["-Xassembler", "-g"] if words[0] == "-Xassembler" else words)  # fmt: skip


@pytest.mark.parametrize("row", TABLE, ids=lambda row: row.spelling)
def test_every_row_acts_as_it_says(row: OptionRow, tmp_path: Path) -> None:
    """Ignored options have no effect, refused ones are errors with their sentence, and the others have an effect."""
    words = words_of(row)
    assert row_of(words[0]) == row
    if row.effect == REFUSED:
        with pytest.raises(ToolError, match="is not supported: ") as caught:
            parsed(words, tmp_path)
        assert row.note in str(caught.value)
        return
    plain, options = parsed([], tmp_path), parsed(words, tmp_path)
    if row.effect == IGNORED:
        assert options == plain
        assert row.note, "an ignored option needs a reason"
    elif row.effect == CLANG:
        assert options.clang + options.dependency == words
    else:
        assert row.effect == DRIVER


def test_the_documentation_is_the_table() -> None:
    """`python -m toolchain.frontend.option_table > docs/xc16-options.md` writes the page."""
    assert PAGE.read_text() == option_table.page()


LEVELS = ["-O0", "-O1", "-O2", "-Os", "-O3"]
COMPILE = ["-msmart-io=1", "-msmart-io=2", "-msmart-io=0", "-Wall", "-msfr-warn=off", "-msfr-warn=on", "-mlarge-code",
           "-mlarge-data", "-msmall-code", "-fast-math", "-mpa=2", "-mpa", "-ext=cci", "-msmart-io-format=\"%f\"",
           "-mno-isr-warn", "-mno-eds-warn", "-fno-short-double", "-fomit-frame-pointer", "-funroll-loops", "-ansi",
           "-fno-ivopts", "-ffunction-sections", "-fdata-sections", "-I\"inc\"", "-I.", "-finline-functions",
           "-falign-functions=2", "-fschedule-insns2", "-std=gnu99", "-pedantic", "-Wno-long-long", "-fno-peephole",
           "-merrata=all", "-mconst-in-code", "-legacy-libc", "-no-legacy-libc",
           "-relaxed-math", "-mafrlcsj"]  # fmt: skip
DEBUG = ["-D__DEBUG", "-D__MPLAB_DEBUGGER_PK3=1", "-D__MPLAB_DEBUGGER_SIMULATOR=1", "-D__MPLAB_DEBUGGER_ICD3=1"]
LINK = ["--stack=16", "--check-sections", "--no-check-sections", "--data-init", "--pack-data", "--handles", "--isr",
        "--no-gc-sections", "--gc-sections", "--fill-upper=0", "--stackguard=16", "--no-force-link", "--smart-io",
        "--heap=64", "--report-mem", "--local-stack", "--warn-section-align", "--cref", "--no-smart-io"]  # fmt: skip


def command_line(number: int) -> list[str]:
    """A command line as MPLAB X writes it: compile, assemble or link, for a release or for a debugger."""
    rng = random.Random(number)
    dfp = rng.choice([[], ["-mdfp=/opt/packs/dsPIC30F_DFP/1.4.1/xc16"]])
    debug = rng.random() < 0.5
    base = ["-mcpu=" + rng.choice(["30F6014A", "30F4013"]), "-omf=elf", "-DXPRJ_default=default"]
    if number % 4 == 0:
        words = [
            "--defsym=__MPLAB_BUILD=1",
            *(["--defsym=__MPLAB_DEBUG=1", "--defsym=__DEBUG=1"] if debug else []),
            "-g",
        ]
        return [*base, "-c", "-Wa,-MD,x.o.d," + ",".join(words) + ",--no-relax", *dfp, "-o", "x.o"]
    if number % 4 == 1:
        words = ["--defsym=__MPLAB_BUILD=1", *rng.sample(LINK, 12)]
        if debug:
            words[1:1] = ["--defsym=__MPLAB_DEBUG=1", "--defsym=__DEBUG=1", "-D__DEBUG=__DEBUG"]
        reserve = ["-mreserve=data@0x800:0x81F", "-mreserve=data@0x820:0x821"] if debug else []
        tail = ["-Map=x.map", "--report-mem", "--memorysummary", "memoryfile.xml"]
        return [*base, "-o", "x.elf", *reserve, *dfp, "-Wl,,," + ",".join(words + tail)]
    words = [*base, "-c", "-MP", "-MMD", "-MF", "x.o.d", "-g", rng.choice(LEVELS)]
    return [
        *words,
        *(rng.sample(DEBUG, 2) if debug else []),
        *rng.sample(COMPILE, rng.randint(1, 9)),
        *dfp,
        "-o",
        "x.o",
    ]


@pytest.mark.parametrize("number", range(200))
def test_generated_command_line_is_taken(number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    options = parsed(command_line(number), tmp_path)
    assert options.stage == ("link" if number % 4 == 1 else "assemble")


@pytest.mark.slow
def test_a_project_of_mplab_x_builds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The lines of a debug build: compile, assemble, link with empty words, convert to HEX, make a library."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "main.c").write_text("#include <xc.h>\nint twice(int);\nint main(void) { return twice(21); }\n")
    (tmp_path / "twice.s").write_text(
        ".global _twice\n.text\n_twice:\n add w0,w0,w0\n.if __MPLAB_BUILD\n return\n.endif\n"
    )
    dfp = "-mdfp=/opt/packs/dsPIC30F_DFP/1.4.1/xc16"
    base = ["-mcpu=30F6014A", "-omf=elf", "-DXPRJ_default=default", "-legacy-libc", dfp]
    lines = [
        ["cc", "main.c", "-o", "main.o", "-c", *base, "-MP", "-MMD", "-MF", "main.o.d", "-g", "-D__DEBUG", "-O0",
         "-msmart-io=1", "-Wall", "-msfr-warn=off", "-fast-math", "-mpa=2", "-Wno-bad-function-cast"],
        ["cc", "twice.s", "-o", "twice.o", "-c", *base, "-Wa,-MD,twice.o.d,--defsym=__MPLAB_BUILD=1,-g,--no-relax"],
        ["ar", "-omf=elf", "-r", "libtwice.a", "twice.o", dfp],
        ["cc", "-o", "a.elf", "main.o", "libtwice.a", *base, "-mreserve=data@0x800:0x81F",
         "-Wl,,,--defsym=__MPLAB_BUILD=1,-D__DEBUG=__DEBUG,--script=p30F6014A.gld,--stack=16,--no-force-link,-Map=a.map"],
        ["hex", "a.elf", "-a", "-omf=elf", dfp],
    ]  # fmt: skip
    for line in lines:
        assert cli.main(line) == 0, line
    assert all((tmp_path / name).exists() for name in ("a.hex", "a.map", "main.o.d"))


def test_questions_about_the_tools(capsys: pytest.CaptureFixture[str]) -> None:
    for word in (
        "-print-prog-name=as",
        "-print-file-name=math.h",
        "-dumpmachine",
        "-dumpversion",
        "-print-search-dirs",
    ):
        assert cli.main(["cc", word]) == 0
    out = capsys.readouterr().out.splitlines()
    assert "as" in out[0]
    assert Path(out[1]).read_text().startswith("/*")
    assert out[2] == "pic30-elf"


def test_formats_of_run_time_strings(tmp_path: Path) -> None:
    """-msmart-io-format=%f links the conversion for formats that the program computes."""
    source = tmp_path / "a.c"
    source.write_text("#include <stdio.h>\nchar format[4];\nint main(void) { return printf(format, 1.5); }\n")
    sizes = []
    for words in ([], ["-msmart-io-format=%f"]):
        assert cli.main(["cc", "-Os", *words, str(source), "-Wno-format-security", "-o", str(tmp_path / "a.elf"),
                         "-Wl,-Map," + str(tmp_path / "a.map")]) == 0  # fmt: skip
        sizes.append("___format_double" in (tmp_path / "a.map").read_text())
    assert sizes == [False, True]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-fnonsense"], "unknown option '-fnonsense'"),
        (["-g--DX=1"], "unknown debug level '-g--DX=1'"),
        (["-O7"], "unknown level '-O7'"),
        (["-Wa,--nonsense"], "unknown option '--nonsense' of the assembler"),
        (["-ffixed-w8"], "save the register around your assembly"),
        (["-omf=coff"], "there is no COFF output"),
    ],
)
def test_wrong_option_is_one_line(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.s").touch()
    assert cli.main(["cc", "-c", *words, str(tmp_path / "a.s"), "-o", str(tmp_path / "a.o")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert message in lines[0]
