"""Contents of a linked image: reset, vectors, initialised data, constants, handles, config words, EEPROM."""

import pytest

from emu.chips.dspic30f6014a import VECTORS
from toolchain.errors import ToolError


def test_reset_goes_to_the_entry(image):
    """The reset vector is a GOTO to the entry: 0x040000 | (target & 0xFFFE), target >> 16 (abi-elf.md §7 item 6)."""
    out = image()
    target = out.symbols["__reset"]
    assert (out.flash[0], out.flash[2]) == (0x040000 | target, 0)
    assert out.linked.image.entry == target


def test_every_vector_is_filled(image):
    """Every vector is filled (abi-elf.md §2.7).

    `__X` is entered in both tables, `__AltX` in the alternate one only, the default handler elsewhere.
    """
    out = image(
        ".global __T1Interrupt, __AltT1Interrupt, __U1RXInterrupt\n__T1Interrupt: retfie\n"
        "__AltT1Interrupt: retfie\n__U1RXInterrupt: retfie\n"
    )
    default, names = out.symbols["__DefaultInterrupt"], {v.name: v for v in VECTORS}
    assert len(names) == 62
    assert out.flash[names["T1Interrupt"].ivt] == out.symbols["__T1Interrupt"]
    assert out.flash[names["T1Interrupt"].aivt] == out.symbols["__AltT1Interrupt"]
    assert out.flash[names["U1RXInterrupt"].aivt] == out.symbols["__U1RXInterrupt"]
    rest = [v for v in VECTORS if v.name not in ("T1Interrupt", "U1RXInterrupt")]
    assert {out.flash[a] for v in rest for a in (v.ivt, v.aivt)} == {default}
    assert (names["T1Interrupt"].ivt, names["T1Interrupt"].aivt) == (4 + 2 * 11, 0x84 + 2 * 11)


def test_the_default_handler_is_breakpoint_and_reset_unless_given(image):
    """The default handler is breakpoint and RESET, 0xDA4000 and 0xFE0000, unless the program defines one (abi-elf.md
    §3.3)."""
    assert image().words("__DefaultInterrupt", 2) == [0xDA4000, 0xFE0000]
    own = image(".global __DefaultInterrupt\n__DefaultInterrupt: nop\n")
    assert own.words("__DefaultInterrupt", 1) == [0]
    assert own.flash[4] == own.symbols["__DefaultInterrupt"]


def test_a_handler_no_vector_takes_is_refused_with_the_name_meant(image):
    """A handler whose name fits no vector of the device is refused with a similar name (abi-elf.md §2.7)."""
    with pytest.raises(ToolError, match=r"__T1Interupt|did you mean __T1Interrupt") as error:
        image(".global __T11Interrupt\n__T11Interrupt: retfie\n")
    assert "did you mean __T1Interrupt?" in str(error.value)


def decode_dinit(out):
    """Return (address, bytes or number of zeros) of each record of .dinit (abi-elf.md §3.2)."""
    at = out.symbols["__dinit_tbloffset"] | out.symbols["__dinit_tblpage"] << 16
    records = []
    while address := out.flash[at] & 0xFFFF:
        length, form = out.flash[at + 2] & 0xFFFF, out.flash[at + 4] & 0x7F
        at += 6
        if form == 0:
            records.append((address, length))
            continue
        step, data = {1: 2, 2: 3}[form], b""
        while len(data) < length:
            data += out.flash[at].to_bytes(3, "little")[:step]
            at += 2
        records.append((address, data[:length]))
    return records


REFER = " mov #__dinit_tbloffset, w0\n mov #__dinit_tblpage, w1\n"


@pytest.mark.parametrize("pack", [True, False])
def test_dinit_clears_and_fills_ram(image, pack):
    """.dinit clears and fills RAM (abi-elf.md §3.2).

    It has header words, formats 0, 1 and 2, even lengths and an end word 0; relocated data are included.
    """
    text = (
        f"{REFER} .section .nbss,bss,near\nz: .space 5\n .section .ndata,data,near\nd: .byte 1,2,3,4,5\n"
        " .align 2\n .word d, handle(f)\n"
        " .section .zeros,data,near\n .space 4\n .section keep,persist\n .space 4\n"
        " .section raw,data,noload\n .word 7\n .text\nf: nop\n"
    )
    out = image(text, pack_data=pack)
    d, f = out.symbols["d"], out.symbols["f"]
    assert decode_dinit(out) == [
        (out.symbols["z"], 6),
        (d, bytes([1, 2, 3, 4, 5, 0, d & 255, d >> 8, f & 255, f >> 8])),
        (d + 10, 4),
    ]


