"""The DSP library on the emulator, compared with the exact model dsp_model.py: random vectors, lengths,
coefficients."""

from __future__ import annotations

import cmath
import math
import random
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.toolchain.runtime import dsp_model as model
from tests.toolchain.runtime.dsp_target import Target

ROUNDS = 4


@pytest.fixture(scope="module")
def target(tmp_path_factory: pytest.TempPathFactory) -> Target:
    return Target(tmp_path_factory.mktemp("dsp"))


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> random.Random:
    return random.Random(f"dsp {request.node.name}")


def vector(rng: random.Random, n: int, size: int = 32768) -> list[int]:
    """Return random fractions, many of them at the ends of the range."""
    return [rng.choice((-size, size - 1)) if rng.random() < 0.1 else rng.randrange(-size, size) for _ in range(n)]


ELEMENTWISE = {
    "VectorAdd": lambda a, b: model.truncated(model.load(a) + model.load(b)),
    "VectorSubtract": lambda a, b: model.truncated(model.load(a) - model.load(b)),
    "VectorMultiply": lambda a, b: model.rounded(model.product(a, b)),
    "VectorWindow": lambda a, b: model.rounded(model.product(a, b)),
}


@pytest.mark.parametrize("name", ELEMENTWISE)
def test_two_vectors_element_by_element(name: str, target: Target, rng: random.Random) -> None:
    for n in [1, 2, *(rng.randrange(3, 60) for _ in range(ROUNDS))]:
        a, b = vector(rng, n), vector(rng, n)
        want = [ELEMENTWISE[name](p, q) for p, q in zip(a, b, strict=True)]
        assert target.filled(name, n, (n, target.x(0), target.x(200, a), target.y(0, b)), target.x(0)) == want
        in_place = target.x(200, a)
        assert target.filled(name, n, (n, in_place, in_place, target.x(300, b)), in_place) == want


def test_one_vector_element_by_element(target: Target, rng: random.Random) -> None:
    for n in [1, 2, *(rng.randrange(3, 60) for _ in range(ROUNDS))]:
        a, factor = vector(rng, n), vector(rng, 1)[0]
        dst = target.y(0)
        negated = target.filled("VectorNegate", n, (n, dst, target.x(0, a)), dst)
        assert negated == [model.fraction(-v) for v in a]
        scaled = target.filled("VectorScale", n, (n, dst, target.x(0, a), factor), dst)
        assert scaled == [model.rounded(model.product(v, factor)) for v in a]
        assert target.filled("VectorCopy", n, (n, dst, target.x(0, a)), dst) == a
        zeros = rng.randrange(5)
        padded = target.filled("VectorZeroPad", n + zeros + 1, (n, zeros, dst, target.x(0, a)), dst)
        assert padded[:-1] == a + [0] * zeros


@pytest.mark.parametrize("places", ["xx", "xy", "yx", "yy"])
def test_sums_of_products(places: str, target: Target, rng: random.Random) -> None:
    for n in [1, 2, *(rng.randrange(3, 200) for _ in range(ROUNDS))]:
        a, b = vector(rng, n), vector(rng, n)
        put = {"x": target.x, "y": target.y}
        at = put[places[0]](0, a), put[places[1]](250, b)
        assert target.value("VectorDotProduct", n, *at) == model.rounded(model.dot(a, b))
        assert target.value("VectorPower", n, at[0]) == model.rounded(model.dot(a, a))


def test_nothing_is_read_behind_the_end_of_memory(target: Target, rng: random.Random) -> None:
    """The library reads nothing beyond its vectors: an additional prefetch above Y RAM would be an address error."""
    y_end = target.machine.chip.data["yram"].end
    for n in (1, 2, 8):
        a, b = vector(rng, n), vector(rng, n)
        at = target.put(y_end - 2 * n, b)
        assert target.value("VectorDotProduct", n, target.x(0, a), at) == model.rounded(model.dot(a, b))
    for log2n in (1, 2, 5):
        data = pairs(vector(rng, 2 << log2n, 16384))
        target.call("TwidFactorInit", log2n, target.x(512), 0)
        at = target.put(y_end - (4 << log2n), flat(data))
        want = model.fft(data, pairs(target.at(target.x(512), 1 << log2n)))
        assert pairs(target.filled("FFTComplexIP", 2 << log2n, (log2n, at, target.x(512), 0xFF00), at)) == want
        target.call("SquareMagnitudeCplx", 1 << log2n, at, target.x(0))
    k, gain = vector(rng, 10, 9000), 16384
    canonic = target.struct(0, [1, target.x(600, k), 0xFF00, target.put(y_end - 8, [0] * 4), gain, 0])
    want = model.iir_canonic([900, 800], k, [0] * 4, gain, 0)
    assert target.filled("IIRCanonic", 2, (2, target.x(0), target.x(9, [900, 800]), canonic), target.x(0)) == want


