"""Placement of sections, and messages if they do not fit (abi-elf.md §1.4, §3.3)."""

import itertools

import pytest

from toolchain.errors import ToolError
from toolchain.link.memory import Pool

PLACE = ".section {0},{1}\n{0}_: .space {2}\n"


def test_the_stack_gets_the_largest_free_block(image):
    """The stack gets the largest free block: __SP_init is its first even address, __SPLIM_init = end - guard = 0x27F0.

    Source: abi-elf.md §3.3.
    """
    out = image(" mov #__SP_init, w15\n mov #__SPLIM_init, w14\n .section .nbss,bss,near\n .space 0x101\n")
    assert (out.symbols["__SP_init"], out.symbols["__SPLIM_init"]) == (0x902, 0x27F0)
    assert image("nop\n", stack_guard=32).linked.stack == (0x800, 0x27E0)
    with pytest.raises(ToolError, match="no room for the stack: 240 bytes"):
        image(".bss\n .space 0x1F10\n", stack=256)


def test_near_data_lies_low_and_far_data_spills_over(image):
    """Near data is placed below the limit 0x1FFF, and far data fills the rest (abi-elf.md §1.4)."""
    out = image(PLACE.format("far", "bss", 0xA00) + PLACE.format("near", "bss,near", 0x1400))
    assert out.symbols["near_"] == 0x800
    assert out.symbols["far_"] == 0x1C00  # spans the near limit 0x2000
    with pytest.raises(ToolError) as error:
        image(PLACE.format("near", "bss,near", 0x1400) + PLACE.format("more", "bss,near", 0x420))
    assert "near data memory 0x800..0x1fff overflows by 32 bytes" in str(error.value)
    assert "largest symbols: near_ (5120), more_ (1056)" in str(error.value)


def test_x_and_y_memory(image):
    """Y sections are placed from the top of RAM downward (abi-elf.md §3.3), X sections in 0x800-0x17FF (isa.md
    §1.2)."""
    out = image(PLACE.format("ys", "bss,ymemory", 0x100) + PLACE.format("xs", "bss,xmemory", 0x100))
    assert (out.symbols["ys_"], out.symbols["xs_"]) == (0x2700, 0x800)
    with pytest.raises(ToolError, match="overflows by 2 bytes"):
        image(PLACE.format("xs", "bss,xmemory", 0x1002))


def test_fixed_aligned_and_reversed_sections(image):
    """`address(n)`, `align(n)` and `reverse(n)` are observed; reverse aligns the section's end + 1 (isa.md §3.6)."""
    text = (
        PLACE.format("fix", "bss,address(0x1000)", 4)
        + PLACE.format("ali", "bss,near,align(64)", 6)
        + PLACE.format("rev", "bss,reverse(64)", 40)
    )
    out = image(text)
    assert out.symbols["fix_"] == 0x1000
    assert out.symbols["ali_"] % 64 == 0
    assert (out.symbols["rev_"] + 40) % 64 == 0
    for bad in ("bss,address(0x700)", "bss,address(0x27FF)", "code,address(0x18000)", "code,address(0x80)"):
        with pytest.raises(ToolError, match=r"leaves|odd"):
            image(PLACE.format("bad", bad, 4))
    with pytest.raises(ToolError, match="overlaps"):
        image(PLACE.format("one", "code,address(0x400)", 8) + PLACE.format("two", "code,address(0x406)", 8))


def test_fixed_code_splits_the_rest_around_it(image):
    """Free code fills the gaps around code with fixed addresses, without overlap."""
    parts = [f".section s{n},code\n.global s{n}_\ns{n}_: .space 0x300\n" for n in range(4)]
    out = image(*parts, ".section fix,code,address(0x400)\nfix_: .space 0x300\n")
    spans = sorted((s.load, s.load + s.units) for s in out.linked.image.sections if s.is_code)
    assert all(end <= start for (_, end), (start, _) in itertools.pairwise(spans))
    assert out.symbols["fix_"] == 0x400


def test_program_memory_overflow_counts_bytes_and_words(image):
    """Program memory overflow is reported in bytes and words of 147,456 bytes less the vectors (isa.md §1.1)."""
    with pytest.raises(ToolError) as error:
        image(*(f"f{n}: .space 0x8000\n .space 0x7ffe\n" for n in range(2)))
    assert "program memory 0x100..0x17fff overflows by" in str(error.value)
    assert "instruction words); largest symbols: f" in str(error.value)


def test_what_is_kept_free_is_named_when_the_rest_has_no_room(image):
    """A section that is never loaded reserves its range: code ends below, and the overflow message names it."""
    kept = ".section .kept,code,address(0x16000),noload\n.space 0x2000\n"
    out = image(kept, ".section much,code\n.space 0x15E00\n")
    used = [s for s in out.linked.image.sections if s.is_code and s.name != ".kept" and s.load < 0x18000]
    assert 0x15E00 < max(s.load + s.units for s in used) <= 0x16000
    with pytest.raises(ToolError, match=r"overflows by \d+ bytes .*; at fixed addresses: \.kept 0x16000\.\.0x17fff"):
        image(kept, ".section much,code\n.space 0x15F00\n")


def test_common_symbols_merge_to_the_largest(image):
    """Common symbols merge to the largest one, and a definition replaces them (ELF)."""
    out = image(
        ".comm buf, 4\n mov buf, w0\n",
        ".comm buf, 20, 4\n",
        ".comm other, 2\n",
        ".section .ndata,data,near\n .global other\nother: .word 5\n",
    )
    assert out.symbols["buf"] % 4 == 0
    assert next(s.size for s in out.linked.image.symbols if s.name == "buf") == 20
    assert next(s.section.name for s in out.linked.image.symbols if s.name == "other") == ".ndata"


def test_a_stack_section_of_the_program_is_the_stack(image):
    """A program's section of type `stack` becomes the stack (abi-elf.md §4.3)."""
    out = image(".section mystack,stack\n .space 256\n")
    assert out.linked.stack[1] - out.linked.stack[0] == 256 - 16


def test_the_pool_keeps_windows_and_never_gives_the_same_place_twice():
    """The pool allocates first-fit without overlap; with a window no block crosses a multiple of it."""
    pool = Pool(0x100, 0x20000)
    taken = [(pool.allocate(size, 2, 0, 1 << 24, 0x8000), size) for size in (0x7000, 0x2000, 0x8000, 0xE00, 2)]
    assert taken[0][0] == 0x100
    assert taken[1][0] == 0x8000
    assert taken[2][0] == 0x10000
    assert all(at // 0x8000 == (at + size - 1) // 0x8000 for at, size in taken)
    spans = sorted((at, at + size) for at, size in taken)
    assert all(end <= start for (_, end), (start, _) in itertools.pairwise(spans))
