"""ELF files (abi-elf.md §6, §7): their contents as read by independent tools, and damaged files."""

import io
import shutil
import struct
import subprocess

import pytest
from elftools.elf.elffile import ELFFile

from toolchain.asm.assemble import assemble
from toolchain.elf.read import read_executable, read_object
from toolchain.elf.write import executable_bytes, object_bytes
from toolchain.errors import ToolError

SOURCE = """
    .file "prog.c"
    .global __reset, _table
    .type __reset, @function
    .size __reset, 8
__reset: mov #_table, w0
    call _other
    return
    .global _other
    .weak _other
_other: bra __reset
    .section .const,psv,page
    .type _table, @object
_table: .word 1, 2, 3
    .section .nbss,bss,near
_v: .space 6
    .section .ndata,data,near
    .word 0x1234
    .section .pbss,persist
    .space 2
    .section .eedata,eedata
    .word 7
    .section .debug_info,info
    .4byte __reset
"""


@pytest.fixture(scope="module")
def executable(image):
    return executable_bytes(image(SOURCE).linked.image)


def test_the_header_says_dspic30f6014a(executable):
    """The ELF header names the dsPIC30F6014A (abi-elf.md §6.1, §7 item 1)."""
    elf = ELFFile(io.BytesIO(executable))
    header = elf.header
    assert (header["e_machine"], header["e_type"], header["e_flags"]) in (
        (118, "ET_EXEC", 0x1F),
        ("EM_DSPIC30F", "ET_EXEC", 0x1F),
    )
    assert (elf.elfclass, elf.little_endian, header["e_phoff"]) == (32, True, 52)
    assert header["e_entry"] == next(
        s["st_value"] for s in elf.get_section_by_name(".symtab").iter_symbols() if s.name == "__reset"
    )


def test_sections_follow_the_octet_rule_and_flags(executable):
    """Sections follow the rules for octets and flags (abi-elf.md §6.2, §6.3, §7 items 3, 4).

    Debug information is stored without phantoms by default.
    """
    elf = ELFFile(io.BytesIO(executable))
    rows = {s.name: (s["sh_type"], s["sh_flags"], s["sh_size"]) for s in elf.iter_sections()}
    assert rows[".ivt"] == ("SHT_PROGBITS", 6, 62 * 4)
    assert rows[".const"] == ("SHT_PROGBITS", 0x10000002, 12)
    assert rows[".nbss"] == ("SHT_NOBITS", 0x01000003, 12)
    assert rows[".ndata"] == ("SHT_PROGBITS", 0x01800003, 4)
    assert rows[".pbss"] == ("SHT_NOBITS", 0x02000003, 4)
    assert rows[".eedata"] == ("SHT_PROGBITS", 0x20000002, 4)
    assert rows[".debug_info"] == ("SHT_PROGBITS", 0, 4)
    assert elf.get_section_by_name(".const").data()[:8] == bytes([1, 0, 0, 0, 2, 0, 0, 0])


def test_each_loaded_section_has_its_segment(executable):
    """Each loaded section has a segment; p_paddr is its LMA, sizes are in octets (abi-elf.md §7 item 2)."""
    elf = ELFFile(io.BytesIO(executable))
    sections = {s["sh_offset"]: s for s in elf.iter_sections() if s["sh_flags"] & 2 and s["sh_type"] == "SHT_PROGBITS"}
    seen = 0
    for segment in elf.iter_segments():
        assert (segment["p_type"], segment["p_align"]) == ("PT_LOAD", 2)
        section = sections.get(segment["p_offset"])
        if section is None or not segment["p_filesz"]:
            continue
        seen += 1
        assert (segment["p_vaddr"], segment["p_filesz"]) == (section["sh_addr"], section["sh_size"])
        if section.name == ".const":
            assert segment["p_vaddr"] == 0x8000 | segment["p_paddr"] & 0x7FFF
        if section.name == ".eedata":
            assert (segment["p_vaddr"], segment["p_paddr"]) == (0xF000, 0x7FF000)
    assert seen == len(sections)