def test_the_last_of_equal_extremes(target: Target, rng: random.Random) -> None:
    for n in [1, 2, 3, *(rng.randrange(3, 40) for _ in range(ROUNDS))]:
        a = [rng.choice((-32768, -7, 0, 7, 32767)) for _ in range(n)]
        for name, best in (("VectorMax", max(a)), ("VectorMin", min(a))):
            assert target.value(name, n, target.x(0, a), target.y(0)) == best
            assert target.at(target.y(0), 1) == [n - 1 - a[::-1].index(best)]


def test_convolution_and_correlation(target: Target, rng: random.Random) -> None:
    for _ in range(ROUNDS):
        m = rng.randrange(1, 20)
        n = m + rng.randrange(20)
        a, b = vector(rng, n), vector(rng, m)
        for name, h in (("VectorConvolve", b), ("VectorCorrelate", b[::-1])):
            want = [
                model.rounded(model.dot(a[lo : hi + 1], [h[i - k] for k in range(lo, hi + 1)]))
                for i in range(n + m - 1)
                for lo, hi in [(max(0, i - m + 1), min(i, n - 1))]
            ]
            dst = target.y(0)
            assert target.filled(name, n + m - 1, (n, m, dst, target.x(0, a), target.x(300, b)), dst) == want


def test_matrices(target: Target, rng: random.Random) -> None:
    for _ in range(ROUNDS):
        rows, inner, columns = (rng.randrange(1, 9) for _ in range(3))
        a, b = vector(rng, rows * inner), vector(rng, inner * columns)
        want = [
            model.rounded(model.dot(a[r * inner : (r + 1) * inner], b[c::columns]))
            for r in range(rows)
            for c in range(columns)
        ]
        dst, at = target.y(0), (target.x(0, a), target.x(300, b))
        assert target.filled("MatrixMultiply", rows * columns, (rows, inner, columns, dst, *at), dst) == want
        turned = target.filled("MatrixTranspose", rows * inner, (rows, inner, dst, at[0]), dst)
        assert turned == [a[r * inner + c] for c in range(inner) for r in range(rows)]
        square = vector(rng, rows * rows)
        same = target.x(0, square)
        turned = target.filled("MatrixTranspose", rows * rows, (rows, rows, same, same), same)
        assert turned == [square[r * rows + c] for c in range(rows) for r in range(rows)]
        other = vector(rng, rows * inner)
        for name, of in (("MatrixAdd", "VectorAdd"), ("MatrixSubtract", "VectorSubtract")):
            got = target.filled(name, rows * inner, (rows, inner, dst, target.x(0, a), target.x(300, other)), dst)
            assert got == [ELEMENTWISE[of](p, q) for p, q in zip(a, other, strict=True)]
        scaled = target.filled("MatrixScale", rows * inner, (rows, inner, dst, target.x(0, a), other[0]), dst)
        assert scaled == [model.rounded(model.product(v, other[0])) for v in a]


def fir_filter(target: Target, rng: random.Random, h: list[int], delay: int) -> int:
    """Return a FIRStruct with coefficients in X RAM or in program memory."""
    base, page = target.coefficients(h, rng.random() < 0.5)
    at = target.filter
    target.call("FIRStructInit", at, len(h), base, page, target.y(512))
    target.put(target.y(512), [rng.randrange(-9, 9) for _ in range(delay)])
    return at


def test_fir_filters(target: Target, rng: random.Random) -> None:
    for taps in [1, 2, 3, *(rng.randrange(4, 60) for _ in range(ROUNDS))]:
        h = vector(rng, taps, 20000)
        at = fir_filter(target, rng, h, taps)
        target.call("FIRDelayInit", at)
        past = [0] * 100
        for _ in range(3):  # each call continues with the state of the last
            n = rng.randrange(1, 30)
            x = vector(rng, n)
            dst = target.x(0)
            assert target.filled("FIR", n, (n, dst, target.x(300, x), at), dst) == model.fir(x, h, past)


