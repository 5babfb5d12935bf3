"""Kill campaign: threads are killed within calls of drivers and options, at every instruction boundary, on the emulated
robot.

Input is the firmware target/kills, whose victim thread runs scenes of such calls. A deviation raises AssertionError
with scene, boundary and pause, which reproduce it.

After the kill no interrupt may write into the victim's memory. Then the keeper thread uses every bus, line and option,
and the heap must be as before. tests/firmware/faults/test_kills_on_target.py runs a sample,
tests/fuzz/kernel/fuzz_kills.py all.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from emu import Machine
from emu.boards.epuck.board import Epuck
from emu.image.loader import load_image
from tests.firmware.kernel.test_kernel_on_target import place, thread_list

INT1IF, T2IF = 1 << 0, 1 << 6
PATIENCE = 3_000_000
"""Maximum cycles until the keeper has checked all devices: transfers time out after 25 ms."""
SCENES = ("I2C read", "I2C without slave", "SPI", "UART", "UART in frames", "motors, LEDs", "setters and getters",
          "mutex, cleanups, join")  # fmt: skip
PAUSES = (0, 4)
"""Milliseconds between the kill and the keeper's calls: none, or enough for an abandoned transfer to end."""
PCB = 18
"""Bytes of sys_pcb, which follows the stack. BLOCK and PID are the offsets of its block address and its PID."""
BLOCK, PID = 10, 16
LINKS = 6
"""Bytes at the start of a free block that the allocator uses: `hole` of kernel/memory.c."""


@dataclass
class Seen:
    """Totals of a campaign."""

    boundaries: int = 0
    kills: int = 0
    late: int = 0
    """Number of boundaries at which the victim had already finished its call."""
    watched: int = 0
    """Number of compared bytes in the memory of ended threads."""

    def __str__(self) -> str:
        return (
            f"{self.boundaries} boundaries tried, {self.kills} threads killed, {self.late} too late,"
            f" {self.watched} bytes of dead threads watched"
        )


class Stage:
    """A machine with the firmware, and the instruction trace of one round without a kill."""

    def __init__(self, path: Path, ipl_slip: int = 0) -> None:
        image = load_image(path)
        self.ipl_slip = ipl_slip
        self.machine = Machine(image.chip, engine="auto", board=partial(Epuck), ipl_slip=ipl_slip)
        self.machine.load(image)
        self.machine.peripherals.spi[2].exchange = lambda word, _bits: word
        self.places = {n: place(self.machine, n) for n in ("scene_end", "victim_gone", "rested", "checked")}
        self.said = {1: bytearray(), 2: bytearray()}
        for uart, heard in self.said.items():
            self.machine.uart[uart].on_byte = lambda byte, _cycle, heard=heard: heard.append(byte)
        for address in self.places.values():
            self.machine.hook_pc(address, lambda: True)
        for _ in SCENES:
            self.run_to("checked")
        self.used = self.machine.peek("os_statistics")
        self.begin = self.machine.snapshot()
        self.seen = Seen()
        self.after_kill: Callable[[Machine, int], None] | None = None
        """Callback after_kill(machine, address of the ended thread's memory), with which tests provoke a failure."""

    def run_to(self, name: str) -> str:
        """Run to the given function or to `checked`; return the name of the function that is reached."""
        machine, end = self.machine, self.machine.cycle + PATIENCE
        while True:
            stop = machine.run(cycles=max(end - machine.cycle, 1))
            assert stop.reason == "breakpoint", f"{stop.reason}: {stop}"
            here = next(n for n, address in self.places.items() if address == machine.pc)
            machine.step()
            if here in (name, "checked"):
                return here

    def victim(self) -> tuple[int, int]:
        """Return address and size of the memory of the thread that is about to be killed."""
        pid = self.machine.peek("victim_pid")
        pcb = next(p for p in thread_list(self.machine) if self.machine.peek(p + PID) == pid)
        block = self.machine.peek(pcb + BLOCK)
        return block, pcb + PCB - block

    def is_reserve(self, block: int) -> bool:
        """Whether interrupts may now allocate messages from this memory (the reserve of kernel/memory.c)."""
        return self.machine.peek("reserve_begin") <= block < self.machine.peek("reserve_end")

    def kill(self, block: int, size: int, pause: int) -> None:
        """Inject the killing interrupt and the end of the slice at this boundary, then check all devices."""
        machine, seen = self.machine, self.seen
        seen.boundaries += 1
        for heard in self.said.values():
            heard.clear()
        machine.poke("rest_ms", pause)
        machine.write("IFS1", machine.peek("IFS1") | INT1IF)
        machine.write("IFS0", machine.peek("IFS0") | T2IF)
        if self.run_to("victim_gone") == "victim_gone":
            seen.kills += 1
            if self.after_kill is not None:
                self.after_kill(machine, block)
            left = bytes(machine.record.bytes[block + LINKS : block + size])
            given_out = self.is_reserve(block)
            self.run_to("rested")
            given_out |= self.is_reserve(block)
            now = left if given_out else bytes(machine.record.bytes[block + LINKS : block + size])
            changed = [block + LINKS + i for i, (a, b) in enumerate(zip(left, now, strict=True)) if a != b]
            assert not changed, f"memory of the dead thread was written, from {changed[0]:#x} on"
            seen.watched += 0 if given_out else len(left)
            self.run_to("checked")
        else:
            seen.late += 1
        self.check()

    def check(self) -> None:
        """Check the results after the firmware has reached `checked`."""
        machine = self.machine
        assert machine.peek("failures") == 0, "a call of the keeper, or of a victim, gave another result"
        used = machine.peek("os_statistics")
        assert used == self.used, f"{self.used} bytes of the heap became {used}"
        assert self.said[2] == b"ok", f"UART2 said {bytes(self.said[2])!r}"
        text = bytes(self.said[1])
        assert text.endswith(b"."), f"UART1 said {text!r}"
        for run in re.findall(rb"m{4,}", text):
            assert len(run) <= 110, f"a message came in pieces: {text!r}"


def sweep(
    stage: Stage, scene: int, stride: int = 1, phase: int = 0, pauses: tuple[int, ...] = PAUSES
) -> Iterator[Seen]:
    """Kill at every stride-th boundary of a scene from the phase-th on; yield the totals after each kill.

    A sleep is one boundary, as is each instruction of the interrupts that occur meanwhile.
    """
    machine = stage.machine
    stage.seen = Seen()
    memory = begin_scene(stage, scene)
    number = 0
    while machine.pc != stage.places["scene_end"]:
        if number % stride == phase % stride:
            here = machine.snapshot()
            for pause in pauses:
                try:
                    stage.kill(*memory, pause)
                except AssertionError as error:
                    where = f"{SCENES[scene]}, boundary {number}, pause {pause} ms, slip {stage.ipl_slip}"
                    raise AssertionError(f"{where}: {error}") from error
                machine.restore(here)
            yield stage.seen
        number += 1
        machine.step()


def begin_scene(stage: Stage, scene: int) -> tuple[int, int]:
    """Run from the first round's end to the first instruction of a scene; return the place of the victim's memory."""
    machine = stage.machine
    machine.restore(stage.begin)
    while machine.peek("scene") != (scene - 1) % len(SCENES):
        stage.run_to("checked")
    stop = machine.run(cycles=PATIENCE, until=place(machine, "scene_begin"))
    assert stop.reason == "until", stop
    return stage.victim()
