"""-fshort-double and --xc16-defaults: double has 32 bits, in the language, the library and between objects."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run
from toolchain import cli
from toolchain.frontend.short_double import rename

PROGRAM = r"""
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <float.h>
double twice(double x) { return 2 * x; }
volatile double v = 0.5, big = 1e6; volatile long double lv = 0.25L; volatile float fv = 1.5f; volatile int n = -7;
int main(void) {
  if (sizeof(double) != 4 || sizeof(long double) != 4 || DBL_MANT_DIG != 24) return 1;
  if (fabs(sin(v) - 0.47942554f) > 1e-7 || fabs(pow(v, 3) - .125) > 1e-7 ||
      atan2(v, v) < .785 || sqrtl(lv) != .5) return 2;
  if (fabs((double)n) != 7 || (int)twice(n) != -14 || fabs(sin(big) + 0.3499935) > 1e-6) return 3;
  char t[60]; snprintf(t, 60, "%g %.3f %d %e %ld %s", v, fv * 1.0, 42, big, 7L, "end");
  puts(t);
  double d; float f; int k;
  if (sscanf("1.25 2.5 9", "%lf %f %d", &d, &f, &k) != 3 || d != 1.25 || f != 2.5f || k != 9) return 4;
  if (strtod("3.5x", 0) != 3.5 || atof("-2") != -2) return 5;
  double (*fp)(double) = cos; double w;
  if (fabs(fp(0) - 1) > 1e-7 ||
      modf(2.5, &w) != .5 || w != 2 || frexp(8, &k) != .5 || ldexp(v, 3) != 4) return 6;
  return 0; }
"""


@pytest.mark.parametrize("options", [("-O0", "-fshort-double"), ("-Os", "--xc16-defaults", "-fno-lto")], ids=" ".join)
def test_language_and_library(options: tuple[str, ...], tmp_path: Path) -> None:
    """The program returns 0, otherwise the number of its first failing check."""
    (tmp_path / "a.c").write_text(PROGRAM)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", *options)
    assert (built.status, built.messages) == (0, "")
    done = run(tmp_path / "a.elf")
    assert (done.status, done.uart) == (0, b"0.5 1.500 42 1.000000e+06 7 end\n")


def test_separately_compiled_objects(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The link finds the right printf without the option; objects of both kinds cause a warning."""
    monkeypatch.chdir(tmp_path)
    Path("a.c").write_text(
        '#include <stdio.h>\nvolatile double d = 1.5; int main(void) { printf("%g\\n", d); return 0; }\n'
    )
    Path("b.c").write_text("double other(double x) { return x * 2; }\n")
    assert cli.main(["cc", "-c", "-fshort-double", "a.c"]) == 0
    assert cli.main(["cc", "-c", "b.c"]) == 0
    built = build([Path("a.o")], Path("a.elf"))
    assert (built.status, built.messages) == (0, "")
    assert run(Path("a.elf")).uart == b"1.5\n"
    built = build([Path("a.o"), Path("b.o")], Path("b.elf"))
    assert "b.o: warning: its double has 64 bits, that of a.o 32 bits" in built.messages


def test_the_driver_under_the_name_of_xc16_has_its_defaults(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.c").write_text("double d; int main(void) { return sizeof d; }\n")
    for name, size in (("xc16-gcc", 4), ("dspic-cc", 8)):
        monkeypatch.setattr(sys, "argv", [f"/bin/{name}", "-Os", str(tmp_path / "a.c"), "-o", str(tmp_path / "a.elf")])
        assert cli.by_name() == 0
        assert run(tmp_path / "a.elf").status == size


def test_functions_that_the_program_defines_keep_their_names() -> None:
    ir = b"define float @sin(float %0) {\n  %2 = call float @cos(float %0)\n  call void @sin_table()\n}\n"
    ir += b"declare float @cos(float)\n"
    assert rename(ir) == ir.replace(b"@cos(", b"@cosf(")
