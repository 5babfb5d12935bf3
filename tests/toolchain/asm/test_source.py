"""Reading sources: comments, labels, macros, repeats, conditionals, include files (abi-elf.md §4.1, §4.3)."""

import pytest

from toolchain.asm.assemble import assemble
from toolchain.errors import ToolError


def test_comments_labels_and_local_labels(asm):
    """Comments, several labels per line and local labels are accepted (abi-elf.md §4.1).

    `;` starts a comment anywhere, `#` at the start of a line; /* */ may span lines; local labels are 1: 1b 1f.
    """
    out = asm(
        "# whole line; bra nowhere\n"
        "a: b: nop ; c: nop\n"
        "/* mov #1, w0\n   still */ d: nop /* x */ ; y\n"
        '1: nop\n 1: bra 1b\n bra 1f\n1: mov #\';\', w0\n .ascii "; /* # \\" "\n'
    )
    assert [out.symbols[n].value for n in "abd"] == [0, 0, 2]
    assert [out.symbols[name].value for _, _, name in out.relocs()] == [6, 10]
    assert out.words()[5] == 0x2003B0


def test_mnemonics_and_registers_ignore_case_but_symbols_do_not(asm):
    """Mnemonics and registers are case-insensitive, symbols are case-sensitive (abi-elf.md §4.1)."""
    out = asm("MOV #1, W3\n Inc.B wreg_, WREG\n BRA Nz, X\nx: X: nop\n")
    assert out.words()[0] == 0x200013
    assert {"x", "X"} <= out.symbols.keys()


def test_macros_take_defaults_keywords_and_a_serial_number(asm):
    r"""Macros support \name, \@, \(), defaults and keyword arguments; a dot ends a name (GNU as 2.14)."""
    out = asm(
        ".macro put reg, val=7, size\n mov\\size #\\val, \\reg\nl\\@\\()_x: nop\n.endm\n"
        " put w1\n put val=2 reg=w3\n put w0, 9, .b\n"
    )
    assert out.words() == [0x200071, 0, 0x200023, 0, 0xB3C090, 0]
    assert {"l0_x", "l1_x", "l2_x"} <= out.symbols.keys()


def test_macros_nest_end_early_and_can_be_purged(asm):
    """.exitm ends the innermost macro with its conditionals, and .purgem deletes a macro; macros nest."""
    text = """
    .macro inner n
      .if \\n > 2
        mov #\\n, w0
        .exitm
      .endif
      nop
    .endm
    .macro outer
      inner 1
      inner 5
    .endm
    outer
    .purgem inner
    .macro inner n
      mov #9, w0
    .endm
    inner 1
    """
    assert asm(text).words() == [0, 0x200050, 0x200090]


def test_repeats(asm):
    """.rept, .irp and .irpc repeat their bodies and may be nested."""
    text = ".rept 2\n .irp r, w1, w2\n clr \\r\n .endr\n .endr\n .irpc c, 34\n clr w\\c\n .endr\n"
    assert asm(text).words() == [0xEB0080, 0xEB0100] * 2 + [0xEB0180, 0xEB0200]


@pytest.mark.parametrize(
    ("condition", "taken"),
    [
        (".if 1", True), (".if 0", False), (".ifdef known", True), (".ifdef other", False), (".ifndef other", True),
        (".ifeq 0", True), (".ifne 0", False), (".ifgt 1", True), (".ifge 0", True), (".iflt 0", False),
        (".ifle 0", True), (".ifc a b, a b", True), (".ifc a, b", False), (".ifnc a, b", True),
        ('.ifeqs "x", "x"', True), (".ifdef __30F6014A", True), (".if __HAS_DSP", True),
    ],
)  # fmt: skip
def test_conditions(asm, condition, taken):
    """Conditional directives select text (abi-elf.md §4.3, control group); the symbols of the device are predefined."""
    out = asm(f"known = 0\n{condition}\n mov #1, w0\n .else\n mov #2, w0\n .endif\n")
    assert out.words() == [0x200010 if taken else 0x200020]


def test_conditionals_nest_and_skip_everything_inside(asm):
    """Within skipped text only conditional directives have an effect, and they nest."""
    text = (
        ".if 0\n .if 1\n rubbish ! here\n .else\n more\n .endif\n .elseif 1\n nop\n .elseif 1\n"
        " mov #3, w0\n .else\n bad\n .endif\n"
    )
    assert asm(text).words() == [0]


