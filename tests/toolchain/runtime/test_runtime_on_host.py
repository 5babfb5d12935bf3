"""The run-time library's C sources on the host: soft float compared with the hardware, math with libm.

Each operation is compared for many random pairs and all edge classes. The comparison itself is C, which makes
it fast.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.fuzz.seeds import base_seed
from tests.watchdog import HANG

HERE = Path(__file__).parent
RUNTIME = HERE.parents[2] / "toolchain" / "runtime"
INCLUDE = HERE.parents[2] / "toolchain" / "include"
PAIRS = 400_000
MATH_ARGUMENTS = 100_000

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no host C compiler (Debian package gcc)")


def compile_host(output: Path, *words: object) -> None:
    """Compile with the host's gcc; on failure show its diagnostics."""
    command = [
        "gcc", "-std=gnu11", "-O2", "-fno-builtin", "-ffp-contract=off", *map(str, words), "-o", str(output), "-lm",
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def soft_float_sources() -> list[Path]:
    return sorted([*RUNTIME.glob("f32_*.c"), *RUNTIME.glob("f64_*.c")])


def test_soft_float_equals_the_hardware(tmp_path: Path) -> None:
    """Soft float equals the hardware bit for bit: + - * /, comparisons and conversions, float and double.

    Source: IEC 60559 (C11 annex F).
    """
    program = tmp_path / "softfloat"
    compile_host(program, HERE / "softfloat_host.c", *soft_float_sources())
    done = subprocess.run([program, str(PAIRS)], capture_output=True, text=True, check=False, timeout=HANG)
    assert done.returncode == 0, done.stdout
    lines = done.stdout.splitlines()
    assert len(lines) == 28
    assert all(int(line.split()[1]) >= PAIRS and line.endswith(" 0 failures") for line in lines)


def test_the_comparison_notices_a_wrong_rounding(tmp_path: Path) -> None:
    """The comparison with the hardware detects a wrong rounding of ties."""
    for source in soft_float_sources():
        text = source.read_text().replace("+ 0x3F +", "+ 0x40 +").replace("+ 0x1FF +", "+ 0x200 +")
        (tmp_path / source.name).write_text(text)
    for header in RUNTIME.glob("*.h"):
        shutil.copy(header, tmp_path)
    program = tmp_path / "softfloat"
    compile_host(program, HERE / "softfloat_host.c", *sorted(tmp_path.glob("f*.c")))
    done = subprocess.run([program, "20000"], capture_output=True, text=True, check=False, timeout=HANG)
    assert done.returncode == 1
    assert "addsf3(" in done.stdout


def test_math_functions_stay_within_their_error_bounds(tmp_path: Path) -> None:
    """Math functions stay within the error bounds stated in math_host.c; exact functions are exact (C11 7.12)."""
    objects = []
    for name in ("round", "exact", "double", "hyperbolic", "single", "reduce"):
        objects.append(tmp_path / f"math_{name}.o")
        compile_host(
            objects[-1], "-include", HERE / "math_prefix.h", "-isystem", INCLUDE, "-c", RUNTIME / f"math_{name}.c"
        )
    program = tmp_path / "math"
    compile_host(program, HERE / "math_host.c", *objects, RUNTIME / "f64_pack.c", RUNTIME / "f32_pack.c")
    done = subprocess.run([program, str(MATH_ARGUMENTS)], capture_output=True, text=True, check=False, timeout=HANG)
    assert done.returncode == 0, done.stdout


def digits_program(folder: Path, printing: Path = RUNTIME / "format_double.c") -> Path:
    """Build the program that compares formatting and parsing of doubles with the host's."""
    objects = []
    reading = ["-Dstrtod=rt_strtod", "-Datof=rt_atof", "-Dstrtold=rt_strtold", "-Dstrtof=rt_strtof"]
    for source, words in ((printing, []), (RUNTIME / "strtod.c", reading), (RUNTIME / "strtof.c", reading)):
        objects.append(folder / f"{source.stem}.o")
        compile_host(objects[-1], "-fsanitize=address,undefined", "-I", RUNTIME, *words, "-c", source)
    program = folder / "digits"
    compile_host(program, "-fsanitize=address,undefined", "-I", RUNTIME, HERE / "digits_host.c", *objects)
    return program


@pytest.mark.slow
def test_doubles_are_printed_and_read_exactly(tmp_path: Path) -> None:
    """printf, strtod and strtof give every digit and every number as the host does (C11 7.21.6.1, 7.22.1.3).

    The commit determines the numbers.
    """
    words = [digits_program(tmp_path), "40000", str(base_seed())]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=HANG)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_comparison_of_digits_notices_a_wrong_last_digit(tmp_path: Path) -> None:
    text = (RUNTIME / "format_double.c").read_text()
    assert "next == 5 && !odd" in text
    (tmp_path / "wrong.c").write_text(text.replace("next == 5 && !odd", "next == 5 && odd"))
    words = [digits_program(tmp_path, tmp_path / "wrong.c"), "20000", "1"]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=HANG)
    assert done.returncode == 1
    assert "host [" in done.stdout


@pytest.mark.parametrize("source", [*soft_float_sources(), *sorted(RUNTIME.glob("math_*.c"))], ids=lambda p: p.name)
def test_sources_compile_without_warnings(source: Path, tmp_path: Path) -> None:
    """The sources compile with -Wall -Wextra -Werror.

    The helpers have names of gcc's own functions, whose prototypes differ on the host.
    """
    flags = ["-Wall", "-Wextra", "-Werror", "-Wno-builtin-declaration-mismatch", "-isystem", INCLUDE]
    compile_host(tmp_path / "x.o", *flags, "-c", source)
