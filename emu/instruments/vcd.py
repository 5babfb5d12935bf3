"""Waveforms of a run as a VCD file, for GTKWave and similar viewers.

Input: a machine, a stream, names to watch. Output: changes of pins and bytes of UARTs. If watched, also the CPU's
priority, sleep, the running OpenSwarm thread and variables. Native code logs them, but for a watched register the
machine makes single steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final, TextIO

import numpy as np

from emu.debug import symbolic
from emu.debug.inspector import Inspector
from emu.debug.threads import RUNNING
from emu.dspic30f.change_log import Entries, Watched, WatchedNumber
from emu.instruments.changes import is_in_ram, log_changes
from emu.instruments.vcd_file import VcdFile
from emu.peripherals.pins import PORTS, parse_pin

if TYPE_CHECKING:
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

FLUSH_CYCLES: Final = 1_000_000
"""Maximum length of a run between two writes of the collected changes, in Tcy."""
CPU: Final = ("ipl", "asleep", "thread")
"""Names of CPU states that can be watched, in addition to variables."""


class WaveformRecorder:
    """Records `machine` while `advance` runs it.

    `watch` lists names of CPU states (`CPU`), or C expressions that denote a variable. With `again` it also records the
    pins and bytes of replayed cycles, for which other listeners are not called.
    Raises ValueError for a name that cannot be watched, or if another instrument runs.
    """

    def __init__(
        self,
        machine: Machine,
        stream: TextIO,
        watch: Sequence[str] = (),
        advance: Callable[[int], Stop | None] | None = None,
        again: bool = False,
    ) -> None:
        self._machine: Final = machine
        self._advance: Final = advance or machine.advance
        self._file: Final = VcdFile(stream, machine.hz, machine.cycle)
        pins = machine.pins
        self._edges: list[tuple[int, int, int]] = []
        self._frames: list[tuple[int, int, int, int, int, int]] = []
        """Edges and UART frames that are not yet in the file. A frame is known before its last bit has been sent."""
        self._transmit: Final = [0] * len(PORTS)
        for uart in machine.uart.values():
            port, mask = parse_pin(uart.site.tx_pin)
            self._transmit[port] |= mask
        self._levels: Final = pins.level.tolist()
        self._pins: Final = self._register_pins()
        self._bytes: Final[dict[int, tuple[int, int]]] = {}
        """Variables of each UART: its last byte, and the number of bytes."""
        self._sent: Final = dict.fromkeys(machine.uart, 0)
        self._removals: Final[list[Callable[[], None]]] = []
        for number, uart in machine.uart.items():
            scope = f"uart{number}"
            data = self._file.register(scope, "tx", "reg", 8)
            self._bytes[number] = data, self._file.register(scope, "tx_count", "integer", 32)
            self._removals.append(uart.listen(partial(self._add_byte, number), part=again))
        found = [self._watch(name) for name in watch]
        self._variables: Final = np.array([variable for variable, _, _ in found], dtype=np.uint64)
        logged = [one for _, _, one in found if one is not None]
        self._sampled: Final = [] if len(logged) == len(found) else [(variable, get) for variable, get, _ in found]
        """Variables and functions that read them after each step, if native code cannot log all values."""
        self._seen: Final = {variable: get() for variable, get in self._sampled}
        if logged and not self._sampled:
            self._removals.append(log_changes(machine, logged, self._add_logged))
        pins.edges, pins.frames = self._edges, self._frames
        self._logged = machine.cycle
        """Cycle up to which the edges of waveforms are in the log."""
        self._framed: Final = [0] * len(PORTS)
        """Masks by port of pins with logged frames. While such a pin has a waveform, its static level is ignored."""
        self._waveform_pins = pins.waveform_pins.tolist()
        self._removals.append(pins.on_waveform_change(self._log_waveforms, self._log_detached))

    def _register_pins(self) -> dict[tuple[int, int], int]:
        machine, found = self._machine, dict[tuple[int, int], int]()
        names = _board_names(machine)
        for port, letter in enumerate(PORTS):
            sfr = machine.chip.sfrs.get(f"LAT{letter}")
            for bit in range(16):
                if sfr is not None and sfr.mask >> bit & 1:
                    name = f"R{letter}{bit}"
                    level = 1 if self._transmit[port] >> bit & 1 else self._levels[port] >> bit & 1
                    full = f"{name}_{names[name]}" if name in names else name
                    found[port, bit] = self._file.register("pins", full, "wire", 1, level)
        return found

    def _watch(self, name: str) -> tuple[int, Callable[[], int], Watched | None]:
        """Return the variable in the file for a watched name, a function that reads its value, and its entry in a log.

        The entry is None for a value that is not in RAM.
        """
        machine, state = self._machine, self._machine.state
        scope, kind = "cpu", "reg"
        get: Callable[[], int]
        logged: Watched | None
        if name == "ipl":
            size, get, logged = 4, lambda: state.ipl, "ipl"
        elif name == "asleep":
            kind, size, get, logged = "wire", 1, lambda: int(machine.is_asleep), "asleep"
        elif name == "thread":
            kind, size, (get, logged) = "integer", 16, self._thread()
        else:
            value = symbolic.variable(Inspector(machine), name)
            address, length = value.address, value.type.bytes
            if address is None or not value.type.is_number or value.bits is not None:
                raise ValueError(f"{name!r} is not a variable in memory with a numeric type")
            scope, size, get = "variables", 8 * length, lambda: machine.peek(address, length)
            logged = WatchedNumber(address, length) if is_in_ram(machine, address, length) else None
        return self._file.register(scope, name.replace(" ", ""), kind, size, get()), get, logged

    def _thread(self) -> tuple[Callable[[], int], WatchedNumber]:
        """Return a function that reads the PID of the running thread, and the PID's entry in a log."""
        inspector = Inspector(self._machine)
        running = inspector.variable(RUNNING)
        pcb = running.type.target if running is not None else None
        pid = pcb.member("pid") if pcb is not None else None
        if running is None or pid is None:
            raise ValueError("'thread' can be watched in OpenSwarm firmware only")
        place = inspector.value(running).address or 0

        def number() -> int:
            block = self._machine.peek(place)
            return self._machine.peek(block + pid.offset) if block else 0

        return number, WatchedNumber(place, 2, pid.offset)

    def _add_logged(self, changes: Entries) -> None:
        """Collect logged changes."""
        self._file.add_all(changes["cycle"], self._variables[changes["number"].astype(np.int64)], changes["value"])

    def _add_byte(self, number: int, byte: int, _start: int) -> None:
        now, (data, count) = self._machine.events.now, self._bytes[number]
        self._sent[number] += 1
        self._file.add(now, data, byte & 0xFF)
        self._file.add(now, count, self._sent[number])

    # Running

    def advance(self, cycle: int) -> Stop | None:
        """Run as `Machine.advance` does, and write the changes."""
        machine, stop = self._machine, None
        while stop is None and machine.cycle < cycle:
            stop = self._step(cycle) if self._sampled else self._advance(min(cycle, machine.cycle + FLUSH_CYCLES))
            if not self._sampled or len(self._edges) + self._file.pending > 1000 or machine.cycle >= cycle or stop:
                machine.pins.flush()
                self._write(machine.cycle)
        return stop

    def _step(self, limit: int) -> Stop | None:
        """Process the due events, then one instruction, and sample the watched values after each of both."""
        stop = self._machine.service_boundary(limit)
        self._sample()
        if stop is None and self._machine.cycle < limit:
            stop = self._machine.step()
            self._sample()
        return stop

    def _sample(self) -> None:
        now = self._machine.cycle
        for variable, get in self._sampled:
            value = get()
            if value != self._seen[variable]:
                self._seen[variable] = value
                self._file.add(now, variable, value)

    def _log_waveforms(self, until: int) -> None:
        """Log the edges of waveforms up to cycle `until`."""
        self._machine.pins.log_waveforms(self._logged, until)
        self._logged = max(self._logged, until)

    def _log_detached(self) -> None:
        """Log the levels of pins whose waveform was just detached."""
        pins, before = self._machine.pins, self._waveform_pins
        self._waveform_pins = pins.waveform_pins.tolist()
        for port, (old, new) in enumerate(zip(before, self._waveform_pins, strict=True)):
            if old & ~new:
                pins.log_level(self._logged, port, old & ~new, pins.level[port])

    def _write(self, until: int) -> None:
        """Write all changes up to cycle `until`, sorted by cycle."""
        self._log_waveforms(until)
        for _, port, mask, *_ in self._frames:
            self._framed[port] |= mask
        for cycle, port, levels in self._edges:
            waveforms = self._framed[port] & self._machine.pins.waveform_pins[port]
            changed = (levels ^ self._levels[port]) & ~(self._transmit[port] | waveforms)
            self._levels[port] = levels
            for bit in range(16):
                if changed >> bit & 1 and (port, bit) in self._pins:
                    self._file.add(cycle, self._pins[port, bit], levels >> bit & 1)
        for start, port, mask, bits, length, width in self._frames:
            variable = self._pins.get((port, mask.bit_length() - 1))
            if variable is not None:
                for index in range(length):
                    self._file.add(start + index * width, variable, bits >> index & 1)
        self._edges.clear()
        self._frames.clear()
        self._file.write(until)

    def close(self) -> None:
        """Write the remaining changes and close the file. After a failed write, only stop recording. Raises OSError."""
        machine = self._machine
        for remove in self._removals:
            remove()
        machine.pins.flush()
        try:
            self._write(machine.cycle)
            self._file.close(machine.cycle)
        finally:
            machine.pins.edges = machine.pins.frames = None


def _board_names(machine: Machine) -> dict[str, str]:
    """Return the names of the robot's parts by pin name."""
    if machine.board is None:
        return {}
    from emu.boards.epuck.simple import LED_PINS

    coils = {f"RD{bit}": f"{side}_coil{bit % 4}" for bit in range(8) for side in [("left", "right")[bit // 4]]}
    return {pin: name for name, pin in LED_PINS.items()} | coils
