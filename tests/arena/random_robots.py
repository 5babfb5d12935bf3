"""Random programs for robots of a swarm: camera, infrared, UART, motors, sleep, interrupts, traps and resets.

A program is generated from a random generator and the kind of camera sensor, as assembly text. Each function of PIECES
returns one piece of it; number `n` makes the labels of the piece unique.
`tests/fuzz/swarm/fuzz_swarm.py` runs the programs in all modes of a swarm.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Final

from tests.arena.robot_programs import BEGIN

LONG: Final = ("mov     PORTD, w0",)
"""Instructions that read the picture and that native code executes without Python; programs repeat them thousands of
times."""
Chance = random.Random


def _looks(chance: Chance, n: int) -> str:
    """Return code that reads some pixels in a row, by address or by pointer."""
    how = chance.choice((*LONG, *LONG, "mov     [w8], w0", "mov.b   PORTD+1, wreg", "mov     [w8], [w9++]"))
    return f"""
        mov     #PORTD, w8
        mov     #_kept, w9
        mov     #{chance.choice((1, 3, 40, 400, 4000, 40000)) if how in LONG else 20}, w1
l{n}:   {how}
        xor     w0, w2, w2
        dec     w1, w1
        bra     nz, l{n}"""


def _awaits_line(_chance: Chance, n: int) -> str:
    """Return code that waits for a falling and a rising edge of HREF. Only one round in 16 waits, and briefly, because
    reads of the port with PCLK are slow."""
    return f"""
        mov     _turns, w0
        and     w0, #15, w0
        bra     nz, 2f
        mov     #40, w1
l{n}:   dec     w1, w1
        bra     z, 2f
        btsc    PORTC, #3
        bra     l{n}
1:      dec     w1, w1
        bra     z, 2f
        btss    PORTC, #3
        bra     1b
        mov     PORTD, w0
        xor     w0, w2, w2
        mov     PORTD, w0
        xor     w0, w2, w2
2:      nop"""


def _waits(chance: Chance, n: int) -> str:
    """Return code that counts down from a random number."""
    return f"""
        mov     #{chance.randrange(1, 1 << chance.randrange(2, 16))}, w1
l{n}:   dec     w1, w1
        bra     nz, l{n}"""


def _idles(chance: Chance, _n: int) -> str:
    """Return code that enters Idle mode one to three times."""
    return "\n        pwrsav  #1" * chance.randrange(1, 4)


def _sleeps(_chance: Chance, _n: int) -> str:
    """Return code that enters Sleep mode with the watchdog enabled, which ends it in most cases."""
    return "\n        bset    RCON, #5\n        pwrsav  #0"


def _turns(chance: Chance, _n: int) -> str:
    """Return code that turns both motors by four steps forwards or backwards, or sets three random phases."""
    phases = [0x55, 0x66, 0xAA, 0x99][:: chance.choice((1, 1, -1))]
    if chance.random() < 0.2:
        phases = chance.sample((0x55, 0x66, 0xAA, 0x99, 0x00, 0xA5), 3)
    wait = chance.randrange(200, 1 << 14)
    return "".join(
        f"""
        mov     #{phase:#x}, w0
        mov     w0, LATD
        repeat  #{wait}
        nop"""
        for phase in phases
    )


def _blinks(chance: Chance, _n: int) -> str:
    """Return code that toggles some LEDs."""
    return f"\n        btg     LATA, #{chance.choice((6, 7, 9, 12))}\n        btg     LATC, #{chance.choice((1, 2))}"


def _talks(_chance: Chance, n: int) -> str:
    """Return code that sends a letter and a line end on UART1."""
    return f"""
        mov     #0x1FFF, w1
        and     w2, #15, w0
        add     #65, w0
l{n}:   btss    U1STA, #9
        mov     w0, U1TXREG
        mov     #10, w0
        mov     w0, U1TXREG"""


def _hears(_chance: Chance, n: int) -> str:
    """Return code that reads up to four bytes from UART1."""
    return f"""
        btsc    U1STA, #1
        bclr    U1STA, #1
        mov     #4, w1
l{n}:   btss    U1STA, #0
        bra     1f
        mov     U1RXREG, w0
        xor     w0, w2, w2
        dec     w1, w1
        bra     nz, l{n}
