"""The golden run without faults, and trials that start from its last checkpoint before the fault.

Input: an image and a campaign. Output: an `Outcome` for every fault number, independent of order and process. Outcomes
compare the output of the UARTs:

    masked    the output is equal                     detected  the firmware reports it (`[detect]`, a kernel stop)
    silent    the output differs, or is late          hang      output incomplete after `hang` times the duration
    trap      a trap or a fault reset that the firmware does not report
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Final

from emu.debug.fault_report import attach
from emu.inject.campaign import Campaign
from emu.inject.faults import choose_fault, inject_fault
from emu.machine.machine import Machine

if TYPE_CHECKING:
    from emu.image.model import Image
    from emu.machine.stops import Stop

OUTCOMES: Final = ("masked", "detected", "silent", "hang", "trap")
CHECKPOINTS: Final = 64
"""Number of checkpoints in the golden run."""
MAX_REASON_LENGTH: Final = 160
KERNEL_STOPPED: Final = "the kernel stopped"
"""Beginning of the description of a fault that the kernel detected (emu/debug/fault_report.py)."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of one trial."""

    number: int
    kind: str
    cycle: int
    what: str
    """Description of the injected fault."""
    outcome: str
    """Classification: one of OUTCOMES."""
    latent: bool
    """Whether the outcome is "masked" but the final state differs from the golden run's."""
    end: int
    """Cycle in which the outcome became known."""
    why: str


@dataclass(slots=True)
class GoldenRun:
    """The run without faults: its checkpoints and its output."""

    states: list[tuple[int, bytes, tuple[int, ...]]] = field(default_factory=list)
    """Checkpoints: cycle, snapshot, and number of bytes that each UART had sent."""
    output: dict[int, bytes] = field(default_factory=dict)
    stop: Stop | None = None


