"""DO loops deeper than the hardware nests, with the registers saved by software (isa.md §7.6)."""

from __future__ import annotations

from tests.emu.cpu.cpu_rig import Rig

SAVED = ("0x38", "0x3a", "0x3c", "0x3e", "0x40")
"""Addresses of DCOUNT, DOSTARTL, DOSTARTH, DOENDL and DOENDH."""
PUSH = "\n".join(f"push {register}" for register in SAVED)
POP = "\n".join(f"pop {register}" for register in reversed(SAVED))


def test_software_adds_a_third_level(engine: str) -> None:
    """isa.md §7.6: code that saves DCOUNT, DOSTART and DOEND before the DO at level 2 has a third level."""
    inner = f"{PUSH}\ndo #2, third\ninc w1, w1\nthird: nop\n{POP}"
    rig = Rig(f"do #9, first\ndo #4, second\n{inner}\nnop\nnop\nsecond: nop\nnop\nfirst: nop\nend: nop", engine, w1=0)
    rig.cycles_to()
    assert rig.machine.w[1] == 10 * 5 * 3
    assert rig.machine.peek("CORCON") == 0x0020


def test_a_handler_may_loop_at_level_two(engine: str) -> None:
    """isa.md §7.6: a handler that saves the registers may run a loop whatever level it interrupts."""
    isr = f"isr: bclr 0x84, #3\n{PUSH}\ndo #2, isrlast\ninc w2, w2\nisrlast: nop\n{POP}\nretfie"
    text = f"do #3, first\ndo #4, second\ninc w1, w1\nsecond: nop\nnop\nfirst: nop\nend: nop\nhalt: bra halt\n{isr}"
    rig = Rig(text, engine, w1=0, w2=0)
    rig.vector(0x1A, "isr")
    rig.interrupt_at(15)
    rig.machine.run(300)
    assert (rig.machine.w[1], rig.machine.w[2]) == (4 * 5, 3)