1:      nop"""


def _senses(chance: Chance, _n: int) -> str:
    """Return code that converts one infrared sensor, with or without a lit emitter."""
    lit = chance.choice(("bset    LATF, #7", "bset    LATF, #8", "bset    LATG, #0", "bset    LATG, #1", "nop"))
    return f"""
        {lit}
        mov     #{8 + chance.randrange(8)}, w0
        mov     w0, ADCHS
        bset    ADCON1, #1
        repeat  #{chance.randrange(100, 4000)}
        nop
        bclr    ADCON1, #1
        repeat  #400
        nop
        mov     ADCBUF0, w0
        xor     w0, w2, w2
        bclr    LATF, #7
        bclr    LATG, #0"""


def _scans(chance: Chance, _n: int) -> str:
    """Return code that scans some infrared sensors without pause, and toggles pulse lines, also two at once and by a
    pointer."""
    settings = {
        "ADCON1": 0, "ADCSSL": chance.randrange(1, 256) << 8, "ADCON2": 0x400 | chance.randrange(16) << 2,
        "ADCON3": chance.randrange(1, 32) << 8 | chance.randrange(64), "ADCON1 ": 0x80E4,
    }  # fmt: skip
    setup = "".join(f"\n        mov     #{value:#x}, w0\n        mov     w0, {to}" for to, value in settings.items())
    both = "mov     #{:#x}, w0\n        {}"
    ways = (
        "btg     LATF, #7", "btg     LATF, #8", "btg     LATG, #0", "btg     LATG, #1",
        both.format(0x180, "xor     LATF"), both.format(3, "mov     #LATG, w8\n        xor     w0, [w8], [w8]"),
    )  # fmt: skip
    toggles = "".join(
        f"\n        {way}\n        repeat  #{chance.randrange(1 << chance.randrange(1, 11))}\n        nop"
        for way in chance.choices(ways, k=chance.randrange(1, 9))
    )
    read = "\n        mov     ADCBUF0, w0\n        xor     w0, w2, w2"
    return (setup if chance.random() < 0.5 else "") + toggles + read * chance.randrange(2)


def _sets_camera(chance: Chance, _n: int) -> str:
    """Return code that sets a register of the camera; in 30 % of the cases one that only changes the brightness."""
    if chance.random() < 0.3:
        return _written(0xD4, chance.randrange(256))
    return _written(
        *chance.choice(
            (
                (0x1D, chance.randrange(4)), (0x04, 8), (0x08, chance.randrange(3)), (0x0E, chance.randrange(2)),
                (chance.randrange(256), chance.randrange(256)),
            )
        )
    )  # fmt: skip


def _written(register: int, value: int) -> str:
    """Return code that writes a register of the camera by I2C."""
    steps = "".join(
        f"""
        mov     #{byte:#x}, w0
        mov     w0, I2CTRN
        repeat  #1800
        nop"""
        for byte in (0xDC, register, value)
    )
    return f"""
        bset    I2CCON, #0
        repeat  #400
        nop{steps}
        bset    I2CCON, #2
        repeat  #400
        nop"""


def _guards(chance: Chance, _n: int) -> str:
    """Return code that raises the CPU priority for a while, or disables interrupts."""
    if chance.random() < 0.5:
        return f"\n        disi    #{chance.randrange(1, 3000)}\n        repeat  #{chance.randrange(200)}\n        nop"
    ipl = chance.randrange(1, 8) << 5
    return f"""
        mov     SR, w3
        mov     #{ipl:#x}, w0
        mov     w0, SR
        repeat  #{chance.randrange(4000)}
        nop
        mov     w3, SR"""


def _traps(chance: Chance, _n: int) -> str:
    """Return code that causes an address error or a division by zero in some rounds; Python handles both."""
    odd, zero = "\n        mov     #1, w0\n        mov     [w0], w0", "\n        mov     #0, w4\n        mov     #7, w5"
    trap = chance.choice((odd, f"{zero}\n        repeat  #17\n        div.u   w5, w4"))
    return f"\n        mov     _turns, w0\n        and     w0, #31, w0\n        bra     nz, 6f{trap}\n6:      nop"


