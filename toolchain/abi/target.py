"""The target as data: registers, argument slots, instruction limits. Sources: abi-elf.md §2, isa.md §2.2, §3.2."""

from __future__ import annotations

from emu.chips.dspic30f6014a import DSPIC30F6014A

SP = 15  # W15, grows upward, points at the next free word (abi-elf.md §2.1)
FP = 14  # W14, frame pointer where a frame needs one, else ordinary
WREG = 0  # W0 in file-register instructions (isa.md §2.2)
ALLOCATABLE = tuple(range(15))  # W0-W14
ARGUMENT_REGISTERS = 8  # W0-W7 (abi-elf.md §2.2)
CALLER_SAVED = tuple(range(8))  # W0-W7, RCOUNT, flags (abi-elf.md §2.1)
CALLEE_SAVED = tuple(range(8, 15))  # W8-W14

LIT5_MAX = 31  # Wb, #lit5, Wd (isa.md §3.2)
LIT10_MAX = 1023  # #lit10, Wn; bytes: 255
LIT10_BYTE_MAX = 255
WORD_OFFSET = (-1024, 1022)  # [Wn+Slit10], even (isa.md §3.2)
BYTE_OFFSET = (-512, 511)
LNK_MAX = 16382  # isa.md §5.8
NEAR_BYTES = 64  # larger objects are addressed through pointers, so that near RAM (below 0x2000, abi-elf.md §1.4) lasts
NEAR_END = DSPIC30F6014A.data["near"].end  # first address that file-register instructions do not reach
RETURN_ADDRESS_BYTES = 4  # CALL pushes two words (isa.md §7.4)

_DATA = DSPIC30F6014A.data
W_END = 0x20  # W0-W15 lie at the beginning of data space (isa.md §2.1)
SFR_END = _DATA["sfr"].end  # first address behind the special function registers
RAM_END = _DATA["ram"].end


def register(name: str) -> int:
    """Address of a register of the core, which is the same in the whole family. Raises KeyError."""
    return DSPIC30F6014A.sfrs[name].address
