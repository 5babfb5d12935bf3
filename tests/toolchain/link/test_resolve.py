"""Symbol resolution across objects and libraries, section collection, and messages about missing names."""

import shutil
import subprocess

import pytest

from toolchain.asm.assemble import assemble
from toolchain.elf.archive import ArchiveMember, archive_bytes, open_archive, read_members
from toolchain.elf.read import read_object
from toolchain.elf.write import object_bytes
from toolchain.errors import ToolError
from toolchain.link.link import link
from toolchain.link.options import LinkOptions


def member(name: str, text: str) -> ArchiveMember:
    return ArchiveMember(name, object_bytes(assemble(text, name)[0]))


def test_all_undefined_and_duplicate_symbols_are_listed_with_their_objects(image):
    """One link lists all undefined and duplicate symbols with their objects and references."""
    with pytest.raises(ToolError) as error:
        image("f: call one\n mov two, w0\n .global twice\ntwice: nop\n", " call one\n", ".global twice\ntwice: nop\n")
    lines = str(error.value).splitlines()
    assert lines == [
        "2.o: error: duplicate symbol twice, defined in 0.o, 2.o",
        "0.o: error: undefined symbol one, referenced at 0.o:(.text+0x0 in f), 0.o:(.text+0x2 in f), "
        "1.o:(.text+0x0), 1.o:(.text+0x2); define it; assembly writes a C name with an underscore before it",
        "0.o: error: undefined symbol two, referenced at 0.o:(.text+0x4 in f); "
        "define it; assembly writes a C name with an underscore before it",
    ]


def test_a_missing_entry_is_an_undefined_symbol():
    """A missing entry is reported as an undefined symbol: without start-up code there is no image."""
    obj = assemble("nop\n", "x.s")[0]
    with pytest.raises(ToolError, match="undefined symbol __reset"):
        link([obj], [], LinkOptions())


def test_weak_definitions_yield_and_strong_ones_win(image):
    """Strong definitions replace weak ones in any order of objects (ELF)."""
    weak, strong, use = ".weak f\nf: mov #1, w0\n", ".global f\nf: mov #2, w0\n", "use: call f\n"
    for sources in ((weak, strong, use), (use, strong, weak)):
        out = image(*sources)
        assert out.flash[out.words("use", 1)[0] & 0xFFFF] == 0x200020


def test_archive_members_come_in_only_when_needed_and_bring_their_own_needs():
    """Archives form one group that is searched until no undefined symbol is found; weak references add no member.

    Source: abi-elf.md §2.8.
    """
    library = archive_bytes(
        [
            member("a.o", ".global a\na: call b\n"),
            member("b.o", ".global b\nb: return\n"),
            member("a_name_longer_than_fifteen.o", ".global c\nc: return\n"),
        ]
    )
    main = read_object(member("m", ".global __reset\n__reset: call a\n .weak c\n call c\n").data, "m.o")
    out = link([main], [open_archive(library, "lib.a")], LinkOptions())
    assert [o.name for o in out.resolution.objects] == ["m.o", "lib.a(a.o)", "lib.a(b.o)", "<linker>"]


def test_archives_round_trip_and_are_readable_by_gnu_ar():
    """Archives in the common ar format, with symbol index and long names, are reproducible and readable by GNU ar."""
    members = [member("x.o", ".global x\nx: nop\n"), member("a_name_longer_than_fifteen.o", ".global y\ny: nop\n")]
    data = archive_bytes(members)
    assert data == archive_bytes(members)
    assert [(m.name, m.data) for m in read_members(data, "l")] == [(m.name, m.data) for m in members]
    archive = open_archive(data, "l")
    assert {name: m.name for name, m in archive.index.items()} == {"x": "x.o", "y": "a_name_longer_than_fifteen.o"}


@pytest.mark.skipif(shutil.which("ar") is None, reason="GNU ar is not installed (Debian package binutils)")
def test_gnu_ar_and_ours_read_each_others_archives(tmp_path):
    """GNU ar and this archiver read each other's archives, with symbol index and long names."""
    members = [member("x.o", ".global x\nx: nop\n"), member("a_name_longer_than_fifteen.o", ".global y\ny: nop\n")]
    (tmp_path / "ours.a").write_bytes(archive_bytes(members))
    for entry in members:
        (tmp_path / entry.name).write_bytes(entry.data)

    def gnu_ar(*words):
        return subprocess.run(["ar", *words], cwd=tmp_path, capture_output=True, check=True).stdout

    assert gnu_ar("t", "ours.a").decode().split() == [entry.name for entry in members]
    assert gnu_ar("p", "ours.a", members[1].name) == members[1].data
    gnu_ar("rcs", "theirs.a", *(entry.name for entry in members))
    theirs = open_archive((tmp_path / "theirs.a").read_bytes(), "theirs.a")
    assert [(m.name, m.data) for m in theirs.members] == [(m.name, m.data) for m in members]