def test_include_looks_beside_the_source_and_in_the_folders_given(tmp_path, asm):
    """.include searches the source's folder and the given folders; messages name the included file and line."""
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "far.inc").write_text(' mov #2, w0\n .include "near.inc"\n')
    (tmp_path / "lib" / "near.inc").write_text(" mov #3, w0\n frob\n")
    main = tmp_path / "main.s"
    main.write_text(' .include "far.inc"\n mov #1, w0\n')
    from toolchain.asm.state import Options

    with pytest.raises(ToolError) as error:
        assemble(main.read_text(), str(main), Options(include=[str(tmp_path / "lib")]))
    assert f"{tmp_path}/lib/near.inc:2: error: unknown instruction 'frob'" in str(error.value)


def test_line_markers_of_the_c_preprocessor_move_the_place_of_messages(asm):
    """A line marker `# 12 "file"` of the C preprocessor sets the position of messages."""
    with pytest.raises(ToolError, match=r"user\.S:41: error: unknown instruction"):
        asm('# 1 "user.S"\n nop\n# 40 "user.S" 2\n nop\n frob\n')


def test_incbin_takes_a_part_of_a_file(tmp_path):
    """.incbin "file", skip, count includes a part of a file."""
    (tmp_path / "blob").write_bytes(bytes(range(10)))
    obj, _ = assemble(f'.data\n .incbin "{tmp_path}/blob", 2, 3\n', "x.s")
    assert obj.sections[1].data[::2] == bytes([2, 3, 4])


def test_all_errors_of_a_file_are_reported_with_their_lines(asm):
    """One run reports all errors of a file with their lines."""
    with pytest.raises(ToolError) as error:
        asm("frob\n nop\n mov #70000, w0\nx:\nx: nop\n .frob\n bra 9f\n .word 1f\n")
    lines = str(error.value).splitlines()
    assert [line.split(":")[1] for line in lines] == ["1", "3", "5", "6"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (".if 1\n nop\n", "never closed"), (".endif\n", "without .if"), (".else\n", "without .if"),
        (".macro m\n nop\n", "never closed"), (".endm\n", "without .macro"), (".endr\n", "without .rept"),
        (".rept 3\n nop\n", "never closed"), (".rept -1\n .endr\n", "outside"),
        (".macro m\n m\n .endm\n m\n", "nested deeper"),
        (".rept 99999999\n nop\n .endr\n", "outside"), (".exitm\n", "outside a macro"),
        ('.include "no"\n', "cannot find"),
        (".macro m a\n nop\n .endm\n m 1, 2\n", "takes 1 arguments"),
        (".if undefined\n .endif\n", "must be a constant"),
        (".error \"stop\"\n", "error: stop"), (".err\n", ".err"), (".abort\n", ".abort"), (".zero 4\n", "use .space"),
        (".balign 4\n", "use .align"), (".quad 1\n", "two .long"), (".loc 1 2\n", "does not exist"),
        (".cfi_startproc\n", ".cfi_startproc does not exist in this assembler: omit it"),
        (".cfi_def_cfa_offset 8\n", "found from its instructions"),
        ("1 + 2\n", "cannot read"),
        (".if 1\n .else\n .else\n .endif\n", "second .else"), ("bra 1b\n", "not defined before"),
        ("bra 9f\n", "label 9: is used but"), (" bra .Lx\n", "label .Lx is used but"),
        (".frob\n", "unknown directive"),
        (".global 1x\n", "expected a symbol"), (".section\n", "bad section name"), (".popsection\n", "without"),
        (".section a,code\n nop\n .section a,data\n", "other attributes"),
        (".section a,frob\n", "unknown section attribute"),
        (".section a,code,near\n", "data sections"), (".section a,code,data\n", "both code and data"),
        (".local q\n .word q\n", "never defined"),
        ("a = b\n b = a\n .word a\n", "in terms of itself"), (".section a,dma\n", "other than the 30F6014A"),
        (".comm a\n", "comma"), (".bss a, -1\n", "outside the data space"),
        (".type a, @frob\n", "unknown symbol type"),
    ],
)  # fmt: skip
def test_structural_mistakes_have_a_clear_message(asm, text, message):
    """Unbalanced and misplaced directives are refused with a clear message (abi-elf.md §4.3)."""
    with pytest.raises(ToolError) as error:
        asm(text)
    assert message in str(error.value)


