"""Random legal instructions keep their words through disassembly text, assembler and linker."""

import random

from emu.dspic30f.isa import codec, text
from toolchain.asm.assemble import assemble
from toolchain.elf.read import read_object
from toolchain.elf.write import object_bytes
from toolchain.link.link import link
from toolchain.link.options import LinkOptions

START = 0x8000  # within reach of every tested absolute branch
COUNT = 4000


def random_instruction(rng):
    """Return a legal instruction other than REPEAT, which restricts the next one."""
    while True:
        insn = codec.decode(rng.randrange(1 << 24), rng.randrange(1 << 7))
        if insn is not None and insn.row.mnemonic != "REPEAT":
            return insn


def test_a_random_program_survives_text_object_and_link():
    """A random program keeps its words through text, object and link.

    Absolute branch targets become relocations 29 and 31, which the linker resolves (abi-elf.md §5).
    """
    rng = random.Random(30)
    lines, expected, pc = [], [], START
    while len(lines) < COUNT:
        insn = random_instruction(rng)
        relative = "n" in insn.row.fields and insn.row.fields["n"].signed
        if relative and not 0 <= pc + 2 * insn.words + 2 * insn.x.n <= 0x7FFFFE:
            continue
        line = text.format(insn, pc, source=True)
        words = text.parse(line).encode(pc)
        lines.append(line)
        expected += words
        pc += 2 * len(words)
    source = f".global __reset\n .section code,code,address({START})\n__reset:\n " + "\n ".join(lines) + "\n"
    obj = read_object(object_bytes(assemble(source, "random.s")[0]), "random.o")
    image = link([obj], [], LinkOptions()).image
    section = next(s for s in image.sections if s.address == START)
    linked = [int.from_bytes(section.data[i : i + 4], "little") for i in range(0, len(section.data), 4)]
    wrong = [(hex(a), hex(b)) for a, b in zip(linked, expected, strict=True) if a != b]
    assert wrong == []
