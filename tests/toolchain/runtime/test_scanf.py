"""The scanf family on the emulator: sscanf compared with the host's for random formats and inputs, scanf with sscanf.

The host's library accepts an incomplete number ("1e" as 1, "0x" as 0), which C11 7.21.6.2p10 forbids. A separate
test covers these inputs.
"""

from __future__ import annotations

import random
import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

CASES = 70
LENGTHS = {"hh": ("hh", "int8_t"), "": ("h", "int16_t"), "h": ("h", "int16_t"), "l": ("", "int32_t"),
           "ll": ("ll", "int64_t"), "j": ("j", "int64_t")}  # fmt: skip
"""Length modifiers on the target, with those of host types of equal size."""
INTEGERS = ["0", "1", "7", "42", "99", "123", "0x0", "0xab", "0X1F", "017", "08", "099", "-", "+", "x", "5x"]
NUMBERS = [
    "1", "1.5", ".5", "5.", ".", "1e5", "1e-3", "1E+2x", "inf", "infinity", "na", "in", "x", "0x1p3", "0x.8", "1..2",
    "1e5e5", "0", "0.0", "123456.789", "nan",
]  # fmt: skip
SETS = ["[a-z]", "[^a-z]", "[]x]", "[^]x]", "[abc-]", "[0-9a]", "[%-]", "[^ ]", "[-a]", "[^^]", "[x^]"]
INCOMPLETE = {  # (format, input): result by C11 7.21.6.2p10
    ("%f", "100ergs"): 0, ("%f", "1e+"): 0, ("%f", "0x1.8p "): 0, ("%f", "infi"): 0, ("%f", "nan(1"): 0,
    ("%f", "nan(12)"): 1,
    ("%f", "0x"): 0,
    ("%f", "0xi"): 0, ("%3f", "1e5"): 1, ("%2f", "1e5"): 0, ("%i", "0x"): 0, ("%x", "0xg"): 0, ("%2x", "0x12"): 0,
    ("%x", "0y"): 1, ("%d", "0x"): 1, ("%f", "00x"): 1, ("%3c", "ab"): 0,
}  # fmt: skip

HEAD = """
#include <stdio.h>
#include <stdint.h>
#include <string.h>
static void bytes(const void *from, int count)
{
    const unsigned char *at = from;
    while (count--)
        printf("%02x", *at++);
    putchar(' ');
}
static void number(double value) /* long double has another size there */
{
    if (value != value)
        printf("nan ");
    else
        bytes(&value, 8);
}
"""
SOURCE = """
static const char *source;
int __getchar(void) { return *source ? (unsigned char)*source++ : EOF; }
"""


@dataclass
class Case:
    """One call: formats for target and host, its input, and type and size of each stored object."""

    ours: str = ""
    host: str = ""
    text: str = ""
    stores: list[tuple[str, int]] = field(default_factory=list)

    def add(self, ours: str, host: str, text: str) -> None:
        self.ours += ours
        self.host += host
        self.text += text


