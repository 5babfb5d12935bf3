"""Interrupts at every instruction of every kernel call on AVR, Cortex-M and RISC-V: target/boundaries.

The test runs a sample. `python -m tests.firmware.ports.test_port_boundaries` visits all boundaries of the Kilobot, or
with --robot epuck2 those of the e-puck2.

In simavr a boundary is an instruction of the round, at which the harness sets the interrupt flag. In QEMU a boundary
is the n-th execution of an instruction address. The CPU stops there at a breakpoint and executes one store to a
device while interrupts are masked and the clock is stopped.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import pytest

from firmware.tools.simulated.kilobot import Kilobot
from firmware.tools.simulated.machine import Machine, Stopped, peek
from tests.firmware.conftest import TARGET_APPS
from tests.firmware.ports.targets import in_qemu, kilobot, make

Store = tuple[int, int]
"""Address and value."""


@dataclass(frozen=True)
class Injection:
    """How a CPU in QEMU is interrupted."""

    binutils: str
    """Prefix of the programs that read its images."""
    device: Store
    """Requests the device interrupt of target/boundaries."""
    slice: Store
    """Requests the end of the slice."""


INJECTIONS = {
    "epuck2": Injection("arm-none-eabi-", (0xE000E200, 1 << 6), (0xE000ED04, 1 << 28)),
    "qemu_virt": Injection("riscv64-unknown-elf-", (0x00101008, 0), (0x02000000, 1)),
}
"""Cortex-M: NVIC_ISPR0 and SCB_ICSR. RISC-V: the alarm of QEMU's goldfish_rtc, and msip.

Source: ARMv7-M architecture reference manual, B3; QEMU 7.2, hw/rtc/goldfish_rtc.c, hw/intc/riscv_aclint.c.
"""
KERNEL_CODE = re.compile(r"/openswarm/(kernel|option|port)/")
INT0, SLICE = 1, 14
"""Vector numbers of the ATmega328P: INT0 (device) and timer 0 compare A (end of the slice)."""
MODES = ("device", "slice", "nested")
"""Injection modes: the device; the end of the slice; the end of the slice and, up to 44 instructions later, the
device."""
PRIME = 97
"""Distance between two sampled boundaries, in instructions."""


def check(machine: Machine, where: str) -> None:
    failures = peek(machine, "failures")
    assert failures == 0, f"{where}: {failures} failures, the first in line {peek(machine, 'first_failure')} of main.c"


def round_length(machine: Kilobot) -> int:
    """Return the number of instructions in an undisturbed round."""
    begin = 0
    for _ in range(2):  # the first round starts threads for the first time
        machine.run_to("round_begin")
        begin = machine.instructions
        machine.run_to("round_end")
    return machine.instructions - begin


def sweep(machine: Kilobot, mode: str, stride: int) -> int:
    """Inject one interrupt per round, each `stride` instructions later than the last; return the number of rounds."""
    length = round_length(machine)
    rounds = 0
    for boundary in range(1, length, stride):
        machine.run_to("round_begin")
        machine.steps(boundary)
        before = peek(machine, "interrupts")
        if mode != "device":
            machine.interrupt(SLICE)
        if mode == "nested":
            machine.steps(boundary * 7 % 45)
        if mode != "slice":
            machine.interrupt(INT0)
        machine.run_to("round_begin")
        rounds += 1
        where = f"{mode}, boundary {boundary} of {length}"
        check(machine, where)
        assert peek(machine, "interrupts") - before == (mode != "slice"), f"{where}: the interrupt was lost"
    return rounds


@pytest.mark.slow
def test_the_kilobot_is_interrupted_everywhere(tmp_path: Path) -> None:
    """Interrupts at every 97th boundary lose nothing on the Kilobot.

    Each mode starts at another offset, because rounds shift against the clock.
    """
    image = make("kilobot", "boundaries", tmp_path, apps=TARGET_APPS)
    for mode in MODES:
        assert sweep(kilobot(image), mode, PRIME) > 50


def kernel_instructions(target: str, image: Path) -> list[int]:
    """Return the addresses of all instructions of kernel, options and port."""

    def output(program: str, *words: str) -> str:
        command = [INJECTIONS[target].binutils + program, *words, image]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    rows = (line.split() for line in output("nm", "-l", "-S").splitlines() if KERNEL_CODE.search(line))
    spans = [(int(row[0], 16), int(row[1], 16)) for row in rows if len(row) == 5 and row[2] in "tT"]
    code = re.finditer(r"^ *([0-9a-f]+):\t(?!.*\t\.(?:word|short|byte))", output("objdump", "-d"), re.M)
    places = (int(match[1], 16) for match in code)
    return sorted(at for at in places if any(start <= at < start + size for start, size in spans))


def sweep_in_qemu(target: str, image: Path, mode: str, stride: int, phase: int, times: int) -> int:
    """Inject one interrupt per round at the times-th execution of every stride-th kernel instruction.

    Return the number of injected interrupts; an instruction that executes less often gets none.
    """
    places = kernel_instructions(target, image)[phase::stride]
    tried = 0
    with closing(in_qemu(target, image)) as machine:
        end, idle = machine.symbols["round_end"], machine.symbols.span("hal_idle")
        for number, place in enumerate(places):
            machine.run_to("round_begin")
            come = 0
            while come < times and machine.run_to(place, end) == place:
                come += 1
            if come < times:
                continue
            before = peek(machine, "interrupts")
            if mode != "device":
                machine.store(*INJECTIONS[target].slice)
            for _ in range(number * 7 % 45 if mode == "nested" else 0):
                if machine.pc not in idle:  # WFI would not end while the clock is stopped
                    machine.step()
            if mode != "slice":
                machine.store(*INJECTIONS[target].device)
            where = f"{mode}, {place:#x} the {times}. time"
            try:
                machine.run_to("round_begin")
            except Stopped as stopped:
                raise AssertionError(f"{where}: {stopped}") from None
            tried += 1
            check(machine, where)
            assert peek(machine, "interrupts") - before == (mode != "slice"), f"{where}: the interrupt was lost"
    return tried


@pytest.mark.slow
@pytest.mark.parametrize("target", INJECTIONS)
def test_a_cpu_in_qemu_is_interrupted_everywhere(target: str, tmp_path: Path) -> None:
    """Interrupts at every 97th kernel instruction lose nothing on the e-puck2 and on QEMU's RISC-V.

    They include instructions within IT blocks and under every mask.
    """
    image = make(target, "boundaries", tmp_path, apps=TARGET_APPS)
    for mode in MODES:
        assert sweep_in_qemu(target, image, mode, PRIME, 13 * MODES.index(mode), 1) > 10


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.firmware.ports.test_port_boundaries", description=__doc__)
    parser.add_argument("--robot", choices=("kilobot", *INJECTIONS), default="kilobot")
    parser.add_argument("--stride", type=int, default=1, help="boundaries from one to the next (default 1: all)")
    parser.add_argument("--phase", type=int, default=0, help="in QEMU: the first of them (default 0)")
    parser.add_argument("--times", type=int, default=1, help="in QEMU: which time an instruction is come to")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        try:
            image = make(options.robot, "boundaries", Path(folder), apps=TARGET_APPS)
        except pytest.skip.Exception as missing:
            print(missing, file=sys.stderr)
            return 2
        for mode in MODES:
            if options.robot == "kilobot":
                tried = sweep(Kilobot(image), mode, options.stride)
            else:
                tried = sweep_in_qemu(options.robot, image, mode, options.stride, options.phase, options.times)
            print(f"{mode}: {tried:,} boundaries, nothing lost", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
