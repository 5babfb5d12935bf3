"""Hosted library functions: one program must print the same on the emulator and with the host's library."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

import emu
from tests.toolchain.c_programs import build, run

HERE = Path(__file__).parent


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcc") is None, reason="no host C compiler (Debian package gcc)")
@pytest.mark.parametrize(("name", "level"), [("hosted_text", "-Os"), ("hosted_time", "-O0")])
def test_the_same_as_with_the_hosts_library(name: str, level: str, tmp_path: Path) -> None:
    """Text and time functions print the same as the host's (C11 7.8.2, 7.22.1, 7.22.7, 7.24, 7.27).

    The library itself is always compiled at one level.
    """
    source = HERE / f"{name}.c"
    subprocess.run(["gcc", "-w", "-fno-builtin", source, "-o", tmp_path / "host", "-lm"], check=True)
    host = subprocess.run([tmp_path / "host"], capture_output=True, env={**os.environ, "TZ": "UTC"}, check=True)
    built = build([source], tmp_path / "a.elf", level, "-fno-builtin", "-std=c11", "-Wall")
    assert (built.status, built.messages) == (0, "")
    ran = run(tmp_path / "a.elf", 400_000_000)
    assert ran.status == 0, ran
    assert ran.uart.decode("latin-1").splitlines() == host.stdout.decode("latin-1").splitlines()


EXIT_PROGRAM = """
#include <stdio.h>
#include <stdlib.h>
static void last(void) { putchar('l'); }
static void first(void) { putchar('f'); atexit(last); }
static void never(void) { putchar('n'); }
int main(void)
{
    int registered = 0;
    while (registered < 40 && atexit(registered ? first : last) == 0)
        registered++;
    WAY
}
void unused(void) { never(); }
"""


@pytest.mark.parametrize(
    ("way", "status", "said"),
    [("return registered;", 32, "fl" * 31 + "l"), ("exit(registered + 1);", 33, "fl" * 31 + "l"),
     ("_Exit(3);", 3, ""), ("abort();", 134, "")],
)  # fmt: skip
def test_exit_calls_what_atexit_has_registered(way: str, status: int, said: str, tmp_path: Path) -> None:
    """exit calls the functions of atexit, last registered first, including those registered by a handler.

    _Exit and abort do not (C11 7.22.4.2, 7.22.4.4).
    """
    (tmp_path / "a.c").write_text(EXIT_PROGRAM.replace("WAY", way))
    assert build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os").status == 0
    ran = run(tmp_path / "a.elf")
    assert (ran.status, ran.uart.decode()) == (status, said)


def test_a_program_without_atexit_has_the_start_up_code_without_it(tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text("#include <stdlib.h>\nint main(void) { exit(4); }\n")
    assert build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-Map", str(tmp_path / "a.map")).status == 0
    text = (tmp_path / "a.map").read_text()
    assert "(crt0.o)" in text
    assert "(exit_handlers.o)" not in text


SIGNAL_PROGRAM = """
#include <fenv.h>
#include <locale.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
static volatile sig_atomic_t seen;
static void handler(int number) { seen = number; }
int main(void)
{
    fenv_t environment;
    if (signal(SIGTERM, handler) != SIG_DFL || raise(SIGTERM) || seen != SIGTERM) return 1;
    if (signal(SIGTERM, SIG_IGN) != SIG_DFL || raise(SIGTERM)) return 2;
    if (signal(3, handler) != SIG_ERR || raise(3) == 0) return 8;
    if (getenv("HOME") || system(NULL) || system("ls") != -1 || fopen("a", "r") || tmpfile()) return 3;
    if (strcmp(setlocale(LC_ALL, ""), "C") || setlocale(LC_ALL, "de") || *localeconv()->decimal_point != '.') return 4;
    if (localeconv()->int_n_sign_posn != 127 || strcmp(localeconv()->int_curr_symbol, "")) return 5;
    if (fegetround() != FE_TONEAREST || fesetround(1) == 0 || fegetenv(&environment)) return 6;
    raise(SIGFPE);
    return 7;
}
"""


def test_missing_features_of_the_chip_report_failure(tmp_path: Path) -> None:
    """Functions of missing features report failure: no files, no environment, one locale (C11 7.6, 7.11, 7.14, 7.22.4).

    An unhandled signal ends the program.
    """
    (tmp_path / "a.c").write_text(SIGNAL_PROGRAM)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-Wall")
    assert (built.status, built.messages) == (0, "")
    assert run(tmp_path / "a.elf").status == 128 + 8


INPUT_PROGRAM = """
#include <stdio.h>
#include <string.h>
int main(void)
{
    char line[12], word[6];
    int number;
    if (getchar() != 'x' || ungetc('y', stdin) != 'y' || ungetc('z', stdin) != EOF || fgetc(stdin) != 'y') return 1;
    if (fgets(line, sizeof line, stdin) != line || strcmp(line, " first\\n")) return 2;
    if (fgets(line, 4, stdin) != line || strcmp(line, "sec") || gets(line) != line || strcmp(line, "ond")) return 3;
    if (scanf("%d , %5s", &number, word) != 2 || number != -77 || strcmp(word, "words")) return 4;
    if (fread(line, 2, 2, stdin) != 2 || memcmp(line, "more", 4) || feof(stdin)) return 5;
    return 0;
}
"""
INPUT = b"x first\nsecond\n -77, wordsmore"


def test_standard_input_is_the_first_uart(tmp_path: Path) -> None:
    """Standard input is UART1, through the library's own __getchar (stdio.h)."""
    (tmp_path / "a.c").write_text(INPUT_PROGRAM)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os")
    assert built.status == 0, built.messages
    machine = emu.load(tmp_path / "a.elf", engine="auto")
    for byte in INPUT:
        machine.run(cycles=5000)
        machine.uart[1].feed([byte])
    stop = machine.run(cycles=200_000)
    assert (stop.reason, machine.w[0]) == ("halt", 0)


@pytest.mark.parametrize(
    ("declaration", "statement"),
    [
        ("#include <libpic30.h>", "__C30_UART = 2;"),
        ("int __C30_UART = 2;", ""),
        ("extern int __C30_UART;", "__C30_UART = 2;"),
    ],
)
def test_standard_streams_use_the_selected_uart(declaration: str, statement: str, tmp_path: Path) -> None:
    """With __C30_UART = 2, printf and getchar use UART2; with 1, its default, UART1."""
    (tmp_path / "a.c").write_text(
        f"""#include <stdio.h>
{declaration}
int main(void)
{{
    {statement}
    printf("%d", 42);
    int character = getchar();
    __C30_UART = 1;
    putchar('x');
    return character;
}}
"""
    )
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-Wall")
    assert (built.status, built.messages) == (0, "")
    machine = emu.load(tmp_path / "a.elf", board=None)
    said: dict[int, bytearray] = {1: bytearray(), 2: bytearray()}
    for number, text in said.items():
        machine.uart[number].on_byte = lambda byte, cycle, text=text: text.append(byte)
    machine.run(cycles=20_000)
    machine.uart[2].feed(b"!")
    assert machine.run(cycles=20_000).reason == "halt"
    assert (machine.w[0], bytes(said[1]), bytes(said[2])) == (ord("!"), b"x", b"42")
