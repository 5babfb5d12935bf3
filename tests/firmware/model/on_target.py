"""Runs programs on the emulated dsPIC30F, whose timers stand still: the clock ticks when the kernel idles."""

from __future__ import annotations

from pathlib import Path
from random import Random

import emu
from tests.firmware.model.compare import Difference
from tests.firmware.model.executor import Executor
from tests.firmware.model.generator import FAMILIES, Generator
from tests.firmware.model.program import LIMITS, RECORD, Code, Kind, Program, Record
from tests.firmware.model.state import Error, Sizes

T1IF, OS_WORK = 1 << 3, 0xFF
DEFINES = "-U__OPTIMIZE__ -DSYS_HEAP=4400 -DSYS_DEFAULT_STACK=400"
"""Stacks for the interpreter: without __OPTIMIZE__ the port gives the kernel a longer one."""
PATIENCE = 3_000_000
"""Tcy after which a program that ends neither by its records nor by idling has hung."""
HEAP = 3500
"""Heap bytes beyond which a program is not compared: the model does not know which block fits where."""
OF_A_PORT = (Code.UNUSED_STACK, Code.UNUSED_KERNEL_STACK)
"""Calls whose results depend on what a port leaves of its stacks."""


def small_programs(seed: int, count: int) -> list[Program]:
    """Return programs that make no allocation fail."""
    random = Random(seed)
    families = sorted(FAMILIES.keys() - {"memory"})
    return [Generator(random, random.sample(families, random.choice((2, 3, 4))), 0).program() for _ in range(count)]


class Robot:
    """The emulated robot at the start of main."""

    def __init__(self, image: Path) -> None:
        self.machine = emu.load(image)
        self.machine.run(until="machine_ready", seconds=1)
        self.start = self.machine.snapshot()
        at = self.machine.address_of("port_sizes")
        self.sizes = Sizes(*(self.machine.peek(at + 2 * i) for i in range(len(Sizes.__dataclass_fields__))))
        self.records: list[Record] = []
        self.idles = 0
        self.compared = 0
        """Programs that fitted into the heap."""
        self.machine.hook_pc("machine_record", self.on_record)
        self.machine.hook_pc("hal_idle", self.on_idle)
        self.base = self.run(Program())[0][7]

    def on_record(self, *_: object) -> None:
        self.records.append(RECORD.unpack(self.machine.peek_bytes(self.machine.w[0], RECORD.size)))

    def on_idle(self, *_: object) -> None:
        self.idles += 1
        if not self.machine.peek("os_pending") & OS_WORK:
            self.machine.write("IFS0", self.machine.read("IFS0") | T1IF)

    def run(self, program: Program) -> list[Record]:
        """Run a program and return its records up to a limit."""
        machine = self.machine
        machine.restore(self.start)
        self.records, self.idles = [], 0
        at = machine.address_of("program")
        for offset, byte in enumerate(program.encoded()):
            machine.poke(at + offset, byte, 1)
        start = machine.cycle
        while len(self.records) < LIMITS["MOST_RECORDS"] and self.idles < LIMITS["MOST_IDLES"]:
            stop = machine.run(cycles=20_000)
            if stop.reason != "limit" or machine.cycle > start + PATIENCE:
                break
        return self.records[: LIMITS["MOST_RECORDS"]]

    def difference(self, program: Program) -> Difference | None:
        """Return how the robot's records differ from the model's, without the final state."""
        executor = Executor(program, self.sizes)
        wanted = [r for r in executor.run(self.base) if r[1] != Kind.FINAL]
        if executor.k.peak > HEAP:
            return None
        seen = comparable(self.run(program)[: len(wanted)])
        if out_of_memory(seen) > out_of_memory(wanted):  # a fragmented heap, which the model does not know
            return None
        self.compared += 1
        return None if seen == comparable(wanted) else Difference(0, seen, comparable(wanted))


def out_of_memory(records: list[Record]) -> int:
    """Return the number of records whose last error is SYS_ERROR_MEMORY."""
    return sum(record[6] == Error.MEMORY for record in records)


def comparable(records: list[Record]) -> list[Record]:
    """Return records without the results that depend on a port."""
    return [(*r[:5], 0, *r[6:]) if r[3] in OF_A_PORT else r for r in records]
