"""The instruction table of the ATmega328P (AVR instruction set manual; cycles of the core without EIND and RAMPZ).

`docs/reference/avr.md` §2 lists the sources. README.md of this folder lists the names that a meaning may use.
"""

from __future__ import annotations

from typing import Final

from emu.avr.isa.row import Row

ARITHMETIC: Final = "HSVNZC"
LOGIC: Final = "SVNZ"
SHIFT: Final = "SVNZC"
SREG_LETTERS: Final = "cznvshti"

# fmt: off
_ARITHMETIC: Final = (
    Row("add Rd, Rr",    "0000 11rd dddd rrrr", ARITHMETIC, "Rd = add(Rd, Rr, 0);"),
    Row("adc Rd, Rr",    "0001 11rd dddd rrrr", ARITHMETIC, "Rd = add(Rd, Rr, C);"),
    Row("adiw Rd, K",    "1001 0110 KKww KKKK", SHIFT,      "SET_PAIR(d, add_word(PAIR(d), K));", 2),
    Row("sub Rd, Rr",    "0001 10rd dddd rrrr", ARITHMETIC, "Rd = sub(Rd, Rr, 0);"),
    Row("subi Rd, K",    "0101 KKKK hhhh KKKK", ARITHMETIC, "Rd = sub(Rd, K, 0);"),
    Row("sbc Rd, Rr",    "0000 10rd dddd rrrr", ARITHMETIC, "Rd = sub_with_carry(Rd, Rr);"),
    Row("sbci Rd, K",    "0100 KKKK hhhh KKKK", ARITHMETIC, "Rd = sub_with_carry(Rd, K);"),
    Row("sbiw Rd, K",    "1001 0111 KKww KKKK", SHIFT,      "SET_PAIR(d, sub_word(PAIR(d), K));", 2),
    Row("and Rd, Rr",    "0010 00rd dddd rrrr", LOGIC,      "Rd = logic(Rd & Rr);"),
    Row("andi Rd, K",    "0111 KKKK hhhh KKKK", LOGIC,      "Rd = logic(Rd & K);"),
    Row("or Rd, Rr",     "0010 10rd dddd rrrr", LOGIC,      "Rd = logic(Rd | Rr);"),
    Row("ori Rd, K",     "0110 KKKK hhhh KKKK", LOGIC,      "Rd = logic(Rd | K);"),
    Row("eor Rd, Rr",    "0010 01rd dddd rrrr", LOGIC,      "Rd = logic(Rd ^ Rr);"),
    Row("com Rd",        "1001 010d dddd 0000", SHIFT,      "Rd = logic(~Rd); SET_C(1);"),
    Row("neg Rd",        "1001 010d dddd 0001", ARITHMETIC, "Rd = sub(0, Rd, 0);"),
    Row("swap Rd",       "1001 010d dddd 0010", "",         "Rd = Rd << 4 | Rd >> 4;"),
    Row("inc Rd",        "1001 010d dddd 0011", LOGIC,      "Rd = step(Rd + 1, 0x80);"),
    Row("asr Rd",        "1001 010d dddd 0101", SHIFT,      "Rd = shifted(Rd >> 1 | (Rd & 0x80), Rd & 1);"),
    Row("lsr Rd",        "1001 010d dddd 0110", SHIFT,      "Rd = shifted(Rd >> 1, Rd & 1);"),
    Row("ror Rd",        "1001 010d dddd 0111", SHIFT,      "Rd = shifted(Rd >> 1 | C << 7, Rd & 1);"),
    Row("dec Rd",        "1001 010d dddd 1010", LOGIC,      "Rd = step(Rd - 1, 0x7F);"),
    Row("mul Rd, Rr",    "1001 11rd dddd rrrr", "ZC",       "SET_PAIR(0, product(Rd * Rr, 0));", 2),
    Row("muls Rd, Rr",   "0000 0010 hhhh ssss", "ZC",       "SET_PAIR(0, product(SIGNED(Rd) * SIGNED(Rr), 0));", 2),
    Row("mulsu Rd, Rr",  "0000 0011 0eee 0ttt", "ZC",       "SET_PAIR(0, product(SIGNED(Rd) * Rr, 0));", 2),
    Row("fmul Rd, Rr",   "0000 0011 0eee 1ttt", "ZC",       "SET_PAIR(0, product(Rd * Rr, 1));", 2),
    Row("fmuls Rd, Rr",  "0000 0011 1eee 0ttt", "ZC",       "SET_PAIR(0, product(SIGNED(Rd) * SIGNED(Rr), 1));", 2),
    Row("fmulsu Rd, Rr", "0000 0011 1eee 1ttt", "ZC",       "SET_PAIR(0, product(SIGNED(Rd) * Rr, 1));", 2),
)

