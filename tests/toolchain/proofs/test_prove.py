"""`toolchain prove`: correct code is proved, and planted faults of every kind are found."""

from __future__ import annotations

import random
import re
from collections.abc import Iterable
from functools import reduce
from pathlib import Path

import pytest

import emu
from emu.host.exit_status import BAD_INPUT, DONE, FAULT
from toolchain.cli import main

pytest.importorskip("z3", reason="the solver is not installed (extra: test)")

from tests.fuzz.compiler.fuzz_prove import KERNEL_FILES, prove_kernel
from tests.fuzz.seeds import base_seed
from tests.json_schemas import validated
from toolchain.proof.counterexample import image
from toolchain.proof.problem import compile_file
from toolchain.proof.prove import Verdict, verdicts

SAMPLE = Path(__file__).with_name("prove_sample.c")
PLANTED = {
    "another operation": ("difference", "sub w0,w2,w0", "add w0,w2,w0"),
    "operands swapped": ("difference", "sub w0,w2,w0", "sub w2,w0,w0"),
    "carry forgotten": ("difference", "subb w1,w3,w1", "sub w1,w3,w1"),
    "wrong register": ("larger", "mov w1,w0", "mov w2,w0"),
    "skip the other way": ("larger", "cpsgt w0,w1", "cpslt w0,w1"),
    "unsigned where signed": ("larger", "cpsgt w0,w1\n\tmov w1,w0", "cp w0,w1\n\tbra gtu,1f\n\tmov w1,w0\n1:"),
    "shifted too far": ("shifted", "lsr w0,#3,w0", "lsr w0,#4,w0"),
    "sign kept": ("shifted", "lsr w0,#3,w0", "asr w0,#3,w0"),
    "sign lost": ("halved", "asr w0,w0", "lsr w0,w0"),
    "unsigned product": ("product", "mul.ss w1,w0,w0", "mul.uu w1,w0,w0"),
    "remainder for quotient": ("quotient", "div.u w0,w7", "div.u w0,w7\n\texch w0,w1"),
    "signed quotient": ("quotient", "div.u w0,w7", "div.s w0,w7"),
    "zeros for the sign": ("widened", "se w7,w0", "ze w7,w0"),
    "wrong offset": ("stored", "mov w1,[w0+2]", "mov w1,[w0+4]"),
    "stores exchanged": ("stored", "mov w2,[w0]\n\tmov w1,[w0+2]", "mov w1,[w0]\n\tmov w2,[w0+2]"),
    "store dropped": ("stored", "mov w1,[w0+2]", "nop"),
    "a word for a byte": ("copied", "mov.b w7,[w1+2]", "mov w7,[w1+2]"),
    "pointer moved": ("copied", "mov.b [w0+1],w7", "mov.b [++w0],w7\n\tmov.b [++w0],w7"),
    "volatile read twice": ("ports", "mov _first_port,w0", "mov _first_port,w0\n\tmov _first_port,w0"),
    "volatile write dropped": ("ports", "mov w0,_second_port", "nop"),
    "volatile order": ("ports", "mov w0,_second_port\n\tmov #7,w7\n\tmov w7,_first_port",
                       "mov #7,w7\n\tmov w7,_first_port\n\tmov w0,_second_port"),
    "another bit": ("one_bit", "bset _first_port,#10", "bset _first_port,#11"),
    "bit cleared": ("one_bit", "bset _first_port,#10", "bclr _first_port,#10"),
    "register not saved": ("kept", "mov [--w15],w8", "sub w15,#2,w15"),
    "stack not level": ("kept", "mov w8,[w15++]", "mov w8,[w15]"),
    "kept where calls do not": ("kept", "add w0,w8,w0", "add w0,w1,w0"),
    "wrong argument": ("kept", "mov #3,w1", "mov #4,w1"),
    "another function": ("decided", "bra _another", "bra _outside"),
    "another condition": ("decided", "bra z,", "bra nz,"),
    "variable too small": ("local", "add w15,#8,w15", "add w15,#6,w15"),
    "value in the wrong element": ("local", "mov w7,[w15-4]", "mov w7,[w15-6]"),
    "jump table out of order": ("chosen", r"(\tbra (\.L\d+_\d+)\n)(\tbra (\.L\d+_\d+)\n)", r"\3\1"),
    "index not scaled": ("indexed", "sl w0,w7", "mov w0,w7"),
    "a round too few": ("summed", "mov #8,w7", "mov #7,w7"),
    "float operands exchanged": ("below", "rcall ___ltsf2", "exch w0,w2\n\texch w1,w3\n\trcall ___ltsf2"),
    "another bit of a float's sign": ("sign_taken", "mov #32768,w7", "mov #16384,w7"),
    "another class of floats": ("is_subnormal", "mov #128,w5", "mov #256,w5"),
    "another library function": ("scaled", "rcall ___mulsf3", "rcall ___divsf3"),
    "moved over a barrier": ("guarded", "mov w7,_words\n\tmov w7,_first_port", "mov w7,_first_port\n\tmov w7,_words"),
    "volatile variable read once more": ("watched", "mov _seen,w0", "mov _seen,w1\n\tmov _seen,w0"),
    "volatile variable written once more": ("watched", "mov w7,_seen", "mov w7,_seen\n\tmov w7,_seen"),
    "volatile local read once more": ("watched_local", "mov [w15-2],w6", "mov [w15-2],w6\n\tmov [w15-2],w6"),
    "volatile local read once less": ("watched_local", "mov [w15-2],w7", "mov w6,w7"),
    "assembly moved": ("barrier", "disi #5\n\tmov #1,w7\n\tmov w7,_first_port",
                       "mov #1,w7\n\tmov w7,_first_port\n\tdisi #5"),
    "moved into a critical section": ("critical", "mov w7,_first_port\n\tmov w7,_words",
                                      "mov w7,_words\n\tmov w7,_first_port"),
    "moved out of a critical section": ("critical", "mov w7,_words\n\tclr _first_port",
                                        "clr _first_port\n\tmov w7,_words"),
    "operands of a statement exchanged": ("put", "mov w1,[w0]", "mov w0,[w1]"),
    "a statement done twice": ("put", "mov w1,[w0]", "mov w1,[w0]\n\tmov w1,[w0]"),
    "half of a statement": ("added", "addc w1,w3,w1", "nop"),
    "another number in a statement": ("early", "mov #5,w7", "mov #6,w7"),
    "an early output where an input is": ("early", "mov w0,w6\n\tadd w6,w1,w6\n\tmov #5,w7\n\tadd w6,w0,w0",
                                          "mov w0,w1\n\tadd w1,w1,w1\n\tmov #5,w7\n\tadd w1,w0,w0"),
    "kept where a statement writes": ("early", "mov w0,w6\n\tadd w6,w1,w6\n\tmov #5,w7\n\tadd w6,w0,w0",
                                      "mov w0,w7\n\tmov w0,w6\n\tadd w6,w1,w6\n\tmov #5,w7\n\tadd w6,w7,w0"),
    "one half read twice": ("wide", "mov _wide_port,w0", "mov _wide_port,w7\n\tmov _wide_port,w0"),
    "word read in bytes": ("ports", "mov _first_port,w0",
                           "mov.b _first_port+1,WREG\n\tsl w0,#8,w7"
                           "\n\tmov.b _first_port,WREG\n\tze w0,w0\n\tior w0,w7,w0"),
    "restored from above W15": ("kept", "mov [--w15],w8", "sub w15,#2,w15\n\tmov [w15],w8"),
    "variable above W15 at a call": ("by_reference", "rcall _use\n\tsub w15,#2,w15\n\treturn",
                                     "sub w15,#2,w15\n\tbra _use"),
    "variable read above W15": ("by_reference_and_read", "mov [w15-2],w7\n\tadd w0,w7,w0\n\tsub w15,#2,w15",
                                "sub w15,#2,w15\n\tmov [w15],w7\n\tadd w0,w7,w0"),
    "copy of the library forgotten": ("filled", "mov.b [w15-3],w7", "mov #7,w7"),
    "not set before the library copies": ("filled", "mov w7,[w15-4]", "nop"),
    "word at an odd address": ("packed", r"(\tmov\.b _packed_pair\+1,WREG\n(.*\n)*?)\treturn",
                               r"\tmov #_packed_pair+1,w7\n\tmov [w7],w0\n\treturn"),
    "a step of a division too few": ("quotient", "repeat #17", "repeat #16"),
    "division not repeated": ("quotient", "repeat #17\n\t", ""),
    "page of constants changed": ("constant", "and w0,#3,w7", "mov #1,w7\n\tmov w7,_PSVPAG\n\tand w0,#3,w7"),
    "page of constants changed for a call": ("kept", "mov #3,w1", "mov w1,_PSVPAG\n\tmov #3,w1"),
    "page of tables left changed": ("kept", "mov #3,w1", "mov w1,_TBLPAG\n\tmov #3,w1"),
    "page not set by a handler": ("_T2Interrupt", "mov w0,_PSVPAG", "nop"),
    "page not set by a handler for a call": ("_T1Interrupt", "mov w0,_PSVPAG", "nop"),
    "RCOUNT not saved for a call": ("_T1Interrupt", r"push _RCOUNT((.*\n)*)\tpop _RCOUNT", r"nop\1\tnop"),
    "accumulator changed": ("kept", "mov #3,w1", "clr A\n\tmov #3,w1"),
    "registers not saved by a handler": ("_T1Interrupt", r"mov\.d w4,\[w15\+\+\]((.*\n)*)\tmov\.d \[--w15\],w4",
                                         r"nop\1\tnop"),
    "another member in a loop": ("found", "mov [w0+2],w7", "mov [w0+4],w7"),
    "another way on": ("found", "mov [w0],w0", "mov [w0+2],w0"),
    "counted from one": ("length", "clr w7", "mov #1,w7"),
    "counted twice": ("length", "inc w7,w7", "inc2 w7,w7"),
    "arguments exchanged in a loop": ("pairs", "mov.d w10,w0", "mov w11,w0\n\tmov w10,w1"),
    "an inner loop that is not begun": ("pairs", "mov w10,w11", "mov w9,w11"),
    "register not restored behind a loop": ("pairs", "mov [--w15],w12", "sub w15,#2,w15"),
    "ends at equal": ("inserted", "bra lt,", "bra le,"),
    "stores exchanged behind a loop": ("inserted", "mov w7,[w1]\n\tmov w1,[w0]", "mov w1,[w0]\n\tmov w7,[w1]"),
    "a step of one byte": ("turned", "dec2 w7,w7", "dec w7,w7"),
    "waits for the other": ("waited", "bra z,", "bra nz,"),
    "one factor unsigned": ("product_of", "mul.ss w7,[w0++],w6", "mul.us w7,[w0++],w6"),
    "a round too few for the input": ("product_of", "bra ge,", "bra gt,"),
}  # fmt: skip
"""Planted faults by kind: the function, text of its code at -Os, and the faulty replacement."""

