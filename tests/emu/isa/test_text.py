"""Parsing of assembly statements, and messages for invalid ones."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from emu.dspic30f.isa import codec, text


@pytest.mark.parametrize(
    ("written", "same"),
    [
        ("PUSH w3", "mov.w w3, [w15++]"),
        ("pop [w4]", "mov.w [--w15], [w4]"),
        ("push.w [w1+w2]", "mov.w [w1+w2], [w15++]"),
        ("push.d w8", "mov.d w8, [w15++]"),
        ("pop.d W10", "mov.d [--w15], w10"),
        ("bra geu, 0x200", "bra c, 0x200"),
        ("bra LTU, 0x200", "bra NC, 0x200"),
        ("bra eq, 0x200", "bra Z, 0x200"),
        ("bra neq, 0x200", "bra NZ, 0x200"),
        ("bsw w1, w2", "bsw.z w1, w2"),
        ("btst [w1++], #3", "btst.z [w1++], #3"),
        ("btst w1, w2", "btst.z w1, w2"),
        ("btsts w1, #3", "btsts.z w1, #3"),
        ("div.s w4, w5", "div.sw w4, w5"),
        ("div.u w4, w5", "div.uw w4, w5"),
        ("sub w3, #100", "sub.w #100, w3"),
        ("subb.b w3, #-1", "subb.b #255, w3"),
        ("add [w1++], A", "add [w1++], #0, A"),
        ("lac w1, B", "lac w1, #0, B"),
        ("sac A, w1", "sac A, #0, w1"),
        ("sac.r b, [w1]", "sac.r B, #0, [w1]"),
        ("mac w4*w4, a, [ w8 ] += 2 ,w4", "mac w4 * w4, A, [w8]+=2, w4"),
        ("mpy w7*w5, A", "mpy w5 * w7, A"),
        ("bset 0x102, #12", "bset.b 0x103, #4"),
        ("bclr.w 0x102, #3", "bclr.b 0x102, #3"),
        ("mov #-1, w0", "mov.w #0xffff, w0"),
        ("mov.b #-1, w0", "mov.b #0xff, w0"),
        ("add.b #-128, w0", "add.b #0x80, w0"),
        ("mov\tw1,[w2+0]", "mov.w w1, [w2+0]"),
        ("  mov \t w1 , w2 ", "mov.w w1, w2"),
        ("mov.d w2, w4", "mov.d w2, w4"),
        ("se.w w1, w2", "se w1, w2"),
        ("daw w3", "daw.b w3"),
        ("clr wreg", "clr.w WREG"),
        ("cp0.w [w1--]", "cp0 [w1--]"),
        ("retlw #5, w0", "retlw.w #5, w0"),
        ("movsac B, [w9+w12], w5, [w11+w12], w6, [w13]+=2", "movsac B,[w9 + w12],w5,[w11+ w12],w6,[w13] += 2"),
    ],
)
def test_aliases_and_spellings_mean_the_same_words(written: str, same: str) -> None:
    """isa.md §16: aliases and alternative spellings assemble to the same words."""
    assert text.parse(written).encode(0x1000) == text.parse(same).encode(0x1000)


@pytest.mark.parametrize(
    ("written", "word"),
    [
        ("mov WREG, 0x800", 0xB7A800),  # MOV WREG,f and MOV W0,f are different rows
        ("mov w0, 0x800", 0x884000),
        ("mov 0x800, WREG", 0xBF8800),
        ("mov 0x800, w0", 0x804000),
        ("clr w0", 0xEB0000),
        ("clr WREG", 0xEF0000),
        ("clr A", 0xC30112),
        ("nopr", 0xFF0000),
        ("mpy w4*w4, A", 0xF00111),
        ("mov.d w0, w2", 0xBE0100),
        ("goto w3", 0x014003),
        ("rcall w3", 0x012003),
    ],
)
def test_look_alikes_keep_their_own_encodings(written: str, word: int) -> None:
    """isa.md §8.1, §16: similar statements keep their own encodings."""
    assert text.parse(written).encode(0) == (word,)


@pytest.mark.parametrize(
    ("statement", "complaint"),
    [
        ("frob w1", "unknown instruction 'frob'"),
        ("", "unknown instruction ''"),
        ("nop w1", "operands fit none of NOP"),
        ("add", "operands fit none of"),
        ("add w1", "operands fit none of"),
        ("add w1, #32, w2", "#32 is not in 0..31"),
        ("add #1024, w2", "#1024 is not in 0..1023"),
        ("add.b #256, w2", "#256 is not in -128..255"),
        ("mov #65536, w0", "#65536 is not in -32768..65535"),
        ("mov #, w0", "'' is not a number"),
        ("mov [w1+3], w0", "offset 3 is not in -1024..1022, even"),
        ("mov.b [w1-513], w0", "offset -513 is not in -512..511"),
        ("mov 0x801, w0", "word address 0x801 is odd"),
        ("add 0x2000", "address 0x2000 is not in 0x0..0x1fff"),
        ("bset 0x103, #4", "word address 0x103 is odd"),
        ("bset.b 0x103, #8", "bit number must be a number in 0..7"),
        ("bset w1, #16", "bit #16 is not in 0..15"),
        ("mov [w1+w2], [w3+w4]", "both operands must use the same index register"),
        ("mul.uu w1, w2, w14", "the product cannot go to w14"),
        ("mul.uu w1, w2, w3", "w3 is not an even register"),
        ("mov.d w1, w2", "a register pair begins at an even register"),
        ("mov.d w1, [w2]", "w1 is not an even register"),
        ("div.sd w3, w4", "the dividend must begin at an even register"),
        ("div.sd w15, w4", "the dividend"),
        ("div.sw w3, w0", "the divisor cannot be w0"),
        ("tblrdl w1, w2", "the source must be a pointer"),
        ("tblwtl w1, w2", "the destination must be a pointer"),
        ("lnk #3", "#3 is not in 0..16382, even"),
        ("sftac A, #17", "#17 is not in -16..16"),
        ("lac w1, #8, A", "#8 is not in -8..7"),
        ("bra 0x1001", "target 0x1001 is odd"),
        ("bra 0x20000", "words away, the limit is -32768..32767"),
        ("call 0x800000", "target 0x800000 is not in 0..0x7ffffe"),
        ("do #3, 0x1002", "a DO loop needs at least two instructions"),
        ("mac w4*w5, A, [w10], w3", "operands fit none of"),
        ("mov w16, w0", "'w16' is not a number"),
        ("ed w4*w4, A, [w8], w5", "operands fit none of"),
    ],
)
def test_wrong_statements_are_refused_with_the_reason(statement: str, complaint: str) -> None:
    """isa.md §3.2, §5, §7.6, §16: an invalid statement is refused with the reason."""
    with pytest.raises(text.StatementError) as caught:
        text.parse(statement).encode(0x1000)
    assert complaint in str(caught.value)


@dataclass
class Later:
    """Expression whose value is known only at link time."""

    name: str
    value: int | None = None


@pytest.mark.parametrize(
    ("statement", "relocations", "words"),
    [
        ("mov sym, w3", ["FILE_REG_WORD_WITH_DST"], 1),
        ("mov #sym, w3", ["WORD"], 1),
        ("push sym", ["FILE_REG_WORD"], 1),
        ("add sym", ["FILE_REG"], 1),
        ("add.b sym, WREG", ["FILE_REG_BYTE"], 1),
        ("bra NZ, sym", ["PCREL_BRANCH"], 1),
        ("rcall sym", ["PCREL_BRANCH"], 1),
        ("call sym", ["PGM_ADDR"], 2),
        ("do #sym, sym", ["UNSIGNED_14", "PCREL_DO"], 2),
        ("add w1, #sym, w2", ["UNSIGNED_5"], 1),
        ("add #sym, w2", ["UNSIGNED_10"], 1),
        ("add.b #sym, w2", ["SIGNED_10_BYTE"], 1),
        ("sl w1, #sym, w2", ["UNSIGNED_4"], 1),
        ("lnk #sym", ["FRAME_SIZE"], 1),
        ("sftac A, #sym", ["DSP_6"], 1),
        ("lac w1, #sym, A", ["DSP_PRESHIFT"], 1),
        ("bset w1, #sym", ["BIT_SELECT_4"], 1),
        ("pwrsav #sym", ["PWRSAV_MODE"], 1),
        ("mov [w1+sym], w2", [""], 1),
    ],
)
def test_open_operands_become_slots_with_their_relocation(statement: str, relocations: list[str], words: int) -> None:
    """abi-elf.md §5: operands with unknown values become slots with their relocation type."""
    parsed = text.parse(statement, Later)
    assert [slot.relocation for slot in parsed.slots] == relocations
    assert [slot.expression.name for slot in parsed.slots] == ["sym" if r else "+sym" for r in relocations]
    assert parsed.words == len(parsed.encode(0)) == words


def test_a_slot_takes_its_value_later() -> None:
    """A slot is filled with the target address, not with an offset."""
    parsed = text.parse("bra Z, there", Later)
    assert parsed.encode(0x1000) == (0x320000,)
    assert parsed.encode(0x1000, {0: 0x1006}) == (0x320002,)
    with pytest.raises(text.StatementError, match="words away"):
        parsed.encode(0x1000, {0: 0x17FFE})


def test_a_word_bit_above_7_adds_one_to_the_symbol() -> None:
    """isa.md §16: BSET f, #8..15 is a bit of the byte after f, so 1 is added to the symbol."""

    def expr(source: str) -> Later:
        return Later(source, None if source == "PORTB" else int(source))

    parsed = text.parse("bset PORTB, #9", expr)
    assert (parsed.slots[0].relocation, parsed.slots[0].addend) == ("FILE_REG_BYTE", 1)
    assert parsed.encode(0, {0: 0x2C8}) == text.parse("bset.b 0x2c9, #1").encode(0)