_BRANCHES: Final = (
    Row("rjmp k",        "1100 kkkk kkkk kkkk", "", "JUMP(k);", 2),
    Row("rcall k",       "1101 kkkk kkkk kkkk", "", "CALL(k);", 3),
    Row("ijmp",          "1001 0100 0000 1001", "", "JUMP(PAIR(Z));", 2),
    Row("icall",         "1001 0101 0000 1001", "", "CALL(PAIR(Z));", 3),
    Row("jmp k",         "1001 010k kkkk 110k", "", "JUMP(k);", 3, words=2),
    Row("call k",        "1001 010k kkkk 111k", "", "CALL(k);", 4, words=2),
    Row("ret",           "1001 0101 0000 1000", "", "RETURN();", 4),
    Row("reti",          "1001 0101 0001 1000", "I", "RETURN(); ENABLE_INTERRUPTS();", 4),
    Row("cpse Rd, Rr",   "0001 00rd dddd rrrr", "", "SKIP(Rd == Rr);"),
    Row("cp Rd, Rr",     "0001 01rd dddd rrrr", ARITHMETIC, "sub(Rd, Rr, 0);"),
    Row("cpc Rd, Rr",    "0000 01rd dddd rrrr", ARITHMETIC, "sub_with_carry(Rd, Rr);"),
    Row("cpi Rd, K",     "0011 KKKK hhhh KKKK", ARITHMETIC, "sub(Rd, K, 0);"),
    Row("sbrc Rd, b",    "1111 110d dddd 0bbb", "", "SKIP(!(Rd >> b & 1));"),
    Row("sbrs Rd, b",    "1111 111d dddd 0bbb", "", "SKIP(Rd >> b & 1);"),
    Row("sbic A, b",     "1001 1001 AAAA Abbb", "", "SKIP(!(IN(A) >> b & 1));"),
    Row("sbis A, b",     "1001 1011 AAAA Abbb", "", "SKIP(IN(A) >> b & 1);"),
    Row("brbs k",        "1111 00kk kkkk kbbb", "", "BRANCH(SREG >> b & 1);",
        aliases=("brcs", "breq", "brmi", "brvs", "brlt", "brhs", "brts", "brie")),
    Row("brbc k",        "1111 01kk kkkk kbbb", "", "BRANCH(!(SREG >> b & 1));",
        aliases=("brcc", "brne", "brpl", "brvc", "brge", "brhc", "brtc", "brid")),
)

_BITS: Final = (
    Row("bset b",        "1001 0100 0bbb 1000", "ITHSVNZC", "SET_SREG(SREG | 1 << b);",
        aliases=tuple("se" + letter for letter in SREG_LETTERS)),
    Row("bclr b",        "1001 0100 1bbb 1000", "ITHSVNZC", "SET_SREG(SREG & ~(1 << b));",
        aliases=tuple("cl" + letter for letter in SREG_LETTERS)),
    Row("sbi A, b",      "1001 1010 AAAA Abbb", "",  "SET_BIT(A, b, 1);", 2),
    Row("cbi A, b",      "1001 1000 AAAA Abbb", "",  "SET_BIT(A, b, 0);", 2),
    Row("bst Rd, b",     "1111 101d dddd 0bbb", "T", "SET_T(Rd >> b & 1);"),
    Row("bld Rd, b",     "1111 100d dddd 0bbb", "",  "Rd = (Rd & ~(1 << b)) | T << b;"),
)