def _asks(chance: Chance, _n: int) -> str:
    """Return code that requests an interrupt by software, toggles NSTDIS or changes a priority."""
    return chance.choice(
        (
            f"\n        mov     #{chance.randrange(8) << 12 | 0x444:#x}, w0\n        mov     w0, IPC0",
            "\n        bset    IFS0, #3",
            "\n        btg     INTCON1, #15",
            "\n        bset    IFS0, #6",
        )
    )


def _ends(chance: Chance, _n: int) -> str:
    """Return code that resets the chip or stops permanently after some rounds."""
    what = chance.choice(
        (
            "reset",
            ".pword  0xDB0000",
            "clr     IEC0\n        clr     IEC1\n        pwrsav  #0",
            "bset    RCON, #5\n8:      bra     8b",
            "disi    #0x3FFF\n        pwrsav  #1",
        )
    )
    return (
        f"\n        mov     _turns, w0\n        mov     #{chance.randrange(1, 16)}, w1\n        cp      w0, w1"
        f"\n        bra     nz, 7f\n        {what}\n7:      nop"
    )


PIECES: Final = ((_looks, 8), (_awaits_line, 1), (_waits, 3), (_idles, 2), (_sleeps, 0.3), (_turns, 4), (_blinks, 2),
                 (_talks, 2), (_hears, 2), (_senses, 1), (_scans, 1.5), (_sets_camera, 0.5), (_guards, 2),
                 (_traps, 0.6), (_asks, 1), (_ends, 1.5))  # fmt: skip


FAST: Final = {"PO3030K": ((0x4E, 0x0C), (0x1D, 0x00), (0x20, 0x33))}
"""Registers that raise the frame rate of cameras that are slow after power-on."""


def program(chance: Chance, sensor: str) -> str:
    """Return a program that repeats random pieces, for a robot with a camera of this kind."""
    makers = [maker for maker, _ in PIECES]
    numbers = iter(range(1000))

    def pieces(count: int, among: Sequence[Callable[[Chance, int], str]]) -> str:
        shares = [weight for maker, weight in PIECES if maker in among]
        made = chance.choices([maker for maker in makers if maker in among], shares, k=count)
        return "".join(make(chance, next(numbers)) for make in made)

    brief = (_looks, _turns, _blinks, _talks, _hears, _asks)
    trap = "retfie" if chance.random() < 0.7 else "9: bra 9b"
    enabled = 0x8 | chance.choice((0, 0x40)) | chance.choice((0, 0x200))
    return f"""{BEGIN}
        clr     TRISA
        mov     #0xFF00, w0
        mov     w0, TRISD
        clr     TRISF
        clr     TRISG
        bclr    TRISC, #1
        bclr    TRISC, #2
        mov     #0xFF, w0
        mov     w0, ADPCFG
        mov     #0x0102, w0
        mov     w0, ADCON3
        bset    ADCON1, #15
        mov     #150, w0
        mov     w0, I2CBRG
        bset    I2CCON, #15
        mov     #{chance.randrange(2000, 65536)}, w0
        mov     w0, PR1
        mov     #{chance.randrange(1, 8) << 12 | chance.randrange(8) << 8 | 0x44:#x}, w0
        mov     w0, IPC0
        mov     #{enabled:#x}, w0
        mov     w0, IEC0
        mov     #{chance.choice((0x8000, 0x8010, 0xA000)):#x}, w0
        mov     w0, T1CON
{"".join(_written(*one) for one in FAST.get(sensor, ()))}
main_loop:
        inc     _turns
        clrwdt{pieces(chance.randrange(2, 9), makers)}
        goto    main_loop

        .global __T1Interrupt
__T1Interrupt:
        push.d  w0
        push.d  w2
        push.d  w8
        bclr    IFS0, #3{pieces(chance.randrange(3), brief)}
        pop.d   w8
        pop.d   w2
        pop.d   w0
        retfie

        .global __T2Interrupt
__T2Interrupt:
        bclr    IFS0, #6
        retfie

        .global __U1RXInterrupt
__U1RXInterrupt:
        bclr    IFS0, #9
        push    w0
        mov     U1RXREG, w0
        mov     w0, U1TXREG
        pop     w0
        retfie

        .global __AddressError
__AddressError:
        bclr    INTCON1, #3
        mov     #_kept, w0
        {trap}

        .global __MathError
__MathError:
        bclr    INTCON1, #4
        {trap}

        .bss
_turns: .space  2
_kept:  .space  64
"""
