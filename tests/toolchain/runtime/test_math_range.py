"""math.h over all exponents and signs, subnormal numbers, infinities and NaN, compared with the host's long double."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run
from tests.toolchain.runtime.test_runtime_on_host import HERE, INCLUDE, RUNTIME, compile_host
from tests.watchdog import HANG

SIGNIFICANDS = 4
TABLE = RUNTIME / "math.md"


def stated_errors() -> dict[str, float]:
    """Largest error of each function in units of the last place, as math.md states it."""
    rows = re.findall(r"^\| `(\w+)` \| ([\d.]+) \| ([\d.]+) \|", TABLE.read_text(), re.MULTILINE)
    return {name: float(error) for f, single, double in rows for name, error in ((f"{f}f", single), (f, double))}


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no host C compiler (Debian package gcc)")
def test_errors_over_all_exponents_are_within_the_table(tmp_path: Path) -> None:
    """No function exceeds the error that math.md states for it, and special values are exact."""
    objects = []
    for name in ("round", "exact", "double", "hyperbolic", "single", "reduce"):
        objects.append(tmp_path / f"math_{name}.o")
        prefix = HERE / "math_prefix.h"
        compile_host(objects[-1], "-include", prefix, "-isystem", INCLUDE, "-c", RUNTIME / f"math_{name}.c")
    program = tmp_path / "range"
    compile_host(program, HERE / "math_range_host.c", *objects, RUNTIME / "f64_pack.c", RUNTIME / "f32_pack.c")
    done = subprocess.run([program, str(SIGNIFICANDS)], capture_output=True, text=True, check=False, timeout=HANG)
    assert done.returncode == 0, done.stdout
    found = {line.split()[0]: float(line.split()[1]) for line in done.stdout.splitlines()}
    stated = stated_errors()
    assert set(found) == set(stated)
    assert {name: error for name, error in found.items() if error > stated[name]} == {}


@pytest.mark.slow
def test_trigonometry_of_large_arguments_on_the_target(tmp_path: Path) -> None:
    """Sine of the largest arguments on the target; the values are those of 60-digit arithmetic, rounded."""
    source = tmp_path / "large.c"
    source.write_text(
        "#include <math.h>\n"
        "static const float f[] = {1e6f, 1e10f, 3e38f};\n"
        "static const float f_want[] = {-0.349993502f, -0.487506025f, 0.874904888f};\n"
        "static const double d[] = {1e16, 1e300, 6381956970095103.0 * 0x1p797};\n"
        "static const double d_want[] = {0.7796880066069788, -0.8178819121159085, 1};\n"
        "int main(void) {\n"
        "    for (int i = 0; i < 3; i++) {\n"
        "        volatile float x = f[i];\n"
        "        volatile double y = d[i];\n"
        "        if (!(fabsf(sinf(x) - f_want[i]) < 1.2e-7f)) return 1 + i;\n"
        "        if (!(fabs(sin(y) - d_want[i]) < 2.3e-16)) return 11 + i;\n"
        "    }\n"
        "    return 0;\n"
        "}\n"
    )
    built = build([source], tmp_path / "large.elf", "-Os")
    assert built.status == 0, built.messages
    assert run(tmp_path / "large.elf").status == 0
