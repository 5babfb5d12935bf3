"""Sections, symbols and relaxation (abi-elf.md §4.3, §5, §6.3)."""

import pytest

from emu.image.elf_facts import ExtendedAttribute
from toolchain.asm.assemble import assemble
from toolchain.elf import constants as c
from toolchain.elf.model import Bind, Home
from toolchain.errors import ToolError


@pytest.mark.parametrize(
    ("attributes", "flags", "kind"),
    [
        ("code", 0x00000006, c.SHT_PROGBITS), ("data", 0x00000003, c.SHT_PROGBITS), ("bss", 0x00000003, c.SHT_NOBITS),
        ("data,near", 0x01000003, c.SHT_PROGBITS), ("bss,near", 0x01000003, c.SHT_NOBITS),
        ("persist", 0x02000003, c.SHT_NOBITS), ("psv", 0x10000002, c.SHT_PROGBITS),
        ("eedata", 0x20000002, c.SHT_PROGBITS),
        ("bss,xmemory", 0x04000003, c.SHT_NOBITS), ("bss,ymemory", 0x08000003, c.SHT_NOBITS),
        ("code,address(0x1000)", 0x40000006, c.SHT_PROGBITS), ("data,noload", 0x00800003, c.SHT_PROGBITS),
        ("bss,reverse(64)", 0x80000003, c.SHT_NOBITS), ("info", 0, c.SHT_NOTE), ("info, data", 0, c.SHT_NOTE),
        ('"ax"', 0x6, c.SHT_PROGBITS),
    ],
)  # fmt: skip
def test_attributes_become_section_flags(asm, attributes, flags, kind):
    """Section attributes become the flags of abi-elf.md §6.3, also in the quoted form of §4.3."""
    section = asm(f".section mine,{attributes}\n").sections["mine"]
    assert (section.flags, section.type) == (flags, kind)


@pytest.mark.parametrize(
    ("name", "flags"),
    [(".nbss", 0x01000003), (".ndata", 0x01000003), (".pbss", 0x02000003), (".eedata", 0x20000002),
     (".const", 0x10000002),
     (".dconst", 3), (".xbss", 0x04000003), (".ydata", 0x08000003), ("anything", 3)],
)  # fmt: skip
def test_reserved_names_imply_their_type(asm, name, flags):
    """A reserved section name implies its type; a bare .const means psv,page (abi-elf.md §4.3)."""
    assert asm(f".section {name}\n").sections[name].flags == flags


def test_page_travels_in_an_extended_attribute_symbol():
    """The attribute `page` of `.const,psv,page` becomes the symbol __ext_attr_.const = 8 (abi-elf.md §6.3)."""
    from toolchain.elf.write import object_bytes

    obj, _ = assemble(".section .const,psv,page\n .word 1\n", "x.s")
    assert next(s for s in obj.sections if s.name == ".const").extended is ExtendedAttribute.PAGE
    assert b"__ext_attr_.const\0" in object_bytes(obj)


def test_address_and_alignment_reach_the_header(asm):
    """Address and alignment of a section are in its header: sh_addr is the LMA, sh_addralign counts address units.

    Source: abi-elf.md §6.3.
    """
    out = asm(".section here,code,address(0x2000)\n nop\n .section buf,bss,align(32)\n")
    assert (out.sections["here"].load, out.sections["buf"].align) == (0x2000, 32)


def test_text_data_and_bss_are_always_there(asm):
    """Every object contains .text, .data and .bss (abi-elf.md §7 item 8)."""
    assert list(asm("").sections)[:3] == [".text", ".data", ".bss"]


def test_private_sections_get_names_of_their_own(asm):
    """A section named `*` gets a unique name (abi-elf.md §1.4)."""
    out = asm(".section *,bss,near\na: .space 2\n .section *,data\nb: .word 1\n")
    assert out.symbols["a"].section is not out.symbols["b"].section


def test_section_stack_and_previous(asm):
    """.pushsection, .popsection and .previous switch between sections."""
    out = asm("nop\n .pushsection .data\n .byte 1\n .popsection\n nop\n .data\n .byte 2\n .previous\n nop\n")
    assert (len(out.words()), out.bytes(".data")) == (3, b"\1\2")


def test_symbol_attributes(asm):
    """.global .weak .type .size .comm .lcomm set the attributes of symbols; an undefined reference becomes global."""
    out = asm(
        ".global f\n .weak g, u\n .type f, @function\n .size f, e - f\nf: nop\n nop\ne:\ng: rcall h\n rcall u\n"
        " .comm buf, 10, 4\n .lcomm lbuf, 6\n.Llocal: nop\n"
    )
    f, g, u, h, buf = (out.symbols[n] for n in ("f", "g", "u", "h", "buf"))
    assert (f.bind, f.type, f.size) == (Bind.GLOBAL, c.STT_FUNC, 4)
    assert (g.bind, u.bind, u.home, h.bind, h.home) == (
        Bind.WEAK, Bind.WEAK, Home.UNDEFINED, Bind.GLOBAL, Home.UNDEFINED,
    )  # fmt: skip
    assert (buf.home, buf.size, buf.value) == (Home.COMMON, 10, 4)
    assert out.symbols["lbuf"].section.name == ".bss"
    assert ".Llocal" not in out.symbols


