"""Classes of floating-point numbers (`llvm.is.fpclass`): NaN, infinity, normal, subnormal and zero, by their bits."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

PROGRAM = """
typedef union { FLOAT value; BITS bits; } Number;
#define TOP ((BITS)1 << FRACTION)
#define INFINITE ((BITS)EXPONENTS << FRACTION)
volatile BITS magnitudes[] = {
    0, 1, TOP - 1, TOP, TOP + 1, (BITS)(EXPONENTS / 2) << FRACTION, INFINITE - 1, INFINITE, INFINITE + 1,
    INFINITE + TOP / 2, INFINITE + TOP - 1,
};
int main(void)
{
    for (int k = 0; k < 2 * sizeof magnitudes / sizeof magnitudes[0]; k++) {
        BITS m = magnitudes[k / 2];
        Number n = {.bits = m | (BITS)(k & 1) << (8 * sizeof(BITS) - 1)};
        FLOAT x = n.value;
        int is_nan = m > INFINITE, is_normal = m >= TOP && m < INFINITE, is_small = m && m < TOP;
        if (!__builtin_isnan(x) != !is_nan) return 1;
        if (!__builtin_isinf(x) != (m != INFINITE)) return 2;
        if (!__builtin_isfinite(x) != (m >= INFINITE)) return 3;
        if (!__builtin_isnormal(x) != !is_normal) return 4;
        if (!__builtin_issubnormal(x) != !is_small) return 5;
        if (!__builtin_iszero(x) != (m != 0)) return 6;
        if (!__builtin_issignaling(x) != !(is_nan && m < INFINITE + TOP / 2)) return 7;
        int class = is_nan ? 1 : m == INFINITE ? 2 : is_normal ? 3 : m ? 4 : 5;
        if (__builtin_fpclassify(1, 2, 3, 4, 5, x) != class) return 8;
        if (__builtin_isinf_sign(x) != (m == INFINITE ? (k & 1 ? -1 : 1) : 0)) return 9;
    }
    return 0;
}
"""


@pytest.mark.parametrize(
    ("name", "bits", "fraction", "exponents"),
    [("float", "unsigned long", 23, 255), ("long double", "unsigned long long", 52, 2047)],
)
def test_each_number_has_one_class(name: str, bits: str, fraction: int, exponents: int, tmp_path: Path) -> None:
    """Numbers at the edges of the classes, of both signs, get the class that their bits say."""
    (tmp_path / "a.c").write_text(PROGRAM)
    defines = {"FLOAT": name, "BITS": bits, "FRACTION": fraction, "EXPONENTS": exponents}
    built = build(
        [tmp_path / "a.c"], tmp_path / "a.elf", "-O1", *(f"-D{key}={value}" for key, value in defines.items())
    )
    assert built.status == 0, built.messages
    assert run(tmp_path / "a.elf").status == 0
