"""Operand kinds of DSP instructions: accumulators, products, prefetches, write-back (isa.md §8.1, §16)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from .dsp import MULTIPLICANDS, NO_PREFETCH, OFFSET_REGISTER, PREFETCH_STEP, WITH_OFFSET
from .fields import Operands
from .operands import Kind, Part, Site, SymbolOf, register_number
from .row import Row

PREFETCH = re.compile(r"\[\s*w(8|9|10|11)\s*\](?:\s*([+-])=\s*([246]))?", re.IGNORECASE)
PREFETCH_INDEXED = re.compile(r"\[\s*w(9|11)\s*\+\s*w12\s*\]", re.IGNORECASE)
PRODUCT = re.compile(r"w([4-7])\s*\*\s*w([4-7])", re.IGNORECASE)
WRITE_BACK = {"w13": 0, "[w13]+=2": 1}
PAIRS = {pair: code for code, pair in MULTIPLICANDS.items()}
PAIR_TEXT = {code: f"w{a} * w{b}" for (a, b), code in PAIRS.items()}
UNKNOWN = "???"


@dataclass(frozen=True)
class Accumulator(Kind):
    """Accumulator A or B."""

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        return Part(1, {"A": "AB".index(tokens[0].upper())}) if tokens and tokens[0].upper() in ("A", "B") else None

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        return ["AB"[x.A]]


@dataclass(frozen=True)
class Product(Kind):
    """Wm*Wn of two different registers, or the square Wm*Wm."""

    square: bool

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        match = PRODUCT.fullmatch(tokens[0]) if tokens else None
        if match is None:
            return None
        a, b = sorted((int(match[1]), int(match[2])))
        if self.square != (a == b):
            return None
        return Part(1, {"m": a - 4 if self.square else PAIRS[a, b]})

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        return [f"w{4 + x.m} * w{4 + x.m}" if self.square else PAIR_TEXT.get(x.m, UNKNOWN)]


@dataclass(frozen=True)
class Prefetch(Kind):
    """[Wx] or [Wy] with its step (isa.md §8.1); with ``data``, an optional pair ``[Wx]+=n, Wxd``."""

    pointer: str  # field: i or j
    data: str  # field: x or y; "" if the data register is a separate operand
    first: int  # number of the lower of the two pointer registers: 8 or 10

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        code = self.code(tokens[0]) if tokens else None
        if not self.data:
            return None if code is None else Part(1, {self.pointer: code})
        if code is None:
            return Part(0, {self.pointer: NO_PREFETCH, self.data: 0})
        n = register_number(tokens[1]) if len(tokens) > 1 else None
        return Part(2, {self.pointer: code, self.data: n - 4}) if n is not None and 4 <= n <= 7 else None

    def code(self, token: str) -> int | None:
        if match := PREFETCH_INDEXED.fullmatch(token):
            return WITH_OFFSET if int(match[1]) == self.first + 1 else None
        match = PREFETCH.fullmatch(token)
        if match is None or int(match[1]) not in (self.first, self.first + 1):
            return None
        step = int((match[2] or "") + (match[3] or "0")) // 2
        return (int(match[1]) - self.first) * 8 + step % 8

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        code = getattr(x, self.pointer)
        n, step = self.first + (code >> 3), PREFETCH_STEP.get(code & 7, 0)
        if code == NO_PREFETCH:
            tokens = []
        elif code == WITH_OFFSET:
            tokens = [f"[w{n}+w{OFFSET_REGISTER}]"]
        else:
            tokens = [f"[w{n}]" + (f"{'-' if step < 0 else '+'}={abs(step)}" if step else "")]
        if self.data and (code != NO_PREFETCH or (not source and self._shows_idle_register(x, at.row))):
            tokens.append(f"w{4 + getattr(x, self.data)}")
        return tokens

    def _shows_idle_register(self, x: Operands, row: Row) -> bool:
        """Return whether binutils prints the data register, if its field is not 0, although there is no prefetch."""
        hidden = self.pointer == "i" and x.j != NO_PREFETCH and not ("m" in row.fields and row.fields["m"].width == 2)
        return getattr(x, self.data) != 0 and not hidden


@dataclass(frozen=True)
class PrefetchData(Kind):
    """Data register Wxd of ED and EDAC."""

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        n = register_number(tokens[0]) if tokens else None
        return Part(1, {"x": n - 4}) if n is not None and 4 <= n <= 7 else None

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        return [f"w{4 + x.x}"]


@dataclass(frozen=True)
class WriteBack(Kind):
    """Optional accumulator write-back: W13 or [W13]+=2."""

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        code = WRITE_BACK.get(re.sub(r"\s", "", tokens[0]).lower()) if tokens else None
        return Part(0, {"a": 2}) if code is None else Part(1, {"a": code})

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        return [] if x.a == 2 else ["w13" if x.a == 0 else "[w13]+=2" if x.a == 1 else UNKNOWN]
