"""Random programs that do little else than access device registers, and their comparison between engines."""

from __future__ import annotations

import random
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "cpu"))

from cpu_rig import Rig

from emu.chips.dspic30f6014a import INTERRUPTS, SFRS, VECTORS

LENGTH = 60
"""Statements in the loop of a program."""
CHUNK = 2500
"""Tcy between two looks at both machines."""
_LEFT_ALONE = ("NVM", "OSCCON", "PMD", "INTTREG", "C1", "C2")
_POOL = [s for s in SFRS.values() if s.size == 2 and s.address >= 0x80 and not s.name.startswith(_LEFT_ALONE)]
_BUSY = ("T", "PR", "U1", "LAT", "PORT", "IFS", "IEC", "IPC", "ADC", "I2C", "SPI", "IC1", "OC1", "DCI", "CN")
_HOT = [s for s in _POOL if s.name.startswith(_BUSY)]
_STATUS = [s for s in _HOT if s.name.startswith(("TMR", "PR1", "PR3", "PORT", "LAT", "IFS", "U1STA", "U1TXREG"))]
"""What programs touch again and again while their devices keep their settings."""
_INPUTS = ("RD4", "RF6", "RC3", "RC14")


def _scenes(draw: random.Random) -> list[str]:
    """Settings under which devices are at work: a timer with interrupts, a pair, a scan, PWM, a UART, the bus."""
    timer = draw.choice((1, 3, 4, 5))
    settings = {
        "timer": {f"PR{timer}": draw.choice((3, 17, 40, 99, 500)), f"T{timer}CON": 0x8000 | draw.randrange(4) << 4},
        "pair": {"PR2": draw.randrange(200), "PR3": draw.choice((0, 0, 1)), "T2CON": 0x8008},
        "scan": {"ADCSSL": 0x111C, "ADCON2": 0x0410, "ADCON3": 0x0100 | draw.randrange(40), "ADCON1": 0x80E4},
        "pwm": {"PR2": 99, "OC1RS": draw.randrange(120), "OC1CON": draw.choice((3, 5, 6)), "T2CON": 0x8000},
        "uart": {"U1BRG": draw.choice((0, 1, 7)), "U1MODE": 0x8000 | draw.choice((0, 0x40)), "U1STA": 0x8400},
        "bus": {"I2CBRG": draw.randrange(40), "I2CCON": 0x9001},
        "ports": {"TRISD": draw.choice((0, 0xFF00)), "TRISA": 0, "CNEN1": 0x6000},
    }
    lines = []
    for name in draw.sample(sorted(settings), 4):
        for register, value in settings[name].items():
            lines += [f"mov #{value}, w0", f"mov w0, {SFRS[register].address:#x}"]
    lines += ["mov #0xFFFF, w0", *(f"mov w0, {SFRS[name].address:#x}" for name in ("IEC0", "IEC1"))]
    return lines


def program(seed: int) -> str:
    """A loop over random accesses, mostly with devices at work, and one handler that clears every interrupt flag."""
    draw = random.Random(seed)

    pool = _POOL if seed % 4 == 0 else _HOT if seed % 2 else _STATUS

    def sfr() -> str:
        return f"{draw.choice(pool if draw.random() < 0.9 else _HOT).address:#x}"

    def w() -> str:
        return f"w{draw.randrange(10)}"

    statements = (
        (35, lambda: f"mov {w()}, {sfr()}"),
        (25, lambda: f"mov {sfr()}, {w()}"),
        (15, lambda: f"bset {sfr()}, #{draw.randrange(8)}"),
        (10, lambda: f"bclr {sfr()}, #{draw.randrange(8)}"),
        (5, lambda: f"repeat #{draw.randrange(40)}\nnop"),
        (5, lambda: f"btss {sfr()}, #{draw.randrange(8)}\nnop"),
        (4, lambda: f"add {w()}, {w()}, {w()}"),
        (1, lambda: "pwrsav #1"),
    )
    values = (0x8000, 0xA000, 0x8030, 0xFFFF, draw.randrange(0x10000), draw.randrange(64))
    lines = _scenes(draw) if seed % 4 else []
    lines += [f"mov #{draw.choice(values)}, w{number}" for number in range(10)]
    lines.append("loop: inc w10, w10")
    makers = draw.choices([make for _, make in statements], [weight for weight, _ in statements], k=LENGTH)
    lines += [make() for make in makers]
    lines += ["bra loop", f"handler: clr {SFRS['IFS0'].address:#x}"]
    lines += [f"clr {SFRS[name].address:#x}" for name in ("IFS1", "IFS2")]
    return "\n".join([*lines, "inc w11, w11", "retfie"])


def machine(seed: int, engine: str) -> Rig:
    """A machine about to run the program, every interrupt vector pointing at the handler."""
    rig = Rig(program(seed), engine, w10=0, w11=0)
    for irq in INTERRUPTS:
        rig.vector(VECTORS[irq + 8].ivt, "handler")
    return rig


def difference(seed: int, engine: str, chunks: int = 4) -> str | None:
    """Run both engines side by side with bytes and edges from outside; what differs first, or None."""
    rigs = [machine(seed, "plain"), machine(seed, engine)]
    for chunk in range(chunks):
        stops = [rig.machine.run(CHUNK) for rig in rigs]
        states = [rig.machine.snapshot() for rig in rigs]
        if stops[0] != stops[1]:
            return f"seed {seed}: plain stops with {stops[0]}, {engine} with {stops[1]}"
        if states[0] != states[1]:
            field_at = rigs[0].machine.record.field_at
            places = {field_at(i) for i, (a, b) in enumerate(zip(*states, strict=True)) if a != b}
            return f"seed {seed}: the engines differ in {', '.join(sorted(places)[:8])} by cycle {stops[0].cycle}"
        for rig in rigs:
            rig.machine.uart[1].feed(b"ab", rig.machine.cycle + 10)
            rig.machine.pins.set(_INPUTS[chunk % 4], chunk & 1, rig.machine.cycle)
    return None