LATE = {
    "a round too many": ("place_of", "cp w6,#8", "cp w6,#9"),
    "another result behind a loop": ("place_of", "setm w6", "clr w6"),
    "counted in a byte": ("length", "inc w7,w7", "inc.b w7,w7"),
    "compared in a byte": ("pairs", "cp w11,w9", "cp.b w11,w9"),
    "an index of a byte": ("turned", "inc w6,w6", "inc.b w6,w6"),
}
"""Planted faults that only show after many loop iterations."""


LEVELS = ("-Os", ("-O1", "-O2")[base_seed() % 2])
"""Levels of the sample; the commit determines the second."""
LONG = "turned"
"""A function whose proof takes as long as those of all others: half of the commits prove it, at one of the levels."""


def code_of(text: str) -> dict[str, str]:
    """Return the assembly text of each function."""
    return dict(re.findall(r"^_(\w+):\n(.*?)\.size _\1,", text, re.DOTALL | re.MULTILINE))


@pytest.mark.slow
def test_right_code_is_proved() -> None:
    """Every function of the sample is proved at -Os, and those with other code at a second level are proved there.

    The campaign `fuzz_prove` proves functions of random programs.
    """
    known: dict[str, set[str]] = {}
    turn = (*LEVELS, None, None)[base_seed() // 2 % 4]
    found = {}
    for level in LEVELS:
        texts: list[str] = []
        made = compile_file([str(SAMPLE), level, "-w"], lambda text, texts=texts: texts.append(text) or text)
        for function, code in code_of(texts[0]).items():
            plain = re.sub(r"\.L\d+_", ".L", code)
            wanted = level == turn if function == LONG else plain not in known.setdefault(function, set())
            if wanted:
                (verdict,) = verdicts(made, function)
                found[function, level] = verdict.kind
            known.setdefault(function, set()).add(plain)
    assert set(found.values()) == {"proved"}, found
    assert {function for function, _ in found} | {LONG} == known.keys()
    assert ((LONG, turn) in found) == (turn is not None)


def planted(text: str, kind: str) -> str:
    """Return the assembly text with a fault planted."""
    function, right, wrong = (PLANTED | LATE)[kind]
    start = text.index(f"\n_{function}:")
    end = text.index(f".size _{function},")
    pattern = right if "(" in right else re.escape(right)
    body, count = re.subn(pattern, wrong if "(" in right else wrong.replace("\\", r"\\"), text[start:end], count=1)
    assert count, f"{right!r} is not in the code:{text[start:end]}"
    return text[:start] + body + text[end:]


def verdicts_on_faults(kinds: Iterable[str]) -> dict[str, Verdict]:
    """Return the verdict on the function of each planted fault. A program has at most one fault in each function."""
    programs: list[dict[str, str]] = []
    for kind in kinds:
        function = (PLANTED | LATE)[kind][0]
        program = next((one for one in programs if function not in one), None)
        if program is None:
            programs.append(program := {})
        program[function] = kind
    found = {}
    for program in programs:
        faults = list(program.values())
        made = compile_file([str(SAMPLE), "-Os", "-w"], lambda text, faults=faults: reduce(planted, faults, text))
        found |= {kind: verdict for function, kind in program.items() for verdict in verdicts(made, function)}
    return found


@pytest.mark.slow
def test_planted_faults_are_refuted() -> None:
    found = verdicts_on_faults(PLANTED)
    assert found.keys() == PLANTED.keys()
    assert not [(kind, verdict) for kind, verdict in found.items() if verdict.kind != "refuted"]


@pytest.mark.slow
def test_faults_of_many_rounds_are_not_proved() -> None:
    """A fault that needs many iterations is not proved; a failed induction does not refute it either.

    The commit determines which two faults are tried: their proofs are long.
    """
    found = verdicts_on_faults(random.Random(base_seed()).sample(sorted(LATE), 2))
    assert len(found) == 2
    assert not [(kind, verdict) for kind, verdict in found.items() if verdict.kind == "proved"]


def test_the_input_of_a_refutation_shows_it_on_the_emulator(tmp_path: Path) -> None:
    """The counterexample of a refutation shows the fault on the emulator.

    The function for the maximum returns the minimum.
    """
    made = compile_file([str(SAMPLE), "-Os", "-w"], lambda text: text.replace("cpsgt w0,w1", "cpslt w0,w1"))
    (verdict,) = verdicts(made, "larger")
    assert verdict.counterexample is not None
    file = tmp_path / "larger.elf"
    file.write_bytes(image(made, verdict.counterexample))
    machine = emu.load(file, engine="auto")
    assert machine.run(until="__returned", cycles=1000).reason == "until"
    a, b = (((verdict.counterexample.registers.get(n, 0) ^ 0x8000) - 0x8000) for n in (0, 1))
    assert machine.w[0] == min(a, b) & 0xFFFF != max(a, b) & 0xFFFF


def test_memory_of_a_refutation_is_in_the_image(tmp_path: Path) -> None:
    """The image of a counterexample contains the memory it assumes.

    The faulty code reads a table byte from the wrong address.
    """
    made = compile_file(
        [str(SAMPLE), "-Os", "-w"], lambda text: text.replace("mov.b [w0+1],w7\n\tse", "mov.b [w0+2],w7\n\tse")
    )
    (verdict,) = verdicts(made, "widened")
    assert verdict.counterexample is not None
    file = tmp_path / "widened.elf"
    file.write_bytes(image(made, verdict.counterexample))
    machine = emu.load(file, engine="auto")
    assert machine.run(until="__returned", cycles=10_000).reason == "until"
    first, second = (machine.peek(verdict.counterexample.registers[0] + k & 0xFFFF, 1) for k in (1, 2))
    assert machine.w[0] == ((second ^ 0x80) - 0x80) & 0xFFFF != ((first ^ 0x80) - 0x80) & 0xFFFF


@pytest.mark.slow
def test_nothing_of_the_kernel_is_refuted() -> None:
    """No kernel function is refuted, and functions without loops are proved.

    The test runs a sample of the campaign in tests/fuzz/compiler/fuzz_prove.py.
    """
    for file in ("error.c", "init.c", KERNEL_FILES[base_seed() % len(KERNEL_FILES)]):
        found = prove_kernel(file, 8, random.Random(base_seed()))
        assert found
        assert not [v for v in found if v.kind != "proved" and not v.loops]


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / "one.c"
    rounds = "int rounds(int n) { int s = 0; while (n--) s ^= s + n * n; return s; }"
    listed = "int listed(int n, ...) { return n; }"
    whole = "struct many { int l[9]; }; int whole(struct many m, int n) { while (n--) m.l[n] = n; return m.l[1]; }"
    source.write_text(f"int twice(int a) {{ return 2 * a; }}\n{rounds}\n{listed}\n{whole}\n")
    assert main(["prove", str(source), "-Os", "--json"]) == DONE
    found = {v["function"]: v for v in validated("toolchain", "prove", capsys.readouterr().out)}
    assert found["twice"]["kind"] == "proved"
    assert not found["twice"]["loops"]
    assert found["rounds"]["kind"] == "proved"
    assert found["rounds"]["loops"]
    assert found["listed"]["kind"] == "undecided"
    assert found["listed"]["why"] == "a variable number of arguments"
    assert found["whole"]["why"] == "a struct parameter"
    assert main(["prove", str(source), "--function", "absent"]) == BAD_INPUT
    assert "no function absent" in capsys.readouterr().err
    source.write_text("int broken(")
    assert main(["prove", str(source)]) == FAULT
