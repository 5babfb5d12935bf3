"""complex.h and tgmath.h on the target; the expected values are those of Python's cmath."""

from __future__ import annotations

import cmath
from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

POINT = 0.5 - 0.75j
FUNCTIONS = (
    "sqrt",
    "exp",
    "log",
    "sin",
    "cos",
    "tan",
    "acos",
    "asin",
    "atan",
    "sinh",
    "cosh",
    "tanh",
    "asinh",
    "atanh",
)
CHECKS = "\n".join(
    f"    if (!near(c{name}(z), {value.real!r} + {value.imag!r} * I)) return {number};"
    for number, name in enumerate(FUNCTIONS, 1)
    for value in [getattr(cmath, name)(POINT)]
)
PROGRAM = """
#include <complex.h>
#include <tgmath.h>
static int near(double complex a, double complex b)
{
    return cabs(a - b) <= (sizeof(double) == 8 ? 2e-15 : 1e-6) * (1 + cabs(b));
}
static int nearf(float complex a, float complex b) { return cabsf(a - b) <= 1e-6f * (1 + cabsf(b)); }
int main(void)
{
    volatile double x = 0.5, y = -0.75;
    double complex z = x + y * I;
CHECKS
    if (!near(csqrt(conj(z)), conj(csqrt(z))) || !near(cpow(z, 3.0), z * z * z) || carg(-1.0) < 3.14) return 30;
    if (!near(ccosh(cacosh(z)), z) || !near(csinh(casinh(z)), z) || !near(ctan(catan(z)), z)) return 31;
    float complex w = 0.5f - 0.75f * I;
    if (!nearf(csqrtf(w) * csqrtf(w), w) || !nearf(cexpf(clogf(w)), w) || !nearf(csinf(casinf(w)), w)) return 32;
    volatile float f = 2.25f;
    volatile int n = 4;
    if (sizeof(sqrt(f)) != 4 || sqrt(f) != 1.5f || sqrt(n) != 2 || sizeof(sqrt(n)) != sizeof(double)) return 33;
    if (!near(exp(z), cexp(z)) || pow(f, 2.0f) != 5.0625f) return 34;
    return creal(CMPLX(1, 2)) != 1 || cimag(z) != -.75 || cabs(3 + 4 * I) != 5;
}
""".replace("CHECKS", CHECKS)


@pytest.mark.slow
@pytest.mark.parametrize("options", [("-Os",), ("-O0", "-fshort-double")], ids=" ".join)
def test_complex_functions(options: tuple[str, ...], tmp_path: Path) -> None:
    """The program returns 0, otherwise the number of its first failing check."""
    (tmp_path / "a.c").write_text(PROGRAM)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", *options)
    assert (built.status, built.messages) == (0, "")
    assert run(tmp_path / "a.elf").status == 0