def test_an_archive_without_index_is_searched_too():
    """An archive without index is searched too: the index is derived from the members' symbol tables."""
    data = archive_bytes([member("x.o", ".global x\nx: nop\n")])
    size = int(data[8 + 48 : 8 + 58])
    bare = data[:8] + data[8 + 60 + size + (size & 1) :]
    assert open_archive(bare, "l").index["x"].name == "x.o"


@pytest.mark.parametrize("damage", [b"", b"!<arch>\n" + b"x" * 60, b"!<arch>\n" + b"y" * 10])
def test_damaged_archives_are_refused(damage):
    """Damaged archives are refused with a clear error."""
    with pytest.raises(ToolError):
        open_archive(damage, "l.a")


def test_collection_keeps_what_the_roots_reach(image):
    """--gc-sections keeps sections that the roots reach.

    Roots: entry, vectors, fixed and EEPROM sections. Edges: calls, tables and handles.
    """
    text = """
    .global __reset, __T1Interrupt
    .section .text.start,code
 __reset: call used
    mov #table, w0
    .section .text.isr,code
 __T1Interrupt: retfie
    .section .text.used,code
 used: return
    .section .text.viatable,code
 viatable: return
    .section .ndata.table,data,near
 table: .word handle(viatable)
    .section .text.gone,code
 gone: call gonetoo
    .section .text.gonetoo,code
 gonetoo: return
    .section .nbss.gone,bss,near
 gonedata: .space 100
    .section fixed,code,address(0x1000)
 fixed: nop
    .section .debug_info,info
    .4byte gone
    """
    out = image(text, gc_sections=True)
    named = {"used", "viatable", "table", "gone", "gonetoo", "gonedata", "fixed", "__T1Interrupt"}
    assert named & out.symbols.keys() == {"used", "viatable", "table", "fixed", "__T1Interrupt"}
    info = next(s for s in out.linked.image.sections if s.name == ".debug_info")
    assert not any(info.data)
    assert "gone" in image(text).symbols


def test_collection_keeps_sections_whose_start_or_size_is_read(image):
    """--gc-sections keeps a section whose start or size an operator reads, such as `.startof.(x)`."""
    text = (
        ".global __reset\n__reset: mov #.startof.(mine), w0\n .section mine,bss,near\nkept: .space 4\n"
        " .section not,bss\nx: .space 2\n"
    )
    out = image(text, gc_sections=True)
    assert "kept" in out.symbols
    assert "x" not in out.symbols
    assert out.words("__reset", 1)[0] >> 4 & 0xFFFF == out.symbols["kept"]


def test_undefined_names_in_discarded_sections_do_not_matter(image):
    """Undefined names in discarded sections are not reported."""
    text = ".global __reset\n__reset: nop\n .section x,code\n call missing\n"
    image(text, gc_sections=True)
    with pytest.raises(ToolError, match="missing"):
        image(text)


def test_linking_is_repeatable(image):
    """Linking the same inputs gives the same bytes."""
    from toolchain.elf.write import executable_bytes

    texts = [f".global f{n}\nf{n}: call f{(n + 1) % 5}\n .section .nbss,bss,near\nv{n}: .space {n}\n" for n in range(5)]
    first, second = (executable_bytes(image(*texts).linked.image) for _ in range(2))
    assert first == second


def test_the_map_lists_symbols_with_sizes_and_discarded_sections(image):
    """The map lists symbols with sizes, memory use, discarded sections and data records."""
    from toolchain.link.mapfile import map_text

    out = image(
        ".global __reset\n__reset: nop\n nop\nnext: nop\n .section un,code\nunused: nop\n"
        " .section .nbss,bss,near\nv: .space 6\n",
        gc_sections=True,
    )
    text = map_text(out.linked)
    rows = {line.split()[-1]: line.split() for line in text.splitlines() if line.split()}
    assert rows["next"][1:3] == ["0x2", "3"]
    assert "un" in text.split("Left out by --gc-sections")[1]
    assert "stack gets 0x800..0x27f0" in text


def test_objects_for_another_part_are_mentioned():
    """Objects for another device cause a warning; e_flags name the device, and generic ids fit all (abi-elf.md
    §6.1)."""
    obj = assemble(".global __reset\n__reset: nop\n", "x.s")[0]
    for processor, warned in ((0x1F, False), (0x18, True), (0, False), (90, False), (0x40, True)):
        obj.processor = processor
        assert bool(link([obj], [], LinkOptions()).messages) is warned
