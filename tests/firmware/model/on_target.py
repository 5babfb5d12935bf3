"""Runs programs on the emulated dsPIC30F, on CPUs in QEMU and on the Kilobot's in simavr, whose timers are stopped.

The clock ticks when the kernel idles.
"""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import emu
from firmware.tools.simulated.kilobot import Kilobot
from firmware.tools.simulated.machine import Stopped, Symbols, peek, poke_words
from firmware.tools.simulated.qemu import Board, Qemu
from tests.firmware.model.compare import Difference, executions
from tests.firmware.model.executor import Executor
from tests.firmware.model.program import LIMITS, RECORD, Code, Kind, Program, Record
from tests.firmware.model.state import Error, Sizes

T1IF, OS_WORK = 1 << 3, 0xFF
DEFINES = "-U__OPTIMIZE__ -DSYS_HEAP=4400 -DSYS_DEFAULT_STACK=400"
"""Sizes for the interpreter: without __OPTIMIZE__ the port has a larger kernel stack."""
PATIENCE = 3_000_000
"""Tcy after which a program that has reached neither limit, of records or of idle times, has hung."""
DEFINES_IN_QEMU = "-DSYS_DEFAULT_STACK=1024 -Wl,--wrap=hal_idle"
DEFINES_OF_KILOBOT = (
    "-DSYS_REPORTS=0 -DMOST_PIDS=32 -DPROGRAM_BYTES=240 -DHAL_KERNEL_STACK=330 -DSYS_DEFAULT_STACK=176 -DSYS_HEAP=510"
    " -Wl,--wrap=hal_idle"
)
"""Sizes that leave 153 of 2,048 bytes for the stack of main: threads with a default stack fit twice."""
PROGRAM_BYTES, MOST_PIDS = 240, 32
VECTORS = {"machine_clock_due": 12, "machine_slice_due": 14, "machine_device_due": 1}
"""By function at which the test sets a flag of the ATmega328P: the number of its vector."""
FIRST_ARGUMENT = 24
"""Data address of R24, whose pair with R25 has the first argument of a function."""
EVENTS_LOST = 4
"""Offset of events_lost in sys_statistics, which has only 16-bit members."""
HEAP, HEAP_IN_QEMU, HEAP_OF_KILOBOT = 3500, 24_000, 480
"""Heap bytes above which a program is not compared, because the model has no fragmentation."""
OF_A_PORT = (Code.UNUSED_STACK, Code.UNUSED_KERNEL_STACK)
"""Calls whose results depend on how much of its stacks a port leaves unused."""


class Comparison:
    """A machine that runs programs, and compares them with the model."""

    sizes: Sizes
    heap = HEAP
    base = 0
    """Heap bytes in use when a program starts."""
    compared = 0
    """Programs that fitted into the heap."""
    lost = 0
    """Messages that the last program lost for lack of memory. Those of the kernel, as the clock's, set no error."""

    def run(self, program: Program, most: int) -> list[Record]:
        """Run a program and return at most its first `most` records."""
        raise NotImplementedError

    def difference(self, program: Program) -> Difference | None:
        """Return how the machine's records differ from the model's, without the final state."""
        executor = Executor(program, self.sizes)
        alone = without_final_state(executor.run(self.base))
        if executor.k.peak > self.heap:
            return None
        seen = self.run(program, LIMITS["MOST_RECORDS"] if executor.later_used else len(alone))
        closest, wanted, lost = -1, alone, 0
        for execution, everything in executions(program, self.sizes, self.base, seen):
            records = without_final_state(everything)
            if comparable(seen) == comparable(records):
                self.compared += 1
                return None
            if agreement(seen, records) > closest:
                closest, wanted, lost = agreement(seen, records), records, execution.k.events_lost
        if is_out_of_memory(seen, wanted) or self.lost > lost:
            return None  # a fragmented heap, which the model does not know
        return Difference(0, comparable(seen), comparable(wanted))


class Robot(Comparison):
    """The emulated dsPIC30F."""

    def __init__(self, image: Path) -> None:
        self.machine = emu.load(image)
        self.machine.run(until="machine_ready", seconds=1)
        self.start = self.machine.snapshot()
        at = self.machine.address_of("port_sizes")
        self.sizes = Sizes(*(self.machine.peek(at + 2 * i) for i in range(len(Sizes.__dataclass_fields__))))
        self.records: list[Record] = []
        self.idles = 0
        self.machine.hook_pc("machine_record", self.on_record)
        self.machine.hook_pc("hal_idle", self.on_idle)
        self.base = self.run(Program(), 1)[0][7]

    def on_record(self, *_: object) -> None:
        if self.idles < LIMITS["MOST_IDLES"]:
            self.records.append(RECORD.unpack(self.machine.peek_bytes(self.machine.w[0], RECORD.size)))

    def on_idle(self, *_: object) -> None:
        self.idles += 1
        if not self.machine.peek("os_pending") & OS_WORK:
            self.machine.write("IFS0", self.machine.read("IFS0") | T1IF)

    def run(self, program: Program, most: int) -> list[Record]:
        machine = self.machine
        machine.restore(self.start)
        self.records, self.idles = [], 0
        at = machine.address_of("program")
        for offset, byte in enumerate(program.encoded()):
            machine.poke(at + offset, byte, 1)
        start = machine.cycle
        while len(self.records) < most and self.idles < LIMITS["MOST_IDLES"]:
            stop = machine.run(cycles=20_000)
            if stop.reason != "limit" or machine.cycle > start + PATIENCE:
                break
        self.lost = machine.peek(machine.address_of("os_statistics") + EVENTS_LOST)
        return self.records[:most]