_MOVES: Final = (
    Row("mov Rd, Rr",    "0010 11rd dddd rrrr", "", "Rd = Rr;"),
    Row("movw Rd, Rr",   "0000 0001 pppp oooo", "", "SET_PAIR(d, PAIR(r));"),
    Row("ldi Rd, K",     "1110 KKKK hhhh KKKK", "", "Rd = K;"),
    Row("ld Rd, X",      "1001 000d dddd 1100", "", "Rd = LOAD(PAIR(X));", 2),
    Row("ld Rd, X+",     "1001 000d dddd 1101", "", "Rd = LOAD(PAIR(X)); SET_PAIR(X, PAIR(X) + 1);", 2),
    Row("ld Rd, -X",     "1001 000d dddd 1110", "", "Rd = LOAD(PAIR(X) - 1); SET_PAIR(X, PAIR(X) - 1);", 2),
    Row("ld Rd, Y+",     "1001 000d dddd 1001", "", "Rd = LOAD(PAIR(Y)); SET_PAIR(Y, PAIR(Y) + 1);", 2),
    Row("ld Rd, -Y",     "1001 000d dddd 1010", "", "Rd = LOAD(PAIR(Y) - 1); SET_PAIR(Y, PAIR(Y) - 1);", 2),
    Row("ldd Rd, Y+q",   "10q0 qq0d dddd 1qqq", "", "Rd = LOAD(PAIR(Y) + q);", 2),
    Row("ld Rd, Z+",     "1001 000d dddd 0001", "", "Rd = LOAD(PAIR(Z)); SET_PAIR(Z, PAIR(Z) + 1);", 2),
    Row("ld Rd, -Z",     "1001 000d dddd 0010", "", "Rd = LOAD(PAIR(Z) - 1); SET_PAIR(Z, PAIR(Z) - 1);", 2),
    Row("ldd Rd, Z+q",   "10q0 qq0d dddd 0qqq", "", "Rd = LOAD(PAIR(Z) + q);", 2),
    Row("lds Rd, k",     "1001 000d dddd 0000", "", "Rd = LOAD(k);", 2, words=2),
    Row("st X, Rd",      "1001 001d dddd 1100", "", "STORE(PAIR(X), Rd);", 2),
    Row("st X+, Rd",     "1001 001d dddd 1101", "", "STORE(PAIR(X), Rd); SET_PAIR(X, PAIR(X) + 1);", 2),
    Row("st -X, Rd",     "1001 001d dddd 1110", "", "STORE(PAIR(X) - 1, Rd); SET_PAIR(X, PAIR(X) - 1);", 2),
    Row("st Y+, Rd",     "1001 001d dddd 1001", "", "STORE(PAIR(Y), Rd); SET_PAIR(Y, PAIR(Y) + 1);", 2),
    Row("st -Y, Rd",     "1001 001d dddd 1010", "", "STORE(PAIR(Y) - 1, Rd); SET_PAIR(Y, PAIR(Y) - 1);", 2),
    Row("std Y+q, Rd",   "10q0 qq1d dddd 1qqq", "", "STORE(PAIR(Y) + q, Rd);", 2),
    Row("st Z+, Rd",     "1001 001d dddd 0001", "", "STORE(PAIR(Z), Rd); SET_PAIR(Z, PAIR(Z) + 1);", 2),
    Row("st -Z, Rd",     "1001 001d dddd 0010", "", "STORE(PAIR(Z) - 1, Rd); SET_PAIR(Z, PAIR(Z) - 1);", 2),
    Row("std Z+q, Rd",   "10q0 qq1d dddd 0qqq", "", "STORE(PAIR(Z) + q, Rd);", 2),
    Row("sts k, Rd",     "1001 001d dddd 0000", "", "STORE(k, Rd);", 2, words=2),
    Row("lpm",           "1001 0101 1100 1000", "", "R0 = FLASH(PAIR(Z));", 3),
    Row("lpm Rd, Z",     "1001 000d dddd 0100", "", "Rd = FLASH(PAIR(Z));", 3),
    Row("lpm Rd, Z+",    "1001 000d dddd 0101", "", "Rd = FLASH(PAIR(Z)); SET_PAIR(Z, PAIR(Z) + 1);", 3),
    Row("spm",           "1001 0101 1110 1000", "", "PROGRAM();"),
    Row("in Rd, A",      "1011 0AAd dddd AAAA", "", "Rd = IN(A);"),
    Row("out A, Rd",     "1011 1AAd dddd AAAA", "", "OUT(A, Rd);"),
    Row("push Rd",       "1001 001d dddd 1111", "", "PUSH(Rd);", 2),
    Row("pop Rd",        "1001 000d dddd 1111", "", "Rd = POP();", 2),
)

_CONTROL: Final = (
    Row("nop",           "0000 0000 0000 0000", "", ""),
    Row("sleep",         "1001 0101 1000 1000", "", "SLEEP();"),
    Row("wdr",           "1001 0101 1010 1000", "", "RESET_WATCHDOG();"),
    Row("break",         "1001 0101 1001 1000", "", "BREAK();"),
)
# fmt: on

ROWS: Final = (*_ARITHMETIC, *_BRANCHES, *_BITS, *_MOVES, *_CONTROL)
"""All instruction forms. A word matches at most one of them."""

ERASED: Final = 0xFFFF
"""Word of erased flash. It is no instruction of the manual; silicon executes it like `sbrs r31, 7` (avr.md §1)."""
ERASED_BITS: Final = 0xFFF7
"""The instruction that an erased word is executed as: `sbrs r31, 7` without its don't-care bit."""