def test_neighbouring_sections_share_one_record(image):
    """Neighbouring sections share one record, which is shorter and decodes to the same data (abi-elf.md §3.2)."""
    texts = [f".section .nbss,bss,near\n .space {2 * n}\n .section .ndata,data,near\n .word {n}\n" for n in (1, 2, 3)]
    records = decode_dinit(image(REFER, *texts))
    assert records == [(0x800, 12), (0x80C, bytes([1, 0, 2, 0, 3, 0]))]


def test_initialised_data_is_in_the_file_for_information_only(image):
    """Initialised data is in the file for information only: PROGBITS with NOLOAD and phantoms (abi-elf.md §6.3, §7
    item 4)."""
    (section,) = image(".section .ndata,data,near\n .byte 1,2\n").sections(".ndata")
    assert (section.flags, bytes(section.data)) == (0x01800003, bytes([1, 0, 2, 0]))


def test_constants_are_read_through_the_psv_window(image):
    """Constants are stored as b0 b1 0 with VMA = 0x8000 | LMA and their page in __const_psvpage.

    Source: abi-elf.md §6.2, §6.4, §3.3.
    """
    text = (
        ".section .const,psv,page\nc: .byte 0x11, 0x22, 0x33\n .text\n mov #c, w0\n"
        " mov #psvoffset(c), w1\n mov #__const_psvpage, w2\n mov #__const_length, w3\n"
        " mov #psvpage(c), w4\nx: nop\n"
    )
    out = image(text + ".global x\n", fill_upper=0x3F)
    (section,) = out.sections(".const")
    assert (section.flags, section.address) == (0x10000002, 0x8000 | section.load)
    assert bytes(section.data) == bytes([0x11, 0x22, 0x3F, 0, 0x33, 0, 0x3F, 0])
    words = out.words("x", 0) or [out.flash[out.symbols["x"] - 10 + 2 * i] for i in range(5)]
    fields = [word >> 4 & 0xFFFF for word in words]
    assert fields == [section.address, section.address, 0, 4, 0]


