"""Constants of the target: registers, memory, limits of operands. Sources: abi-elf.md §2, isa.md §2.2, §3.2."""

from __future__ import annotations

from emu.chips.dspic30f6014a import DSPIC30F6014A

SP = 15  # W15: the stack grows upwards, W15 points to the next free word (abi-elf.md §2.1)
FP = 14  # W14: frame pointer if the function needs one, otherwise an ordinary register
WREG = 0  # W0, the implied operand of file-register instructions (isa.md §2.2)
ALLOCATABLE = tuple(range(15))  # W0-W14
ARGUMENT_REGISTERS = 8  # W0-W7 (abi-elf.md §2.2)
CALLER_SAVED = tuple(range(8))  # W0-W7, RCOUNT, flags (abi-elf.md §2.1)
CALLEE_SAVED = tuple(range(8, 15))  # W8-W14

LIT5_MAX = 31  # greatest literal of `Wb, #lit5, Wd` (isa.md §3.2)
LIT10_MAX = 1023  # greatest literal of `#lit10, Wn`; of byte instructions 255
LIT10_BYTE_MAX = 255
WORD_OFFSET = (-1024, 1022)  # least and greatest offset of a word access [Wn+Slit10], both even (isa.md §3.2)
BYTE_OFFSET = (-512, 511)
LNK_MAX = 16382  # greatest frame size of LNK in bytes (isa.md §5.8)
NEAR_BYTES = 64  # greatest size of an object in near RAM; near RAM (below 0x2000, abi-elf.md §1.4) is scarce
NEAR_END = DSPIC30F6014A.data["near"].end  # first address that file-register instructions cannot access
RETURN_ADDRESS_BYTES = 4  # bytes that CALL pushes, two words (isa.md §7.4)

_DATA = DSPIC30F6014A.data
W_END = 0x20  # first address after W0-W15, which start at address 0 (isa.md §2.1)
SFR_END = _DATA["sfr"].end  # first address after the special function registers
RAM_END = _DATA["ram"].end


def register(name: str) -> int:
    """Address of a CPU register, the same for all chips of the family. Raise KeyError if the name is unknown."""
    return DSPIC30F6014A.sfrs[name].address
