"""`python -m toolchain`: commands, exit statuses, messages; failures leave no files (engines.md §10)."""

import json
import subprocess
import sys

import pytest

from toolchain.cli import COMMANDS, main

HELLO = """
    .global __reset, _main, _table
    .section .const,psv,page
    .type _table,@object
    .size _table,4
_table: .word 1, 2
    .section .nbss,bss,near
_v: .space 2
    .text
    .type __reset,@function
    .size __reset,6
__reset:
    mov #_table, w0
    call _main
    .type _main,@function
    .size _main,8
_main:
    mov w0, _v
    bra _main
"""


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hello.s").write_text(HELLO)
    return tmp_path


def test_assemble_link_and_convert(files, capsys):
    """as, ld with map and HEX, hex, size, nm and objdump work on each other's files."""
    assert main(["as", "-g", "hello.s"]) == 0
    assert main(["ld", "hello.o", "-o", "hello.elf", "-Map", "hello.map", "--hex", "both.hex", "--report-mem"]) == 0
    assert main(["hex", "hello.elf"]) == 0
    assert (files / "hello.hex").read_bytes() == (files / "both.hex").read_bytes()
    assert "_main" in (files / "hello.map").read_text()
    capsys.readouterr()
    assert main(["size", "--json", "hello.elf"]) == 0
    row = json.loads(capsys.readouterr().out)["hello.elf"]
    assert (row["const"], row["bss"], row["data"]) == (6, 2, 0)
    assert main(["nm", "--json", "hello.elf"]) == 0
    names = {r["name"]: r for r in json.loads(capsys.readouterr().out)["hello.elf"]}
    assert (names["_main"]["size"], names["_main"]["class"], names["_v"]["class"]) == (8, "T", "b")
    assert main(["objdump", "-S", "-h", "-t", "hello.elf"]) == 0
    text = capsys.readouterr().out
    assert "; hello.s:13  mov #_table, w0" in text
    assert "<_main>:" in text
    assert ".pword 0x104 <__DefaultInterrupt>" in text or "<__DefaultInterrupt>" in text
    assert main(["objdump", "-dr", "--start", "main", "hello.o"]) == 0
    text = capsys.readouterr().out
    assert "R_PIC30_PCREL_BRANCH _main" in text
    assert "call" not in text


def test_size_counts_flash_and_ram_only(files, capsys):
    """`size` counts three bytes per instruction word without configuration words; EEPROM is counted separately."""
    text = HELLO + " .section __FOSC.sec,code\n .pword 1\n .section .eedata,eedata\n .word 1\n"
    (files / "c.s").write_text(text)
    assert main(["as", "c.s"]) == 0
    assert main(["size", "--json", "c.o"]) == 0
    row = json.loads(capsys.readouterr().out)["c.o"]
    assert row == {"code": 5 * 3, "const": 6, "eeprom": 2, "data": 0, "bss": 2}


def test_ld_writes_hex_for_outputs_with_that_suffix(files):
    """`ld` writes Intel HEX if the output's suffix is .hex."""
    assert main(["as", "hello.s", "-o", "h.o"]) == 0
    assert main(["ld", "h.o", "-o", "out.hex"]) == 0
    assert (files / "out.hex").read_text().startswith(":020000040000fa\n")


def test_libraries(files, capsys):
    """`ar` rcs, t, x and d work, and ld finds libraries with -L and -l."""
    (files / "lib.s").write_text(".global _f\n_f: return\n")
    (files / "main.s").write_text(".global __reset\n__reset: call _f\n")
    assert [main(["as", n]) for n in ("lib.s", "main.s")] == [0, 0]
    assert main(["ar", "rcs", "libx.a", "lib.o", "main.o"]) == 0
    assert main(["ar", "d", "libx.a", "main.o"]) == 0
    capsys.readouterr()
    assert main(["ar", "t", "libx.a"]) == 0
    assert capsys.readouterr().out == "lib.o\n"
    assert main(["ld", "main.o", "-L", ".", "-l", "x", "-o", "a.elf"]) == 0
    original = (files / "lib.o").read_bytes()
    (files / "lib.o").unlink()
    assert main(["ar", "x", "libx.a"]) == 0
    assert (files / "lib.o").read_bytes() == original
    assert main(["nm", "lib.o"]) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["as", "missing.s"], "cannot read missing.s: No such file"),
        (["as", "bad.s"], "bad.s:2: error: unknown instruction 'frob'"),
        (["as", "bad.s", "--defsym", "x=y"], "not a number"),
        (["as", "hello.s", "-o", "hello.s"], "overwrite the source"),
        (["as", "hello.s", "-p", "33FJ"], "is not supported (expected"),
        (["as", "hello.s", "-o", "no/such/dir.o"], "cannot write"),
        (["ld"], "no input files"),
        (["ld", "-T", "boot.gld", "undefined.o"], "linker script 'boot.gld' is not used here"),
        (["ld", "hello.s"], "hello.s: not an ELF file"),
        (["ld", "-l", "nothing", "-o", "x"], "cannot find libnothing.a"),
        (["ld", "undefined.o", "-o", "out.elf", "-Map", "out.map"], "undefined symbol _nowhere"),
        (["hex", "undefined.o"], "not an executable"),
        (["size", "hello.s"], "not an ELF file"),
        (["nm", "bad.s"], "not an ELF file"),
        (["objdump", "undefined.o"], "nothing to show"),
        (["objdump", "-d", "--start", "zz", "undefined.o"], "no symbol is called zz"),
        (["ar", "p", "x.a"], "expected one of"),
        (["ar", "t", "x.a"], "no such archive"),
        (["bounds", "undefined.o"], "not an executable"),
        (["frobnicate"], "unknown command 'frobnicate'"),
    ],
)
def test_bad_input_is_one_clear_message_and_status_2(files, capsys, arguments, message):
    """Bad input gives one message and exit status 2, without traceback or output file (engines.md §10)."""
    (files / "bad.s").write_text(" nop\n frob\n")
    (files / "u.s").write_text(".global __reset\n__reset: call _nowhere\n")
    assert main(["as", "u.s", "-o", "undefined.o"]) == 0
    before = {p.name for p in files.iterdir()}
    capsys.readouterr()
    assert main(arguments) == 2
    assert message in capsys.readouterr().err
    assert {p.name for p in files.iterdir()} == before


@pytest.mark.parametrize("command", [name for name in COMMANDS if name not in ("cc", "c++")])
def test_every_command_explains_itself_with_an_example(command, capsys):
    """`--help` of every command contains an example; an unknown option ends with status 2."""
    with pytest.raises(SystemExit) as done:
        main([command, "--help"])
    assert done.value.code == 0
    assert f"example: python -m toolchain {command}" in capsys.readouterr().out
    with pytest.raises(SystemExit) as done:
        main([command, "--frob"])
    assert done.value.code == 2


def test_the_module_runs_as_a_program(files):
    """`python -m toolchain` runs from a shell and accepts standard input as source."""
    done = subprocess.run(
        [sys.executable, "-m", "toolchain", "as", "-", "-o", "x.o"],
        input="nop\n",
        text=True,
        capture_output=True,
        cwd=files,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (files / "x.o").stat().st_size > 100
    done = subprocess.run([sys.executable, "-m", "toolchain"], capture_output=True, text=True, cwd=files)
    assert done.returncode == 2
    assert "cc" in done.stdout
