"""Bit-exact model of the DSP library: each function as its difference equation.

The accumulator of isa.md §2.7 is a Python integer in units of 2^-31; fractions are integers -32768 to 32767.
"""

from __future__ import annotations

from collections.abc import Sequence

LIMIT = 1 << 39
"""Limit of an accumulator: it saturates at 9.31."""


def acc(value: int) -> int:
    return max(-LIMIT, min(LIMIT - 1, value))


def fraction(value: int) -> int:
    return max(-32768, min(32767, value))


def wrapped(value: int) -> int:
    return (value + 32768 & 0xFFFF) - 32768


def product(a: int, b: int) -> int:
    return 2 * a * b


def load(value: int, right: int = 0) -> int:
    return value << 16 >> right


def truncated(a: int) -> int:
    """Return the accumulator as a fraction, truncated (SAC)."""
    return fraction(a >> 16)


def rounded(a: int, left: int = 0) -> int:
    """Return the accumulator as a fraction, rounded to nearest, ties to even (SAC.R)."""
    a <<= left
    whole, rest = a >> 16, a & 0xFFFF
    return fraction(whole + (rest > 0x8000 or (rest == 0x8000 and bool(whole & 1))))


def dot(a: Sequence[int], b: Sequence[int]) -> int:
    total = 0
    for x, y in zip(a, b, strict=True):
        total = acc(total + product(x, y))
    return total


def fir(x: Sequence[int], h: Sequence[int], past: list[int]) -> list[int]:
    """Filter a block.

    `past` has the earlier samples, newest first, at least as many as `h`; it is updated.
    """
    out = []
    for sample in x:
        past.insert(0, sample)
        out.append(rounded(dot(h, past[: len(h)])))
    return out


def fir_decimate(x: Sequence[int], h: Sequence[int], past: list[int], rate: int) -> list[int]:
    return fir(x, h, past)[rate - 1 :: rate]


def fir_interpolate(x: Sequence[int], h: Sequence[int], past: list[int], rate: int) -> list[int]:
    out = []
    for sample in x:
        past.insert(0, sample)
        out += [rounded(dot(h[r::rate], past[: len(h) // rate])) for r in range(rate)]
    return out


def fir_lattice(x: Sequence[int], k: Sequence[int], before: list[int]) -> list[int]:
    out = []
    for f in x:
        g = f
        for m, kappa in enumerate(k):
            was, before[m] = before[m], g
            f, g = rounded(load(f) - product(kappa, was)), rounded(load(was) - product(kappa, f))
        out.append(f)
    return out


def fir_lms(
    x: Sequence[int], h: list[int], past: list[int], reference: Sequence[int], mu: int, energy: list[int] | None = None
) -> list[int]:
    """Filter a block and adapt the coefficients `h`; with `energy` (one element) normalise the gain."""
    out = []
    for sample, wanted in zip(x, reference, strict=True):
        gain = mu
        if energy is not None:
            oldest = past[len(h) - 1]
            energy[0] = rounded(product(sample, sample) - product(oldest, oldest) + load(energy[0]))
            whole = truncated(load(mu) + load(energy[0]))
            gain = (mu << 15) // whole if whole > mu else 0x7FFF
        past.insert(0, sample)
        y = rounded(dot(h, past[: len(h)]))
        out.append(y)
        step = rounded(product(truncated(load(wanted) - load(y)), gain))
        h[:] = [rounded(load(c) + product(s, step)) for c, s in zip(h, past, strict=False)]
    return out


def iir_canonic(x: Sequence[int], k: Sequence[int], delay: list[int], gain: int, shift: int) -> list[int]:
    out = []
    for sample in x:
        a = product(sample, gain)
        for s in range(len(k) // 5):
            a2, a1, b2, b1, b0 = k[5 * s : 5 * s + 5]
            older, newer = delay[2 * s : 2 * s + 2]
            w = rounded(acc(acc(a + product(a2, older)) + product(a1, newer)), 1)
            a = product(b2, older) + product(b1, newer) + product(b0, w)
            delay[2 * s : 2 * s + 2] = [newer, w]
        out.append(rounded(acc(a << shift if shift > 0 else a >> -shift), 1))
    return out


def iir_transposed(x: Sequence[int], k: Sequence[int], one: list[int], two: list[int], shift: int) -> list[int]:
    out = []
    for sample in x:
        for s in range(len(k) // 5):
            b0, b1, a1, b2, a2 = k[5 * s : 5 * s + 5]
            y = rounded(load(one[s], 1) + product(b0, sample), 1)
            one[s] = rounded(load(two[s], 1) + product(b1, sample) + product(a1, y), 1)
            two[s] = rounded(product(b2, sample) + product(a2, y), 1)
            sample = y
        a = load(sample)
        out.append(rounded(acc(a << shift if shift > 0 else a >> -shift)))
    return out


def iir_lattice(x: Sequence[int], kappa: Sequence[int], gamma: Sequence[int] | None, delay: list[int]) -> list[int]:
    order, out = len(kappa), []
    for c in x:
        for m in range(order):
            k = kappa[order - 1 - m]
            c = rounded(load(c) - product(k, delay[m + 1]))
            delay[m] = rounded(load(delay[m + 1]) + product(k, c))
        delay[order] = c
        out.append(c if gamma is None else rounded(dot(gamma[::-1], delay)))
    return out


def reversed_bits(index: int, bits: int) -> int:
    return int(f"{index:0{bits}b}"[::-1], 2)


def bit_reversed(data: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    bits = (len(data) - 1).bit_length()
    return [data[reversed_bits(i, bits)] for i in range(len(data))]


def fft(data: list[tuple[int, int]], factors: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """FFT by decimation in frequency, halved in every stage; return the result in bit-reversed order."""
    data = list(data)
    half, step = len(data) // 2, 1
    while half:
        for start in range(0, len(data), 2 * half):
            for j in range(half):
                a, b = data[start + j], data[start + j + half]
                mean = [rounded(load(p, 1) + load(q, 1)) for p, q in zip(a, b, strict=True)]
                tr, ti = (wrapped(m - q) for m, q in zip(mean, b, strict=True))
                data[start + j] = (mean[0], mean[1])
                if half > 1:
                    wr, wi = factors[j * step]
                    real = rounded(product(tr, wr) - product(ti, wi))
                    tr, ti = real, rounded(product(tr, wi) + product(ti, wr))
                data[start + j + half] = (tr, ti)
        half, step = half // 2, 2 * step
    return data