def test_all_constants_share_one_window_even_behind_much_code(image):
    """All constants are in one 32 KB PSV window, also after much code (abi-elf.md §1.4, §3.3)."""
    code = ".section big{0},code,address({1})\n .pspace 0x{2:x}\n"
    block = code.format(0, 0x200, 0x7D00 // 2 * 3)
    out = image(block, ".section .const,psv,page\na: .space 0x300\n", ".section .const,psv,page\nb: .space 0x300\n")
    loads = [s.load for s in out.sections(".const")] + [s.load + s.units - 1 for s in out.sections(".const")]
    assert len({load >> 15 for load in loads}) == 1


def test_too_many_constants_name_the_largest(image):
    """If the constants exceed the window, the message has the number of missing bytes and the five largest symbols."""
    text = (
        ".section .const,psv,page\n" + "".join(f"t{n}: .space {0x1000 * n}\n" for n in range(1, 6)) + "last: .space 2\n"
    )
    with pytest.raises(ToolError) as error:
        image(text)
    assert "28674 bytes too large" in str(error.value)
    assert "largest symbols: t5 (20480), t4 (16384), t3 (12288), t2 (8192), t1 (4096)" in str(error.value)


def test_handles_are_own_addresses_low_and_slots_high(image):
    """A handle is the function's address if that is below 0x10000, otherwise a GOTO slot in .handle (abi-elf.md
    §1.5)."""
    text = """
    .section hi,code,address(0x12340)
 far: nop
    .text
 near: nop
 user: mov #handle(far), w0
    mov #handle(near), w1
    .section .ndata,data,near
 table: .word handle(far)
    """
    out = image(text)
    slot = out.flash[out.symbols["user"]] >> 4 & 0xFFFF
    assert (out.flash[slot], out.flash[slot + 2]) == (0x042340, 0x000001)
    assert out.flash[out.symbols["user"] + 2] >> 4 & 0xFFFF == out.symbols["near"]
    assert bytes(out.sections(".ndata")[0].data) == bytes([slot & 255, 0, slot >> 8, 0])
    with pytest.raises(ToolError, match="no-handles"):
        image(text, handles=False)


def test_pointers_that_reach_every_function_cost_no_flash(image):
    """If pointers can reach all functions, .handle needs no flash: it only lists functions with a taken address.

    Source: abi-elf.md §1.5.
    """
    out = image(".text\n near: nop\n user: mov #handle(near), w0\n")
    (handle,) = out.sections(".handle")
    assert not handle.is_code
    assert len(out.flash) == len(image(".text\n near: nop\n user: mov #0, w0\n").flash)


def test_config_words_go_to_their_registers(image):
    """Config words are placed at their registers: __FOSC.sec at 0xF80000 and so on (abi-elf.md §6.6).

    The sections have code flags; the output sections lack .sec.
    """
    text = (
        ".section __FOSC.sec,code\n .global __FOSC\n__FOSC: .pword 0xC106\n .section __FWDT.sec,code\n .word 0x003F\n"
    )
    out = image(text)
    assert (out.flash[0xF80000], out.flash[0xF80002]) == (0xC106, 0x003F)
    (section,) = out.sections("__FOSC")
    assert (section.flags, section.address, len(section.data)) == (6, 0xF80000, 4)
    with pytest.raises(ToolError, match="already set by"):
        image(text, ".section __FOSC.sec,code\n .pword 1\n")
    with pytest.raises(ToolError, match="is one"):
        image(".section __FOSC.sec,code\n .pword 1, 2\n")


def test_eeprom_contents(image):
    """EEPROM data has LMA 0x7FF000, VMA 0xF000 and upper bytes 0 (abi-elf.md §6.4, §6.6)."""
    out = image(
        ".section .eedata,eedata\ne: .word 0x1234\n .byte 5\n .text\n mov #tbloffset(e), w0\n"
        " mov #tblpage(e), w1\nx: nop\n.global x\n"
    )
    (section,) = out.sections(".eedata")
    assert (section.flags, section.address, section.load) == (0x20000002, 0xF000, 0x7FF000)
    assert (out.flash[0x7FF000], out.flash[0x7FF002]) == (0x1234, 0x0005)
    at = out.symbols["x"]
    assert [out.flash[at - 4] >> 4 & 0xFFFF, out.flash[at - 2] >> 4 & 0xFFFF] == [0xF000, 0x7F]


def test_user_init_calls_are_collected_and_closed_with_return(image):
    """User initialisation calls are collected in __user_init, and the linker appends RETURN (abi-elf.md §3.3).

    __has_user_init is set.
    """
    call = ".section .user_init,code\n rcall {0}\n .text\n{0}: return\n"
    use = " .weak __user_init, __has_user_init\nuse: mov #__has_user_init, w0\n call __user_init\n"
    out = image(use, call.format("one"), call.format("two"))
    at = out.symbols["__user_init"]
    words = [out.flash[at + 2 * i] for i in range(3)]
    assert [w >> 16 for w in words[:2]] == [7, 7]
    assert words[2] == 0x060000
    assert out.words("use", 2) == [0x200010, 0x020000 | at]
    assert image(use).words("use", 2) == [0x200000, 0x020000]


def test_section_limits_resolve(image):
    """Section limits resolve to address units (abi-elf.md §4.2)."""
    out = image(
        "u: mov #.startof.(.nbss), w0\n mov #.sizeof.(.nbss), w1\n mov #.endof.(.nbss), w2\n"
        " .section .nbss,bss,near\n .space 10\n"
    )
    assert [w >> 4 & 0xFFFF for w in out.words("u", 3)] == [0x800, 10, 0x80A]


def test_linker_and_device_symbols(image):
    """The linker defines its own symbols (abi-elf.md §3.3) and those of the device, SFRs in both spellings (§2.6)."""
    names = [
        "__DATA_BASE", "__DATA_LENGTH", "__YDATA_BASE", "__CODE_BASE", "_PORTD", "PORTD", "_PORTDbits", "__heap",
        "__eheap",
    ]  # fmt: skip
    text = "u:" + "".join(f" mov #{n}, w0\n" for n in names)
    out = image(text, heap=100)
    assert [w >> 4 & 0xFFFF for w in out.words("u", len(names))] == [
        0x800, 0x2000, 0x1800, 0x100, 0x2D4, 0x2D4, 0x2D4, 0x800, 0x864,
    ]  # fmt: skip


def test_an_object_may_define_a_device_symbol_itself(image):
    """Definitions of the program take precedence over symbols of the device."""
    out = image(".global PORTD\nPORTD = 0x900\nu: mov PORTD, w0\n")
    assert out.words("u", 1) == [0x800000 | 0x900 << 3]
