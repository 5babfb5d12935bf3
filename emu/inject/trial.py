"""The run without faults, and one trial after another from the last state kept before its fault.

What enters: an image, a campaign. What leaves: an `Outcome` for every number of a fault, the same in any order and in
any process. What counts as output is what the UARTs say.

    masked    the output is the same                  detected  the firmware said so (`[detect]`, its kernel's stop)
    silent    the output is another, or late          hang      no more output until `hang` times the time
    trap      a trap or a reset for a fault, whatever the firmware made of it, unless it said so
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Final

from emu.debug.fault_report import attach
from emu.inject.campaign import Campaign
from emu.inject.faults import choose, do
from emu.machine.machine import Machine

if TYPE_CHECKING:
    from emu.image.model import Image
    from emu.machine.stops import Stop

OUTCOMES: Final = ("masked", "detected", "silent", "hang", "trap")
STATES: Final = 64
"""States that are kept of the run without faults."""
SHOWN: Final = 160
KERNEL_STOPPED: Final = "the kernel stopped"
"""How the explanation of a fault begins that the firmware's kernel found itself (emu/debug/fault_report.py)."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a fault."""

    number: int
    kind: str
    cycle: int
    what: str
    """What was broken."""
    outcome: str
    """One of OUTCOMES."""
    latent: bool
    """Masked so far: at the end the state is another."""
    end: int
    """Cycle in which it was known."""
    why: str


@dataclass(slots=True)
class GoldenRun:
    """The run without faults."""

    states: list[tuple[int, bytes, tuple[int, ...]]] = field(default_factory=list)
    """Cycle, state, and how many bytes every UART had said."""
    said: dict[int, bytes] = field(default_factory=dict)
    stop: Stop | None = None


class Trials:
    """Runs the faults of a campaign. Raises ValueError if the run without faults ends before its time."""

    def __init__(self, image: Image, campaign: Campaign) -> None:
        from emu.boards.epuck.board import Epuck

        self._campaign: Final = campaign
        self._image: Final = image
        self._machine: Final = Machine(image.chip, board=partial(Epuck, selector=campaign.selector))
        self._machine.load(image)
        attach(self._machine)
        self._restore_host_state: Final = self._machine.save_host_state()
        self._said: Final = {number: bytearray() for number in self._machine.uart}
        self._trapped = ""
        for number, uart in self._machine.uart.items():
            uart.listen(partial(self._hear, number), lazy=True)
            for time, data in campaign.input.get(number, ()):
                uart.feed(data, int(time * self._machine.hz))
        told = self._machine.core.exceptions.on_trap

        def trapped(vector: object) -> None:
            self._trapped = self._trapped or str(getattr(vector, "name", vector))
            if told is not None:
                told(vector)  # type: ignore[arg-type]

        self._machine.core.exceptions.on_trap = trapped
        self._end: Final = int(campaign.seconds * self._machine.hz)
        self._first: Final = max(1, int(campaign.start * self._machine.hz))
        self.golden: Final = self._run_golden()

    def _hear(self, number: int, byte: int, _start: int) -> None:
        self._said[number].append(byte & 0xFF)

    def _run_golden(self) -> GoldenRun:
        machine, golden = self._machine, GoldenRun()
        for part in range(STATES + 1):
            golden.stop = machine.run_until(self._end * part // STATES) if part else None
            if golden.stop is not None:
                raise ValueError(f"the run without faults ends at cycle {machine.cycle:,}: {golden.stop.reason}")
            golden.states.append((machine.cycle, machine.snapshot(), tuple(map(len, self._said.values()))))
        golden.said = {number: bytes(said) for number, said in self._said.items()}
        return golden

    def run(self, number: int) -> Outcome:
        """What becomes of fault `number`."""
        machine, campaign = self._machine, self._campaign
        fault = choose(number, campaign.seed, campaign.faults, self._image, self._first, self._end)
        place = max(n for n, one in enumerate(self.golden.states) if one[0] <= fault.cycle)
        _, state, counts = self.golden.states[place]
        machine.restore(state)
        self._restore_host_state()
        self._trapped = ""
        for (which, said), count in zip(self._said.items(), counts, strict=True):
            said[:] = self.golden.said[which][:count]
        machine.run_until(fault.cycle)
        what = do(fault, machine)
        outcome, why, latent = self._judged(place + 1)
        return Outcome(number, fault.kind, fault.cycle, what, outcome, latent, machine.cycle, why)

    def _judged(self, place: int) -> tuple[str, str, bool]:
        """Run on and see. A state that the run without faults had too ends it."""
        machine, golden = self._machine, self.golden
        for cycle, state, counts in golden.states[place:]:
            stop = machine.advance(cycle)
            if stop is not None:
                return self._stopped(stop)
            said_same = all(
                said == golden.said[n][:count] for (n, said), count in zip(self._said.items(), counts, strict=True)
            )
            if machine.cycle == cycle and said_same and machine.snapshot() == state:
                return "masked", "", False
        detected = self._detected()
        if detected:
            return "detected", detected, False
        if self._said == golden.said:
            return ("trap", f"{self._trapped} trap", False) if self._trapped else ("masked", "", True)
        wrong = [n for n, said in self._said.items() if not golden.said[n].startswith(said)]
        late = int(self._campaign.hang * self._end)
        while not wrong and not self._same() and machine.cycle < late:
            stop = machine.advance(min(late, machine.cycle + self._end // STATES + 1))
            if stop is not None:
                return self._stopped(stop)
            wrong = [n for n, said in self._said.items() if not _compatible(said, golden.said[n])]
        return self._other(bool(wrong))

    def _other(self, is_wrong: bool) -> tuple[str, str, bool]:
        detected = self._detected()
        if detected:
            return "detected", detected, False
        if self._trapped:
            return "trap", f"{self._trapped} trap", False
        if is_wrong:
            return "silent", self._difference(), False
        return ("silent", "late", False) if self._same() else ("hang", "no more output", False)

    def _same(self) -> bool:
        """Whether all that was expected has been said, from the beginning."""
        return all(self._said[number].startswith(said) for number, said in self.golden.said.items())

    def _stopped(self, stop: Stop) -> tuple[str, str, bool]:
        detected = self._detected()
        cause = stop.fault.cause if stop.fault is not None else stop.reason
        if detected or cause.startswith(KERNEL_STOPPED):
            return "detected", detected or cause, False
        if stop.fault is not None:
            return "trap", f"{cause} at {stop.fault.where}"[:SHOWN], False
        return "hang", stop.reason, False

    def _detected(self) -> str:
        """What the firmware has said that it does not say without faults."""
        for number, patterns in self._campaign.detect.items():
            for pattern in patterns:
                wanted = pattern.encode("latin-1")
                if len(re.findall(wanted, self._said[number])) > len(re.findall(wanted, self.golden.said[number])):
                    return f"uart{number} said {pattern!r}"
        return ""

    def _difference(self) -> str:
        for number, said in self._said.items():
            expected = self.golden.said[number]
            if said != expected:
                pairs = zip(said, expected, strict=False)
                shorter = min(len(said), len(expected))
                at = next((n for n, (one, other) in enumerate(pairs) if one != other), shorter)
                return f"uart{number} from byte {at} on: {bytes(said[at : at + 20])!r}, not {expected[at : at + 20]!r}"
        return ""


def _compatible(said: bytearray, expected: bytes) -> bool:
    """Whether one is the beginning of the other."""
    return expected.startswith(said) or said.startswith(expected)
