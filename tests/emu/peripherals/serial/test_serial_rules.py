"""Programs that use UART and SPI continuously have the same state and output in every engine."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest

from emu.chips.dspic30f6014a import SFRS
from tests.emu.cpu.cpu_rig import Rig

A = {name: f"{sfr.address:#x}" for name, sfr in SFRS.items()}
UART = """
    mov #{brg}, w0 | mov w0, {U1BRG} | mov #{mode}, w0 | mov w0, {U1MODE} | mov #{status}, w0
    mov w0, {U1STA} | mov #{RX}, w8 | mov #3, w3
    loop: btss {U1STA}, #0 | bra silent | mov {U1RXREG}, w1 | add w1, w2, w2 | btsc w1, #0
    mov.b [w8], w4 | add w4, w2, w2 | btsc {U1STA}, #1 | bclr {U1STA}, #1
    silent: dec w3, w3 | bra nz, loop | mov #{pause}, w3 | mov w2, {U1TXREG} | inc w2, w2 | bra loop
"""
"""Program that adds up received characters and sends the sum, whether the FIFO has room or not. It reads some
characters by pointer."""

SPI = """
    mov #{con}, w0 | mov w0, {SPI1CON} | bset {SPI1STAT}, #15 | mov #{BUF}, w8 | mov #3, w3
    loop: mov w2, {SPI1BUF} | inc w2, w2
    wait: btsc w2, #0 | bra read | btss {SPI1STAT}, #0 | bra wait
    read: mov {SPI1BUF}, w1 | xor w1, w2, w2 | dec w3, w3 | bra nz, loop | mov #{pause}, w3
    inc {SPI1BUF} | mov [w8], w4 | mov.b w4, [w8] | btsc {SPI1STAT}, #6 | bclr {SPI1STAT}, #6 | bra loop
"""
"""Program that sends words, every second one without waiting for the previous one. One instruction reads and writes
the buffer."""


def machine(engine: str, text: str, **settings: object) -> Rig:
    rig = Rig(text.format(**A, **settings), engine)
    if engine == "jit":
        rig.machine.runner.threshold, rig.machine.runner.wait = 1, True
    return rig


def history(rig: Rig, seed: int, lazy: bool) -> list[object]:
    """Return snapshots at random stops, with input at random times, and the output of UART1."""
    draw = random.Random(seed)
    made, heard = rig.machine, []
    remove = made.uart[1].listen(lambda byte, start: heard.append((byte, start)), lazy=lazy)
    states: list[object] = []
    for _ in range(12):
        if draw.random() < 0.7:
            some = [draw.randrange(0x200) for _ in range(draw.choice((1, 2, 7)))]
            made.uart[1].feed(some, made.cycle + draw.randrange(2000), errors=draw.choice((0, 0, 0, 0x200, 0x400)))
        made.run(cycles=draw.randrange(1, 3000))
        states.append(made.snapshot())
    remove()
    return [*states, heard]


@pytest.mark.parametrize("seed", range(4))
def test_engines_agree_on_a_uart_that_sends_and_receives(seed: int) -> None:
    """Engines agree on a UART with 8 and 9 bits, parity, one or two stop bits, all interrupt modes, overruns in both
    directions and invalid frames."""
    draw = random.Random(f"uart {seed}")
    settings = {
        "brg": draw.choice((0, 1, 7)),
        "mode": 0x8000 | draw.randrange(8),
        "status": 0x0400 | draw.choice((0, 0x8000)) | draw.randrange(4) << 6 | draw.choice((0, 0, 0x20)),
        "pause": draw.choice((2, 5, 30)),
        "RX": int(A["U1RXREG"], 16),
    }
    results = [history(machine(engine, UART, **settings), seed, True) for engine in ("plain", "jit")]
    assert len(results[0][-1]) > 5
    assert results[1] == results[0]


@pytest.mark.parametrize("seed", range(4))
def test_engines_agree_on_an_spi_master(seed: int) -> None:
    """Engines agree on an SPI master with all clocks, 8 and 16 bits and full buffers, while SDI changes and a device
    is connected for a while."""
    draw = random.Random(f"spi {seed}")
    settings = {
        "con": 0x20 | draw.randrange(0x20) | draw.choice((1, 2, 3)) | draw.choice((0, 0x400, 0x400)),
        "pause": draw.choice((2, 5, 30)),
        "BUF": int(A["SPI1BUF"], 16),
    }
    results = []
    for engine in ("plain", "jit"):
        rig, states, outside = machine(engine, SPI, **settings), [], random.Random(seed)
        for turn in range(12):
            rig.machine.pins.set("RF7", outside.randrange(2))
            rig.machine.peripherals.spi[1].exchange = (lambda word, _bits: word * 3) if turn in (4, 5) else None
            rig.machine.run(cycles=outside.randrange(1, 3000))
            states.append(rig.machine.snapshot())
        results.append(states)
    assert results[1] == results[0]


def test_lazy_listeners_receive_the_same_bytes_as_eager_ones() -> None:
    """Lazy listeners receive the same bytes as eager ones. They are called in order before the run ends, eager ones
    in the cycle in which the stop bit ends."""
    settings = {"brg": 1, "mode": 0x8000, "status": 0x0400, "pause": 2, "RX": int(A["U1RXREG"], 16)}
    rig = machine("jit", UART, **settings)
    lazy, prompt = [], []
    uart = rig.machine.uart[1]
    uart.listen(lambda byte, start: lazy.append((byte, start)), lazy=True)
    rig.machine.run(cycles=20_000)
    remove = uart.listen(lambda byte, start: prompt.append((byte, start, rig.machine.events.now)))
    first = len(lazy)
    rig.machine.run(cycles=20_000)
    remove()
    assert first > 40
    assert prompt == [(byte, start, start + 320) for byte, start in lazy[first:]]
    rig.machine.run(cycles=20_000)
    assert len(lazy) > first + len(prompt) + 40
    assert all(later[1] - earlier[1] == 320 for earlier, later in pairwise(lazy))


POLL = """
    mov #0x53E, w0 | mov w0, {SPI1CON} | bset {SPI1STAT}, #15
    loop: mov w2, {SPI1BUF}
    wait: btss {SPI1STAT}, #0 | bra wait | mov {SPI1BUF}, w1 | inc w2, w2 | bra loop
"""


def test_a_poll_that_hits_the_cycle_of_its_event_stays_native() -> None:
    """A poll of SPIRBF in the cycle in which a word of 64 Tcy ends stays native."""
    rig = machine("jit", POLL)
    rig.machine.run(cycles=100_000)
    before = rig.machine.runner.counts.interpreted
    rig.machine.run(cycles=100_000)
    assert rig.machine.w[2] > 2_000
    assert rig.machine.runner.counts.interpreted == before