def test_relax_shortens_calls_within_the_section_only_when_asked(asm):
    """Relaxation, if enabled, shortens CALL to RCALL and GOTO to BRA within a section (abi-elf.md §5).

    Weak symbols and other sections are left alone.
    """
    text = (
        "a: call b\n goto a\n call far\n .weak w\nw: call w\nb: nop\n call 0x200\n .section other,code\nfar: call far\n"
    )
    plain, relaxed = asm(text), asm(text, relax=True)
    assert (plain.symbols["b"].value, relaxed.symbols["b"].value) == (16, 12)
    assert relaxed.words() == [0x070000, 0x370000, 0x020000, 0, 0x020000, 0, 0, 0x020200, 0]
    assert [n for _, n, _ in relaxed.relocs()] == [28, 28, 32, 33, 32, 33]
    assert relaxed.words("other") == [0x070000]


def test_relax_keeps_a_call_that_does_not_reach(asm):
    """Relaxation keeps a call whose target is out of reach, -32768..32767 words (isa.md §3.2)."""
    out = asm(f"call end\n call near\nnear: .space {2 * 32766}\n call end\nend: nop\n", relax=True)
    assert out.words()[0] == 0x020000 or out.symbols["near"].value == 4
    distance = (out.symbols["end"].value - 2) // 2
    assert (out.words()[0] >> 16 == 0x07) == (distance <= 32767)
    far = asm(f"call end\n .space {2 * 32768}\nend: nop\n", relax=True)
    assert far.words()[0] == 0x020000


def test_label_distances_across_relaxed_calls_are_final(asm):
    """.size and .word of a label difference have the value after relaxation."""
    out = asm(".size f, .-f\nf: call g\n call g\ng: nop\n .section .debug_x,info\n .word g - f\n", relax=True)
    assert out.bytes(".debug_x") == b"\4\0"


def test_keep_protects_from_section_collection(image):
    """A section with the attribute `keep` survives --gc-sections."""
    text = ".section a,code,keep\nkept: nop\n .section b,code\ngone: nop\n"
    symbols = image(text, gc_sections=True).symbols
    assert "kept" in symbols
    assert "gone" not in symbols


def test_alignment_behind_a_relaxable_call_is_refused(asm):
    """Alignment after a call that may be relaxed is refused, because the size of the call is not yet known."""
    with pytest.raises(ToolError, match="--relax may shorten"):
        asm("f: call f\n .align 16\n nop\n", relax=True)


def test_every_object_carries_the_signature_microchips_linker_looks_for(asm):
    """Every object has the info section that Microchip's linker expects, words 1, 0, 0 (abi-elf.md §6.7, §7 item 8).

    If the source defines that section, it is kept.
    """
    assert asm("").bytes("__c30_signature") == bytes([1, 0, 0, 0, 0, 0])
    out = asm(".section __c30_signature, info, data\n .word 1, 2, 3\n")
    assert out.bytes("__c30_signature") == bytes([1, 0, 2, 0, 3, 0])


def test_modifiers_alone_keep_the_type_the_name_implies(asm):
    """A `.section` with modifiers only keeps the type that its name implies: `.section .data, near` (e-puck library).

    An untouched section may still change its attributes.
    """
    out = asm(
        " .section .data, near\n .word 1\n .section .bss, near\n .space 2\n .section .text, address(0x200)\n nop\n"
    )
    assert [out.sections[n].flags for n in (".data", ".bss", ".text")] == [0x01000003, 0x01000003, 0x40000006]
    assert out.sections[".bss"].type == c.SHT_NOBITS


def test_a_section_named_again_needs_only_its_type(asm):
    """A section that is named again needs only its type; address, alignment and memory are those of the first use
    (pic30-as)."""
    out = asm(
        ".section boot,code,address(0x1100)\n nop\n .section fast,bss,xmemory,near\n .space 2\n .text\n"
        " .section boot,code\n nop\n .section fast,bss\n .space 2\n"
    )
    assert (out.sections["boot"].load, out.words("boot"), out.sections["fast"].units) == (0x1100, [0, 0], 4)
    for first, second in (("bss", "bss,near"), ("persist", "bss"), ("psv", "code"), ("code", "code,address(16)")):
        with pytest.raises(ToolError, match="other attributes"):
            asm(f".section it,{first}\n .space 2\n .section it,{second}\n")