def test_fir_rate_changers(target: Target, rng: random.Random) -> None:
    for _ in range(ROUNDS):
        rate, n = rng.randrange(1, 6), rng.randrange(1, 12)
        h = vector(rng, rate * rng.randrange(1, 8), 20000)
        at = fir_filter(target, rng, h, len(h))
        target.call("FIRDelayInit", at)
        past = [0] * 100
        for _ in range(2):
            x, dst = vector(rng, n * rate), target.x(0)
            want = model.fir_decimate(x, h, past, rate)
            assert target.filled("FIRDecimate", n, (n, dst, target.x(300, x), at, rate), dst) == want
        at = fir_filter(target, rng, h, len(h))
        # the delay line of an interpolator has one word for every `rate` coefficients
        target.call("FIRInterpDelayInit", at, rate)
        past = [0] * 100
        for _ in range(2):
            x, dst = vector(rng, n), target.x(0)
            want = model.fir_interpolate(x, h, past, rate)
            assert target.filled("FIRInterpolate", n * rate, (n, dst, target.x(300, x), at, rate), dst) == want


def test_fir_lattice(target: Target, rng: random.Random) -> None:
    for order in [1, 2, *(rng.randrange(3, 20) for _ in range(ROUNDS))]:
        k, before = vector(rng, order), [0] * order
        at = fir_filter(target, rng, k, order)
        target.call("FIRDelayInit", at)
        for _ in range(2):
            n = rng.randrange(1, 20)
            x, dst = vector(rng, n, 9000), target.x(0)
            want = model.fir_lattice(x, k, before)
            assert target.filled("FIRLattice", n, (n, dst, target.x(300, x), at), dst) == want


@pytest.mark.parametrize("normalised", [False, True])
def test_adaptive_filters(normalised: bool, target: Target, rng: random.Random) -> None:
    for taps in [2, 3, *(rng.randrange(4, 30) for _ in range(ROUNDS))]:
        h = vector(rng, taps, 9000)
        base = target.x(400, h)
        target.call("FIRStructInit", target.filter, taps, base, 0xFF00, target.y(512))
        target.call("FIRDelayInit", target.filter)
        past, mu, energy = [0] * 60, rng.randrange(1, 9000), [0]
        target.put(target.y(0), energy)
        n = rng.randrange(1, 40)
        x, wanted, dst = vector(rng, n, 9000), vector(rng, n, 20000), target.x(0)
        args = [n, dst, target.x(200, x), target.filter, target.y(200, wanted), mu]
        want = model.fir_lms(x, h, past, wanted, mu, energy if normalised else None)
        name = "FIRLMSNorm" if normalised else "FIRLMS"
        got = target.filled(name, n, (*args, *([target.y(0)] if normalised else [])), dst)
        assert (got, target.at(base, taps)) == (want, h)
        assert target.at(target.y(0), 1) == energy


def test_iir_filters(target: Target, rng: random.Random) -> None:
    for sections in [1, 2, *(rng.randrange(1, 8) for _ in range(ROUNDS))]:
        k = vector(rng, 5 * sections, 16384)
        shift, gain = rng.randrange(-2, 3), rng.randrange(-32768, 32768)
        base, page = target.coefficients(k, rng.random() < 0.5)
        delay, one, two = [0] * 2 * sections, [0] * sections, [0] * sections
        canonic = target.struct(0, [sections - 1, base, page, target.y(512), gain, shift])
        transposed = target.struct(20, [sections - 1, base, page, target.y(540), target.y(560), shift])
        target.put(target.y(512), [9] * 80)
        target.call("IIRCanonicInit", canonic)
        target.call("IIRTransposedInit", transposed)
        for _ in range(3):
            n = rng.randrange(1, 20)
            x, dst = vector(rng, n), target.x(0)
            args = (n, dst, target.x(300, x))
            want = model.iir_canonic(x, k, delay, gain, shift)
            assert target.filled("IIRCanonic", n, (*args, canonic), dst) == want
            want = model.iir_transposed(x, k, one, two, shift)
            assert target.filled("IIRTransposed", n, (*args, transposed), dst) == want