def test_symbols_have_units_types_and_order(executable):
    """Symbols are ordered with locals first, and FUNC sizes are in PC units (abi-elf.md §6.5, §7 item 5)."""
    elf = ELFFile(io.BytesIO(executable))
    table = elf.get_section_by_name(".symtab")
    symbols = {s.name: s for s in table.iter_symbols()}
    binds = [s["st_info"]["bind"] for s in table.iter_symbols()]
    assert binds.index("STB_GLOBAL") == table["sh_info"]
    assert "STB_LOCAL" not in binds[table["sh_info"] :]
    assert (symbols["__reset"]["st_info"]["type"], symbols["__reset"]["st_size"]) == ("STT_FUNC", 8)
    assert symbols["_table"]["st_value"] & 0x8000
    assert symbols["_v"]["st_value"] == 0x800


@pytest.mark.skipif(shutil.which("readelf") is None, reason="readelf is not installed (Debian package binutils)")
def test_readelf_finds_nothing_to_warn_about(tmp_path, executable):
    """binutils' readelf reads headers, symbols and relocations of objects and executables without a warning."""
    obj = object_bytes(assemble(SOURCE, "x.s")[0])
    for name, data in (("x.elf", executable), ("x.o", obj)):
        (tmp_path / name).write_bytes(data)
        done = subprocess.run(["readelf", "-W", "-hSlsr", tmp_path / name], capture_output=True, text=True, check=True)
        assert "Warning" not in done.stderr + done.stdout


def test_objects_and_executables_survive_reading_and_writing(executable, image):
    """read(write(x)) writes the same bytes again, for objects and executables."""
    obj = object_bytes(assemble(SOURCE, "x.s")[0])
    assert object_bytes(read_object(obj, "x.o")) == obj
    again = read_executable(executable, "x.elf")
    assert executable_bytes(again) == executable
    assert {s.name: (s.address, s.load) for s in again.sections}[".const"][1] < 0x8000


def test_damage_anywhere_in_an_object_is_an_error_or_harmless():
    """Damage anywhere in an object gives a ToolError or a valid object.

    Every byte is set to some critical values, and the file is truncated at every length.
    """
    good = object_bytes(assemble(SOURCE, "x.s")[0])
    outcomes = set()
    for offset in range(len(good)):
        for value in (0x00, 0x7F, 0xFF):
            data = good[:offset] + bytes([value]) + good[offset + 1 :]
            try:
                read_object(data, "x.o")
                outcomes.add("read")
            except ToolError:
                outcomes.add("refused")
    for length in range(0, len(good), 7):
        try:
            read_object(good[:length], "x.o")
        except ToolError:
            outcomes.add("truncated")
    assert outcomes == {"read", "refused", "truncated"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((0, b"MZ"), "not an ELF file"), ((0, b"\x36\x12"), "-omf=elf"), ((4, b"\2"), "32-bit little-endian"),
        ((18, b"\x3e\0"), "machine 62 at offset 18"),
        ((16, b"\2\0"), "executable cannot be linked"), ((32, b"\xff\xff\xff\x7f"), "truncated"),
    ],
)  # fmt: skip
def test_foreign_files_are_refused_by_what_they_are(change, message):
    """A file of another format is refused with a message that contains the file's name and the offset."""
    data = bytearray(object_bytes(assemble("nop\n", "x.s")[0]))
    data[change[0] : change[0] + len(change[1])] = change[1]
    with pytest.raises(ToolError, match=message) as error:
        read_object(bytes(data), "given.o")
    assert "given.o" in str(error.value)


def test_rela_sections_are_refused():
    """SHT_RELA sections are refused: the addend is in the field, SHT_REL (abi-elf.md §5)."""
    data = bytearray(object_bytes(assemble("call x\n", "x.s")[0]))
    (table,) = struct.unpack_from("<I", data, 32)
    (count,) = struct.unpack_from("<H", data, 48)
    for index in range(count):
        at = table + 40 * index + 4
        if struct.unpack_from("<I", data, at)[0] == 9:
            struct.pack_into("<I", data, at, 4)
    with pytest.raises(ToolError, match="SHT_REL"):
        read_object(bytes(data), "x.o")