class Trials:
    """Runner of a campaign's trials. Raises ValueError if the golden run ends early."""

    def __init__(self, image: Image, campaign: Campaign) -> None:
        from emu.boards.epuck.board import Epuck

        self._campaign: Final = campaign
        self._image: Final = image
        self._machine: Final = Machine(image.chip, board=partial(Epuck, selector=campaign.selector))
        self._machine.load(image)
        attach(self._machine)
        self._restore_host_state: Final = self._machine.save_host_state()
        self._output: Final = {number: bytearray() for number in self._machine.uart}
        self._trapped = ""
        for number, uart in self._machine.uart.items():
            uart.listen(partial(self._append_output, number), lazy=True)
            for time, data in campaign.input.get(number, ()):
                uart.feed(data, int(time * self._machine.hz))
        previous = self._machine.core.exceptions.on_trap

        def trapped(vector: object) -> None:
            self._trapped = self._trapped or str(getattr(vector, "name", vector))
            if previous is not None:
                previous(vector)  # type: ignore[arg-type]

        self._machine.core.exceptions.on_trap = trapped
        self._end: Final = int(campaign.seconds * self._machine.hz)
        self._first: Final = max(1, int(campaign.start * self._machine.hz))
        self.golden: Final = self._run_golden()

    def _append_output(self, number: int, byte: int, _start: int) -> None:
        self._output[number].append(byte & 0xFF)

    def _run_golden(self) -> GoldenRun:
        machine, golden = self._machine, GoldenRun()
        for part in range(CHECKPOINTS + 1):
            golden.stop = machine.run_until(self._end * part // CHECKPOINTS) if part else None
            if golden.stop is not None:
                raise ValueError(f"the run without faults ends at cycle {machine.cycle:,}: {golden.stop.reason}")
            golden.states.append((machine.cycle, machine.snapshot(), tuple(map(len, self._output.values()))))
        golden.output = {number: bytes(said) for number, said in self._output.items()}
        return golden

    def run(self, number: int) -> Outcome:
        """Run the trial of fault `number`."""
        machine, campaign = self._machine, self._campaign
        fault = choose_fault(number, campaign.seed, campaign.faults, self._image, self._first, self._end)
        place = max(n for n, one in enumerate(self.golden.states) if one[0] <= fault.cycle)
        _, state, counts = self.golden.states[place]
        machine.restore(state)
        self._restore_host_state()
        self._trapped = ""
        for (which, said), count in zip(self._output.items(), counts, strict=True):
            said[:] = self.golden.output[which][:count]
        machine.run_until(fault.cycle)
        what = inject_fault(fault, machine)
        outcome, why, latent = self._classify(place + 1)
        return Outcome(number, fault.kind, fault.cycle, what, outcome, latent, machine.cycle, why)

    def _classify(self, place: int) -> tuple[str, str, bool]:
        """Continue the run and classify its outcome.

        If the state equals the golden run's at a checkpoint, the trial ends.
        """
        machine, golden = self._machine, self.golden
        for cycle, state, counts in golden.states[place:]:
            stop = machine.advance(cycle)
            if stop is not None:
                return self._classify_stop(stop)
            said_same = all(
                said == golden.output[n][:count] for (n, said), count in zip(self._output.items(), counts, strict=True)
            )
            if machine.cycle == cycle and said_same and machine.snapshot() == state:
                return "masked", "", False
        detected = self._detected()
        if detected:
            return "detected", detected, False
        if self._output == golden.output:
            return ("trap", f"{self._trapped} trap", False) if self._trapped else ("masked", "", True)
        wrong = [n for n, said in self._output.items() if not golden.output[n].startswith(said)]
        late = int(self._campaign.hang * self._end)
        while not wrong and not self._is_complete() and machine.cycle < late:
            stop = machine.advance(min(late, machine.cycle + self._end // CHECKPOINTS + 1))
            if stop is not None:
                return self._classify_stop(stop)
            wrong = [n for n, said in self._output.items() if not _compatible(said, golden.output[n])]
        return self._classify_late(bool(wrong))

    def _classify_late(self, is_wrong: bool) -> tuple[str, str, bool]:
        detected = self._detected()
        if detected:
            return "detected", detected, False
        if self._trapped:
            return "trap", f"{self._trapped} trap", False
        if is_wrong:
            return "silent", self._difference(), False
        return ("silent", "late", False) if self._is_complete() else ("hang", "no more output", False)

    def _is_complete(self) -> bool:
        """Whether every UART has sent the golden run's complete output."""
        return all(self._output[number].startswith(said) for number, said in self.golden.output.items())

    def _classify_stop(self, stop: Stop) -> tuple[str, str, bool]:
        detected = self._detected()
        cause = stop.fault.cause if stop.fault is not None else stop.reason
        if detected or cause.startswith(KERNEL_STOPPED):
            return "detected", detected or cause, False
        if stop.fault is not None:
            return "trap", f"{cause} at {stop.fault.where}"[:MAX_REASON_LENGTH], False
        return "hang", stop.reason, False

    def _detected(self) -> str:
        """Return a message of the firmware about a fault that the golden run does not contain; "" if there is none."""
        for number, patterns in self._campaign.detect.items():
            for pattern in patterns:
                wanted = pattern.encode("latin-1")
                if len(re.findall(wanted, self._output[number])) > len(re.findall(wanted, self.golden.output[number])):
                    return f"uart{number} said {pattern!r}"
        return ""

    def _difference(self) -> str:
        for number, said in self._output.items():
            expected = self.golden.output[number]
            if said != expected:
                pairs = zip(said, expected, strict=False)
                shorter = min(len(said), len(expected))
                at = next((n for n, (one, other) in enumerate(pairs) if one != other), shorter)
                return f"uart{number} from byte {at} on: {bytes(said[at : at + 20])!r}, not {expected[at : at + 20]!r}"
        return ""


def _compatible(said: bytearray, expected: bytes) -> bool:
    """Whether one of the two outputs is a prefix of the other."""
    return expected.startswith(said) or said.startswith(expected)