def test_no_expression_is_parsed_for_a_form_that_does_not_fit() -> None:
    """The parser does not parse expressions for forms that do not match, so these forms create no symbols."""
    asked: list[str] = []

    def expr(source: str) -> Later:
        asked.append(source)
        return Later(source)

    text.parse("bra GTU, target", expr)
    text.parse("add A", expr)
    assert asked == ["target"]


def test_symbols_replace_addresses_where_the_caller_knows_them() -> None:
    """If the caller knows symbols, they replace addresses: program addresses in branches, data addresses in file
    registers."""

    def symbol(address: int, space: str) -> str | None:
        return {(0x200, "code"): "_main", (0x42, "data"): "_SR"}.get((address, space))

    assert text.format(codec.decode(0x020200, 0), 0, symbol) == "call _main"
    assert text.format(codec.decode(0x37007F), 0x100, symbol) == "bra _main"
    assert text.format(codec.decode(0x800211), 0, symbol) == "mov.w _SR, w1"
    assert text.format(codec.decode(0x800221), 0, symbol) == "mov.w 0x44, w1"


def test_operands_are_split_outside_brackets_and_character_literals() -> None:
    """Operands are split at commas outside of brackets and character literals."""
    assert text.split_operands("#',', w1") == ["#','", "w1"]
    assert text.split_operands(r"#'\'', [w1 + (2,3)]") == [r"#'\''", "[w1 + (2,3)]"]
    assert text.split_operands("") == []


def test_rules_the_cpu_does_not_enforce_leave_words_executable_but_not_legal() -> None:
    """isa.md §3.1, §3.3, §5.1, §8.5: words that break rules the CPU does not enforce are executable but not legal;
    words that break other rules are illegal opcodes (§4.1)."""
    for word in (0xB42843, 0xC80060, 0x780070, 0xEF0001):  # add.w 0x843; sftac A, #-32; mov mode 7; clr WREG with f
        assert codec.decode(word) is None
        assert codec.decode_for_execution(word) is not None
    for word in (0xB055D1, 0xDA4000, 0xD80781):  # a byte literal above 255; no row; divisor w1
        assert codec.decode_for_execution(word) is None


def test_the_second_word_must_fit_its_pattern() -> None:
    """isa.md §5.7: the second word of CALL must have 7 address bits and zeros."""
    assert codec.decode(0x020200, 0x00007F) is not None
    assert codec.decode(0x020200, 0x000080) is None
