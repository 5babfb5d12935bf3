"""Text of a VCD file: exact times, and the same lines as pyvcd writes for changes in order."""

from __future__ import annotations

import io
import random
from fractions import Fraction

import pytest
from vcd import VCDWriter

from emu.instruments.vcd_file import VcdFile

SIZES = (1, 4, 8, 16, 32, 64)


@pytest.mark.parametrize("hz", [Fraction(14_745_600), Fraction(1_842_500), Fraction(7_372_801, 8), Fraction(32_768, 3)])
@pytest.mark.parametrize("begin", [0, 7, 1 << 34])
def test_text_of_random_changes(hz: Fraction, begin: int) -> None:
    generator, stream, expected = random.Random(begin), io.StringIO(), io.StringIO()
    time = [round(Fraction(cycle * 10**12) / hz) for cycle in range(begin, begin + 40)]
    ours = VcdFile(stream, hz, begin)
    theirs = VCDWriter(expected, timescale="1 ps", date="", version="emu", init_timestamp=time[0])
    variables = [theirs.register_var("a", f"v{size}", "wire", size=size, init=size & 1) for size in SIZES]
    assert [ours.register("a", f"v{size}", "wire", size, size & 1) for size in SIZES] == list(range(len(SIZES)))
    changes = sorted((begin + generator.randrange(1, 40), generator.randrange(len(SIZES))) for _ in range(200))
    valued = [(cycle, one, generator.choice((0, generator.getrandbits(SIZES[one])))) for cycle, one in changes]
    for cycle, one, value in valued:
        theirs.change(variables[one], time[cycle - begin], value)
    for cycle, one, value in sorted(valued, key=lambda change: change[1]):
        ours.add(cycle, one, value)
    ours.write(begin + 20)
    ours.close(begin + 39)
    theirs.close(time[39])
    assert stream.getvalue() == expected.getvalue()