def test_the_device_include_is_there_without_a_file(asm):
    """The device include file is built in: bits (numbered in wide fields), settings and `config`.

    The linker defines the registers.
    """
    out = asm(
        ' .equ __30F6014A, 1\n .include "p30f6014A.INC"\n config __FOSC, CSW_FSCM_OFF & XT_PLL8\n'
        " bclr IFS0, #U1RXIF\n bset IPC10, #DCIIP2\n bra N, 1f\n1: pwrsav #IDLE_MODE\n"
    )
    assert out.words("__FOSC.sec") == [0xFFE6]
    assert out.symbols["__FOSC"].section.name == "__FOSC.sec"
    assert out.words() == [0xA92001, 0xA8C000, 0x330000, 0xFE4001]
    assert out.relocs()[0][2] == "IFS0"


def test_a_device_include_of_the_users_own_comes_first(tmp_path):
    """A device include file of the user takes precedence over the built-in one."""
    (tmp_path / "p30f6014A.inc").write_text(" .equ MINE, 7\n")
    obj, _ = assemble(' .include "p30f6014A.inc"\n mov #MINE, w0\n', str(tmp_path / "x.s"))
    assert bytes(obj.sections[0].data) == bytes([0x70, 0, 0x20, 0])


def test_a_macro_may_be_redefined(asm):
    """A macro may be redefined with a warning (pic30-as), so that an include file may be read twice."""
    out = asm(".macro m\n .word 1\n .endm\n m\n .macro m a\n .word \\a\n .endm\n m 5\n")
    assert out.words() == [1, 5]
    assert out.messages == ["test.s:5: warning: macro m has been defined before: this definition replaces that one"]


def test_what_equiv_defined_can_be_set_later(asm):
    """.set may redefine a symbol that .equiv has defined, but no label; .equiv refuses a defined symbol (GNU as)."""
    assert asm(".equiv depth, 0\n .set depth, depth + 2\n .equ depth, depth + 2\n .word depth\n").words() == [4]
    with pytest.raises(ToolError, match="already defined"):
        asm(".set depth, 1\n .equiv depth, 2\n")


@pytest.mark.parametrize(
    ("before", "known"),
    [(".extern it", True), (".equ it, 9", True), ("it: nop", True), (".global it", True), ("mov #it, w0", True),
     ("", False)],
)  # fmt: skip
def test_ifdecl_asks_whether_a_name_has_been_mentioned(asm, before, known):
    """.ifdecl tests whether a symbol has been declared; it need not be defined (pic30-as)."""
    text = f"{before}\n .ifdecl it\n .pword 1\n .else\n .pword 2\n .endif\n .ifndecl it\n .pword 3\n .endif\n"
    assert asm(text).words()[-2 + known :] == ([1] if known else [2, 3])


def test_a_file_may_be_named_with_backslashes(asm, tmp_path):
    """File names may contain backslashes, as in MPLAB projects from Windows; they are no escapes."""
    (tmp_path / "new" / "table").mkdir(parents=True)
    (tmp_path / "new" / "table" / "two.inc").write_text(" .word 2\n")
    (tmp_path / "new" / "bits.bin").write_bytes(b"\x34\x12")
    out = asm('.include "new\\table\\two.inc"\n .incbin ".\\new\\bits.bin"\n', include=[str(tmp_path)])
    assert out.words() == [2, 0x1234]
    for device in ("..\\inc\\p30F6014A.inc", "xc.inc", "p30fxxxx.inc"):
        assert asm(f'.include "{device}"\n .word IVRIF, ACKSTAT\n').words() == [7, 15]


def test_bss_with_operands_reserves_room(asm):
    """`.bss name, size, alignment` reserves space (pic30-as)."""
    out = asm(".bss a, 3\n .bss b, 8, 16\n nop\n")
    assert [out.symbols[n].value for n in "ab"] == [0, 16]
    assert (out.sections[".bss"].units, out.words()) == (24, [0])


def test_the_device_include_names_bytes_of_registers(asm):
    """The device include file names the bytes of registers: `bset.b CORCONL, #PSV`.

    Register names keep their meaning.
    """
    named = asm('.include "xc.inc"\n bset.b CORCONL, #PSV\n mov.b SRH, WREG\n mov #OSCCONL, w1\n clr.b MODCONH\n')
    plain = asm(" bset.b 0x44, #2\n mov.b 0x43, WREG\n mov #OSCCONL, w1\n clr.b 0x47\n")
    assert (named.words(), named.relocs()) == (plain.words(), plain.relocs())


def test_a_number_sign_before_a_value_means_nothing(asm):
    """A number sign before a value in an expression has no effect (pic30-as)."""
    assert asm(".equ rate, #0x70\n .word #rate, # 5\n mov #rate, w0\n").words() == [0x70, 5, 0x200700]