@pytest.mark.parametrize("zeros", [False, True])
def test_iir_lattice(zeros: bool, target: Target, rng: random.Random) -> None:
    for order in [1, 2, *(rng.randrange(3, 12) for _ in range(ROUNDS))]:
        kappa, gamma = vector(rng, order), vector(rng, order + 1)
        page_of = rng.random() < 0.5
        base, page = target.coefficients(kappa + gamma, page_of)
        at = target.struct(0, [order, base, base + 2 * order if zeros else 0, page, target.y(512)])
        target.put(target.y(512), [9] * 20)
        target.call("IIRLatticeInit", at)
        delay = [0] * (order + 1)
        for _ in range(2):
            n = rng.randrange(1, 20)
            x, dst = vector(rng, n, 9000), target.x(0)
            want = model.iir_lattice(x, kappa, gamma if zeros else None, delay)
            assert target.filled("IIRLattice", n, (n, dst, target.x(300, x), at), dst) == want


def pairs(flat: Sequence[int]) -> list[tuple[int, int]]:
    return list(zip(flat[::2], flat[1::2], strict=True))


def flat(data: Sequence[tuple[int, int]]) -> list[int]:
    return [part for value in data for part in value]


@pytest.mark.slow
@pytest.mark.parametrize("log2n", [1, 2, 4, 7])
def test_fft_is_exactly_its_model_and_nearly_the_sum(log2n: int, target: Target, rng: random.Random) -> None:
    n = 1 << log2n
    for inverse in (0, 1):
        factors = target.x(512)
        assert target.call("TwidFactorInit", log2n, factors, inverse) == factors
        turns = pairs(target.at(factors, n))
        sign = 1 if inverse else -1
        for k, (real, imaginary) in enumerate(turns):
            exact = cmath.exp(sign * 2j * math.pi * k / n)
            assert abs(complex(real, imaginary) - 32768 * exact) <= 1.5
        data = pairs(vector(rng, 2 * n, 16384))
        at = target.y(0, flat(data))
        want = model.fft(data, turns)
        assert pairs(target.filled("FFTComplexIP", 2 * n, (log2n, at, factors, 0xFF00), at)) == want
        in_order = model.bit_reversed(want)
        assert pairs(target.filled("BitReverseComplex", 2 * n, (log2n, at), at)) == in_order
        for k, value in enumerate(in_order):
            exact = sum(complex(*v) * cmath.exp(sign * 2j * math.pi * k * i / n) for i, v in enumerate(data)) / n
            assert abs(complex(*value) - exact) < 1 + 1.5 * log2n
        name = "IFFTComplex" if inverse else "FFTComplex"
        source = target.x(0, flat(data)) if n <= 128 else target.y(512, flat(data))
        out = target.filled(name, 2 * n, (log2n, at, source, factors, 0xFF00), at)
        assert pairs(out) == in_order
    target.put(at, flat(model.bit_reversed(data)))
    assert pairs(target.filled("IFFTComplexIP", 2 * n, (log2n, at, factors, 0xFF00), at)) == in_order
    squares = target.filled("SquareMagnitudeCplx", n, (n, at, target.x(0)), target.x(0))
    assert squares == [model.rounded(model.product(r, r) + model.product(i, i)) for r, i in in_order]


def test_pid_controller(target: Target, rng: random.Random) -> None:
    for _ in range(ROUNDS):
        kp, ki, kd = vector(rng, 3)
        abc, history = target.x(0), target.y(0)
        at = target.struct(0, [abc, history, 77, 0, 0])
        target.call("PIDCoeffCalc", target.x(20, [kp, ki, kd]), at)
        a, b, c = model.fraction(kp + ki + kd), model.fraction(-(kp + 2 * kd)), kd
        assert target.at(abc, 3) == [a, b, c]
        target.put(history, [5, 5, 5])
        target.call("PIDInit", at)
        errors, output = [0, 0, 0], 0
        for _ in range(5):
            measured, reference = vector(rng, 2)
            target.put(at + 6, [measured, reference])
            target.call("PID", at)
            errors = [model.fraction(reference - measured), *errors[:2]]
            output = model.rounded(model.load(output) + model.dot((a, b, c), errors))
            assert target.at(at + 4, 1) == [output]
            assert target.at(history, 3) == errors


def bessel(x: float) -> float:
    return sum((x * x / 4) ** k / math.factorial(k) ** 2 for k in range(40))