def random_case(rng: random.Random) -> Case:
    case = Case()
    for _ in range(rng.randint(1, 4)):
        space = rng.choice(["", "", " ", "\t", "\n "])
        case.add(space, space, rng.choice(["", " ", "  ", "\t"]))
        star = "*" if rng.random() < 0.15 else ""
        width = rng.choice(["", "", "1", "5", "10"])
        kind = rng.choice("iiiffscn[%")
        length = rng.choice(list(LENGTHS))
        host_length, integer = LENGTHS[length]
        letter = rng.choice({"i": "diuoxX", "f": "fegEGaF"}.get(kind, kind))
        if kind == "i":
            case.add(f"%{star}{width}{length}{letter}", f"%{star}{width}{host_length}{letter}",
                     rng.choice(["", "-", "+"]) + rng.choice(INTEGERS))  # fmt: skip
            stored = (integer, 0)
        elif kind == "f":
            length = rng.choice(["", "l", "L"])
            form = f"%{star}{rng.choice(['', '12'])}{length}{letter}"
            case.add(form, form, rng.choice(["", "-"]) + rng.choice(NUMBERS))
            stored = ({"": "float", "l": "double", "L": "long double"}[length], -1)
        elif kind == "n":
            star = ""
            case.add(f"%{length}n", f"%{host_length}n", "")
            stored = (integer, 0)
        elif kind == "%":
            literal = rng.choice(["%%", "abc", ",", "-", "x "])
            case.add(literal, literal, rng.choice([literal.replace("%%", "%"), literal[:1], "", "q"]))
            continue
        else:
            conversion = (
                f"%{star}{rng.choice(['', '1']) if kind == 'c' else width}{rng.choice(SETS) if kind == '[' else kind}"
            )
            case.add(conversion, conversion, "".join(rng.choice("abcxyz019-]^%") for _ in range(rng.randint(1, 7))))
            stored = ("char", 24)
        if not star:
            case.stores.append(stored)
    if rng.random() < 0.2:
        case.text = case.text[: rng.randint(0, len(case.text))].rstrip("xXeEpPi+-.(")
    return case


def quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace("\n", "\\n").replace("\t", "\\t") + '"'


def program(cases: list[Case], functions: list[str], host: bool) -> str:
    """Return a program that prints a line per case and function: result and stored bytes, 0x55 for bytes not stored."""
    bodies = []
    for number, case in enumerate(cases):
        for function in functions:
            objects, arguments, shown = "", "", ""
            for i, (kind, size) in enumerate(case.stores):
                array = f"[{size}]" if size > 0 else ""
                objects += f"    {kind} v{i}{array}; memset(&v{i}, 0x55, sizeof v{i});\n"
                arguments += f", (void *)&v{i}"
                whole = f"bytes(&v{i}, {min(size, 12) or f'sizeof v{i}'});"
                same = f"memcmp(&v{i}, &unset, sizeof v{i} > 10 ? 10 : sizeof v{i})"
                shown += f"    {whole}\n" if size >= 0 else (
                    f'    {{ {kind} unset; memset(&unset, 0x55, sizeof unset); '
                    f'if ({same}) number(v{i}); else printf("unset "); }}\n'
                )  # fmt: skip
            form = quoted(case.host if host else case.ours)
            call = (
                f"sscanf({quoted(case.text)}, {form}{arguments})"
                if function == "sscanf"
                else f"scanf({form}{arguments})"
            )
            if function == "scanf":
                objects += f"    source = {quoted(case.text)}; clearerr(stdin); while (getchar() != EOF) {{}}\n"
                objects += f"    source = {quoted(case.text)}; clearerr(stdin);\n"
            bodies.append(f"static __attribute__((noinline)) void c{number}_{function}(void)\n{{\n"
                          f"{objects}    int n = {call};\n"
                          f'    printf("%d ", n);\n{shown}    putchar(10);\n}}\n')  # fmt: skip
    calls = "".join(f"    c{number}_{function}();\n" for number in range(len(cases)) for function in functions)
    source = SOURCE if "scanf" in functions else ""
    return f"{HEAD}{source}{''.join(bodies)}int main(void)\n{{\n{calls}    return 0;\n}}\n"


