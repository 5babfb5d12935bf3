"""The DSP library on the emulator: functions are called with words in W0-W7, results are read from memory."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import emu
from tests.toolchain.c_programs import build

HEADER = Path(__file__).parents[3] / "toolchain" / "include" / "dsp.h"
PROGRAM = """
#include <dsp.h>
int in_x[720] __attribute__((space(xmemory), aligned(4)));
int in_y[1024] __attribute__((space(ymemory), aligned(1024)));
int room[40];
/* 80 words of program memory, where coefficients are put */
const int in_flash[80] __attribute__((space(psv))) = {1};
volatile unsigned page, offset;
void *volatile used[] = {NAMES};
__attribute__((noinline)) int ready(void) { return in_x[0] + in_y[0] + room[0] + (int)used[0]; }
int main(void)
{
    page = __builtin_psvpage(in_flash);
    offset = __builtin_psvoffset(in_flash);
    return ready();
}
"""
KEPT = ("CORCON", "PSVPAG", "MODCON", "YMODSRT", "YMODEND")
FUNCTIONS = [
    "VectorCopy", "VectorZeroPad", "VectorNegate", "VectorScale", "VectorAdd", "VectorSubtract", "VectorMultiply",
    "VectorDotProduct", "VectorPower", "VectorMax", "VectorMin", "VectorConvolve", "VectorCorrelate", "VectorWindow",
    "BartlettInit", "BlackmanInit", "HammingInit", "HanningInit", "KaiserInit", "MatrixAdd", "MatrixSubtract",
    "MatrixScale", "MatrixMultiply", "MatrixTranspose", "MatrixInvert", "FIRStructInit", "FIRDelayInit",
    "FIRInterpDelayInit", "FIR", "FIRDecimate", "FIRInterpolate", "FIRLattice", "FIRLMS", "FIRLMSNorm", "IIRCanonic",
    "IIRTransposed", "IIRLattice", "IIRCanonicInit", "IIRTransposedInit", "IIRLatticeInit", "TwidFactorInit",
    "BitReverseComplex", "FFTComplex", "FFTComplexIP", "IFFTComplex", "IFFTComplexIP", "SquareMagnitudeCplx", "PIDInit",
    "PID", "PIDCoeffCalc", "Float2Fract", "Fract2Float",
]  # fmt: skip


class Target:
    """A machine at `main` of a program that contains the whole library."""

    def __init__(self, folder: Path) -> None:
        source = PROGRAM.replace("NAMES", ", ".join(FUNCTIONS))
        (folder / "dsp.c").write_text(source)
        built = build([folder / "dsp.c"], folder / "dsp.elf", "-Os", "-fno-lto", "-Wall", "-Werror")
        assert built.status == 0, built.messages
        self.machine = machine = emu.load(folder / "dsp.elf")
        assert machine.image is not None
        self.symbols = machine.image.symbols
        self.back = self._address("_ready")
        assert machine.run(cycles=10_000_000, until=self.back).reason == "until"
        self.page, self.offset = (machine.peek(self._address(name)) for name in ("_page", "_offset"))
        self.filter = self._address("_room")
        self.stack = machine.w[15]
        self.modes = [machine.peek(name) for name in KEPT]
        self.cycles = 0

    def _address(self, name: str) -> int:
        symbol = self.symbols.find(name)
        assert symbol is not None, name
        return symbol.address

    def x(self, at: int, words: Sequence[int] = ()) -> int:
        """Store `words` in the X buffer from word `at` on; return their address."""
        return self.put(self._address("_in_x") + 2 * at, words)

    def y(self, at: int, words: Sequence[int] = ()) -> int:
        return self.put(self._address("_in_y") + 2 * at, words)

    def struct(self, at: int, words: Sequence[int]) -> int:
        return self.put(self.filter + at, words)

    def put(self, address: int, words: Sequence[int]) -> int:
        for i, word in enumerate(words):
            self.machine.poke(address + 2 * i, word & 0xFFFF)
        return address

    def coefficients(self, words: Sequence[int], in_flash: bool) -> tuple[int, int]:
        """Store coefficients; return base address and page as arguments of filters."""
        if not in_flash:
            return self.x(600, words), 0xFF00
        start = self.page << 15 | self.offset & 0x7FFF
        for i, word in enumerate(words):
            self.machine.core.program.put(start + 2 * i, word & 0xFFFF)
        return self.offset, self.page

    def at(self, address: int, n: int) -> list[int]:
        return [(self.machine.peek(address + 2 * i) ^ 0x8000) - 0x8000 for i in range(n)]

    def call(self, name: str, *args: int) -> int:
        """Call a function and return W0; set `cycles` to the cycles of the call with RCALL and RETURN."""
        machine = self.machine
        kept = [0x1111 * i for i in range(8, 15)]
        for i, value in enumerate([*args, *[0xDEAD] * (8 - len(args)), *kept]):
            machine.w[i] = value & 0xFFFF
        machine.poke(self.stack, self.back & 0xFFFF)
        machine.poke(self.stack + 2, self.back >> 16)
        machine.w[15] = self.stack + 4
        machine.pc = self._address("_" + name)
        start = machine.cycle
        stop = machine.run(cycles=3_000_000, until=self.back)
        assert stop.reason == "until", (name, args, stop)
        self.cycles = stop.cycle - start + 2
        assert machine.w[15] == self.stack, name
        assert [machine.w[i] for i in range(8, 15)] == kept, name
        assert [machine.peek(n) for n in KEPT] == self.modes, name
        return machine.w[0]

    def value(self, name: str, *args: int) -> int:
        return (self.call(name, *args) ^ 0x8000) - 0x8000

    def filled(self, name: str, n: int, args: Sequence[int], dst: int) -> list[int]:
        """Call a function that must return `dst`; return the n words at `dst`."""
        assert self.call(name, *args) == dst, name
        return self.at(dst, n)

    def single(self, value: float) -> list[int]:
        return list(struct.unpack("<2H", struct.pack("<f", value)))

    def singles(self, address: int, n: int) -> list[float]:
        words = [word & 0xFFFF for word in self.at(address, 2 * n)]
        return list(struct.unpack(f"<{n}f", struct.pack(f"<{2 * n}H", *words)))
