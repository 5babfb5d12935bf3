"""Random programs whose hooks read and write device registers, on the plain and on the native engine."""

from __future__ import annotations

import random

from engine_pair import Difference, engine_pair
from random_firmware import BODY_WORDS, CODE, difference, random_firmware

from emu.dspic30f.jit.engine import JitEngine
from emu.machine.machine import Machine

PEEKED = ("TMR1", "TMR2", "TMR3", "IFS0", "IFS1", "PORTD", "PORTF", "U1STA", "U1RXREG", "ADCON1", "INTTREG")
"""Registers whose values depend on device time."""
WRITTEN = (
    "TMR1", "TMR2", "PR1", "PR2", "PR3", "T1CON", "T2CON", "LATD", "TRISD", "IFS0", "IEC0", "IPC0", "U1MODE", "U1STA",
    "U1TXREG", "U1BRG", "OC1CON", "OC1R", "ADCON1",
)  # fmt: skip
HOOKED_ADDRESSES = 6
NEVER_REACHED = 1 << 60
"""Threshold of translation that no code reaches, so that all code is interpreted."""


class ActingHooks:
    """Hooks of one machine that read and write its devices. Equal seeds and equal runs give equal actions."""

    def __init__(self, machine: Machine, seed: int) -> None:
        self.seen: list[tuple[int, int, tuple[int, ...]]] = []
        """PC, cycle and values read, for each arrival."""
        self._machine = machine
        self._generator = random.Random(seed)
        for address in self._generator.sample(range(CODE, CODE + 2 * BODY_WORDS, 2), HOOKED_ADDRESSES):
            machine.hook_pc(address, self._act)

    def _act(self) -> None:
        machine, generator = self._machine, self._generator
        values = [machine.peek(name) for name in PEEKED]
        choice = generator.random()
        if choice < 0.3:
            values.append(machine.read(generator.choice(PEEKED)))
        elif choice < 0.5:
            machine.write(generator.choice(WRITTEN), generator.getrandbits(16))
        elif choice < 0.6:
            machine.write(generator.choice(("TMR1", "TMR2", "TMR3")), generator.randrange(400))
        elif choice < 0.7:
            machine.uart[1].feed(bytes([generator.randrange(256)]))
        self.seen.append((machine.pc, machine.cycle, tuple(values)))


def check_acting_hooks(seed: int, stops: int, cold: bool = False) -> int:
    """Run one random program with acting hooks in both engines, and return the number of arrivals.

    With `cold` the native engine has no code yet. Raises Difference if the hooks read different values or the
    snapshots differ at a stop.
    """
    generator = random.Random(seed)
    plain, native = engine_pair(random_firmware(seed), seed & 1, 0)
    if cold:
        assert isinstance(native.runner, JitEngine)
        native.runner.threshold = NEVER_REACHED
    hooks = [ActingHooks(machine, seed) for machine in (plain, native)]
    for _ in range(stops):
        cycles = generator.randrange(1, 600)
        one, other = plain.run(cycles), native.run(cycles)
        first, second = (acting.seen for acting in hooks)
        if first != second:
            pair = next((a, b) for a, b in zip([*first, None], [*second, None], strict=False) if a != b)
            raise Difference(f"seed {seed}: hooks see {pair}")
        found = difference(plain, native)
        if one != other or found:
            raise Difference(f"seed {seed}: {one} {other} {found}")
    return len(hooks[0].seen)