class CpuInQemu(Comparison):
    """A CPU in QEMU, which starts once per program. Raises NotInstalled."""

    heap = HEAP_IN_QEMU

    def __init__(self, board: Board, image: Path) -> None:
        self.board, self.image, self.symbols = board, image, Symbols(image)
        with closing(self.started()) as machine:
            self.sizes = Sizes(*(peek(machine, "port_sizes", 2 * i) for i in range(len(Sizes.__dataclass_fields__))))
        self.base = self.run(Program(), 1)[0][7]

    def started(self) -> Qemu:
        """Return a CPU that waits for its program."""
        machine = Qemu(self.board, self.image, self.symbols)
        machine.run_to("machine_ready")
        return machine

    def run(self, program: Program, most: int) -> list[Record]:
        with closing(self.started()) as machine:
            machine.poke_bytes(machine.symbols["program"], program.encoded())
            poke_words(machine, "wanted_records", (most,))
            try:
                machine.run_to("machine_done", "hal_stop")
            except Stopped as stopped:
                raise AssertionError(f"{program}\n{stopped}") from None
            self.lost = peek(machine, "os_statistics", EVENTS_LOST)
            at, count = machine.symbols["records"], peek(machine, "recorded")
            return list(RECORD.iter_unpack(machine.peek_bytes(at, count * RECORD.size)))


class KilobotCpu(Comparison):
    """The Kilobot's CPU in simavr, which starts once per program. Raises NotInstalled.

    Two kinds of programs are not compared: those with cleanups, whose script runs on the stack of another script, and
    those that its 2 kB of RAM cannot hold.
    """

    heap = HEAP_OF_KILOBOT
    overflows = 0
    """Programs that a stack overflow stopped: a port with less memory has smaller stacks than they need."""

    def __init__(self, image: Path) -> None:
        self.image = image
        with closing(self.started()) as machine:
            sizes = (peek(machine, "interpreter_sizes", 2 * i) for i in range(len(Sizes.__dataclass_fields__)))
            self.sizes = Sizes(*sizes)
        self.base = self.run(Program(), 1)[0][7]

    def started(self) -> Kilobot:
        """Return a CPU that waits for its program."""
        machine = Kilobot(self.image)
        machine.run_to("machine_ready")
        return machine

    def difference(self, program: Program) -> Difference | None:
        alone = Executor(program, self.sizes).run(self.base)
        codes = {Code(operation[0]) for script in program.scripts for operation in script.operations}
        if Code.PUSH in codes or max(record[4] for record in alone) >= MOST_PIDS:
            return None
        if len(program.encoded()) > PROGRAM_BYTES:
            return None
        before = self.overflows
        difference = super().difference(program)
        return None if self.overflows > before else difference

    def run(self, program: Program, most: int) -> list[Record]:
        records: list[Record] = []
        with closing(self.started()) as machine:
            symbols = machine.symbols
            due = {symbols[name]: vector for name, vector in VECTORS.items()}
            machine.poke_bytes(symbols["program"], program.encoded())
            idles = 0
            while len(records) < most and idles < LIMITS["MOST_IDLES"]:
                try:
                    place = machine.run_to("machine_record", "__wrap_hal_idle", *due, patience=PATIENCE)
                except Stopped as stopped:
                    if "the firmware stopped" not in str(stopped):
                        raise AssertionError(f"{program}\n{stopped}") from None
                    self.overflows += 1
                    break
                if place == symbols["machine_record"]:
                    at = int.from_bytes(machine.peek_bytes(FIRST_ARGUMENT, 2), "little")
                    records.append(RECORD.unpack(machine.peek_bytes(at, RECORD.size)))
                elif place in due:
                    machine.interrupt(due[place])
                else:
                    idles += 1
            self.lost = peek(machine, "os_statistics", EVENTS_LOST)
        return records


def without_final_state(records: list[Record]) -> list[Record]:
    return [record for record in records if record[1] != Kind.FINAL]


def agreement(seen: list[Record], wanted: list[Record]) -> int:
    """Return the number of records before the first that differs."""
    pairs = zip(comparable(seen), comparable(wanted), strict=False)
    return next((n for n, (a, b) in enumerate(pairs) if a != b), min(len(seen), len(wanted)))


def is_out_of_memory(seen: list[Record], wanted: list[Record]) -> bool:
    """Whether the machine ran out of memory more often than the model, or where their records begin to differ."""
    first = next(((a, b) for a, b in zip(comparable(seen), comparable(wanted), strict=False) if a != b), None)
    if first is not None and first[0][6] == Error.MEMORY != first[1][6]:
        return True
    return sum(record[6] == Error.MEMORY for record in seen) > sum(record[6] == Error.MEMORY for record in wanted)


def comparable(records: list[Record]) -> list[Record]:
    """Return records without the results that depend on a port."""
    return [(*r[:5], 0, *r[6:]) if r[3] in OF_A_PORT else r for r in records]