WINDOWS = {
    "BartlettInit": lambda i, n: 1 - abs(2 * i / (n - 1) - 1),
    "HanningInit": lambda i, n: 0.5 - 0.5 * math.cos(2 * math.pi * i / (n - 1)),
    "HammingInit": lambda i, n: 0.54 - 0.46 * math.cos(2 * math.pi * i / (n - 1)),
    "BlackmanInit": lambda i, n: 0.42 - 0.5 * math.cos(2 * math.pi * i / (n - 1)) + 0.08 * math.cos(
        4 * math.pi * i / (n - 1)),
    "KaiserInit": lambda i, n: bessel(5.5 * math.sqrt(1 - (2 * i / (n - 1) - 1) ** 2)) / bessel(5.5),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", WINDOWS)
def test_windows_to_one_unit(name: str, target: Target) -> None:
    for n in (2, 5, 32):
        args = [n, target.x(0)]
        if name == "KaiserInit":
            args += target.single(5.5)
        got = target.filled(name, n, args, target.x(0))
        assert all(abs(v - 32768 * WINDOWS[name](i, n)) <= 1 for i, v in enumerate(got)), got


def test_inverse_of_a_matrix(target: Target, rng: random.Random) -> None:
    for n in (1, 2, 3, 5):
        matrix = [[rng.uniform(-1, 1) for _ in range(n)] for _ in range(n)]
        words = [w for row in matrix for value in row for w in target.single(value)]
        at, spare = target.x(0, words), target.x(300)
        result = target.y(0)
        assert target.call("MatrixInvert", n, result, at, spare, spare + 40, spare + 80) == result
        got = target.singles(result, n * n)
        for r in range(n):
            for c in range(n):
                entry = sum(matrix[r][k] * got[k * n + c] for k in range(n))
                assert abs(entry - (r == c)) < 1e-4
    singular = target.x(0, target.single(1.0) * 4)
    assert target.call("MatrixInvert", 2, result, singular, spare, spare + 40, spare + 80) == 0


TABLE = Path(model.__file__).parents[3] / "toolchain" / "runtime" / "dsp.md"


def measured(target: Target, name: str, n: int, m: int, r: int, s: int) -> int:
    """Return the cycles of one call with the parameters of the table."""
    x, more, y, filter_ = target.x(0), target.x(300), target.y(0), target.filter
    if name.startswith("FIR"):
        target.call("FIRStructInit", filter_, m, target.x(600), 0xFF00, target.y(512))
        target.call("FIRInterpDelayInit" if "Inter" in name else "FIRDelayInit", filter_, r)
    sections = [s - 1, target.x(600), 0xFF00, target.y(512), *([target.y(540)] if "Trans" in name else [0]), 0]
    arguments: dict[str, Sequence[int]] = {
        "VectorCopy": (n, x, more), "VectorNegate": (n, x, more), "VectorScale": (n, x, more, 5),
        "VectorPower": (n, x), "MatrixSubtract": (1, n, x, more, y), "MatrixMultiply": (m, s, n, x, more, y),
        "FIRDelayInit": (filter_,), "FIR": (n, x, more, filter_), "FIRLattice": (n, x, more, filter_),
        "FIRDecimate": (n, x, more, filter_, r), "FIRInterpolate": (n, x, more, filter_, r),
        "FIRLMS": (n, x, more, filter_, y, 9), "IIRCanonic": (n, x, more, target.struct(20, sections)),
        "IIRTransposed": (n, x, more, target.struct(20, sections)), "SquareMagnitudeCplx": (n, y, x),
        "VectorDotProduct, one vector in X, one in Y": (n, y, x), "VectorDotProduct, elsewhere": (n, x, more),
        "PID": (target.struct(60, [x, y, 0, 0, 0]),),
    }  # fmt: skip
    function, _, size = name.partition(", ")
    if size.endswith("points"):
        bits = int(size.split()[0]).bit_length() - 1
        target.call(function, bits, y, *([x, 0xFF00] if function == "FFTComplexIP" else []))
    else:
        target.call(function, *arguments.get(name, arguments.get(function, (n, x, more, y))))
    return target.cycles


def test_cycles_are_those_of_the_table(target: Target) -> None:
    rows = [line.split("|")[1:3] for line in TABLE.read_text().splitlines() if line.startswith("| ")][1:]
    assert len(rows) > 20
    wrong = [
        (name, n, m, r, s, counted)
        for name, formula in rows
        for n, m, r, s in ((2, 6, 2, 1), (8, 12, 3, 2))
        if (counted := measured(target, name.strip(), n, m, r, s)) != eval(formula, {"N": n, "M": m, "R": r, "S": s})
    ]
    assert not wrong