def answers(cases: list[Case], functions: list[str], folder: Path, level: str) -> list[str]:
    (folder / "ours.c").write_text(program(cases, functions, host=False))
    built = build([folder / "ours.c"], folder / "ours.elf", level, "-w")
    assert built.status == 0, built.messages
    ran = run(folder / "ours.elf", 200_000_000)
    assert ran.status == 0, ran
    return ran.uart.decode("latin-1").splitlines()


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcc") is None, reason="no host C compiler (Debian package gcc)")
def test_scanf_and_sscanf_store_what_the_hosts_does(tmp_path: Path) -> None:
    """sscanf returns and stores the same bytes as the host's (C11 7.21.6.2), and scanf the same from a stream.

    The cases use every conversion, length, width, suppression, set and %n; scanf also reads incomplete numbers.
    """
    rng = random.Random("scan")
    cases = [random_case(rng) for _ in range(CASES)]
    (tmp_path / "host.c").write_text(program(cases, ["sscanf"], host=True))
    subprocess.run(["gcc", "-w", tmp_path / "host.c", "-o", tmp_path / "host"], check=True)
    host = subprocess.run([tmp_path / "host"], capture_output=True, check=True).stdout.decode("latin-1").splitlines()
    for form, text in INCOMPLETE:
        cases.append(Case(form, form, text, [("float", -1) if form.endswith("f") else ("char", 24)]))
    lines = answers(cases, ["sscanf", "scanf"], tmp_path, "-Os")
    texts, streams = lines[::2], lines[1::2]
    differing = [(case, a, b) for case, a, b in zip(cases[:CASES], host, texts[:CASES], strict=True) if a != b]
    differing += [(case, text, stream) for case, text, stream in zip(cases, texts, streams, strict=True)
                  if text.split(" ", 1) != stream.split(" ", 1) and "3c" not in case.ours]  # fmt: skip
    assert differing == []


def test_an_incomplete_number_is_no_number(tmp_path: Path) -> None:
    """An incomplete number does not match: "100ergs" contains no %f, because "100e" is no number (C11 7.21.6.2p10)."""
    cases = [
        Case(form, form, text, [("float", -1) if form.endswith("f") else ("char", 24)]) for form, text in INCOMPLETE
    ]
    got = [int(line.split()[0]) for line in answers(cases, ["sscanf"], tmp_path, "-Os")]
    assert got == list(INCOMPLETE.values())


SCANF = """
#include <stdio.h>
int main(void)
{
    int a = 0, b = 0; long l; long long w; char s[20], t[20], c[4] = {0}; float f; double d; unsigned char h;
    unsigned x; int n;
    n = sscanf("  12 -34 0x56 abc", "%d%d %x %s", &a, &b, &x, s);
    printf("%d %d %d %u %s\\n", n, a, b, x, s);
    n = sscanf("D,100,-200\\r\\n", "D,%d,%d", &a, &b);
    printf("%d %d %d\\n", n, a, b);
    n = sscanf("3.25,-1e3 99999999999x", "%f,%lf%lld%n", &f, &d, &w, &a);
    printf("%d %f %f %ld%05ld %d\\n", n, (double)f, d, (long)(w / 100000), (long)(w % 100000), a);
    n = sscanf("key=va lue;123", "%[a-z]=%[^;];%2hhu", s, t, &h);
    printf("%d [%s][%s]%u\\n", n, s, t, h);
    n = sscanf("abcdef", "%3c%ln%*s", c, &l);
    printf("%d %s %ld\\n", n, c, l);
    printf("%d", sscanf("", "%d", &a));
    printf("%d", sscanf("x", "%d", &a));
    printf("%d\\n", sscanf("5%", "%d%%", &a));
    n = sscanf("010 0x1f ]y", "%i %i %[]x]", &a, &b, s);
    printf("%d %d %d %s\\n", n, a, b, s);
    return 0;
}
"""
SCANNED = """\
4 12 -34 86 abc
2 100 -200
3 3.250000 -1000.000000 99999999999 21
3 [key][va lue]12
1 abc 3
-101
3 8 31 ]
"""


@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_scanf_reads_what_c_says(level: str, tmp_path: Path) -> None:
    """scanf reads as C11 7.21.6.2 says; the expected text is the output of a hosted C library for the same program."""
    (tmp_path / "main.c").write_text(SCANF)
    assert build([tmp_path / "main.c"], tmp_path / "main.elf", level).status == 0
    assert run(tmp_path / "main.elf").uart.decode() == SCANNED
