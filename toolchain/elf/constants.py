"""Constants of generic ELF32 (System V ABI, chapter 4); those of the dsPIC30F are in `emu.image.elf_facts`."""

from __future__ import annotations

from emu.image.elf_facts import EM_DSPIC30F

__all__ = ["EM_DSPIC30F"]

SIGNATURE_SECTION = "__c30_signature"
"""Info section of every object: three 16-bit words 1, 0, 0 (abi-elf.md §6.7, §7 item 8)."""
SIGNATURE_WORDS = (1, 0, 0)

COFF_MAGIC = (0x1236).to_bytes(2, "little")  # first two bytes of a COFF object of the dsPIC30F (abi-elf.md §6.8)
MAGIC = b"\x7fELF"
ELFCLASS32, ELFDATA2LSB, EV_CURRENT = 1, 1, 1
ET_REL, ET_EXEC = 1, 2
EHDR_SIZE, SHDR_SIZE, PHDR_SIZE, SYM_SIZE, REL_SIZE = 52, 40, 32, 16, 8

SHT_NULL, SHT_PROGBITS, SHT_SYMTAB, SHT_STRTAB, SHT_RELA, SHT_NOTE, SHT_NOBITS, SHT_REL = 0, 1, 2, 3, 4, 7, 8, 9
PT_LOAD = 1
PF_X, PF_W, PF_R = 1, 2, 4

SHN_UNDEF, SHN_LORESERVE, SHN_ABS, SHN_COMMON = 0, 0xFF00, 0xFFF1, 0xFFF2
STB_LOCAL, STB_GLOBAL, STB_WEAK = 0, 1, 2
STT_NOTYPE, STT_OBJECT, STT_FUNC, STT_SECTION, STT_FILE = 0, 1, 2, 3, 4
STV_DEFAULT, STV_INTERNAL, STV_HIDDEN, STV_PROTECTED = 0, 1, 2, 3
