"""Measure the kernel on Kilobot, e-puck2 and QEMU's RISC-V: cycles or instructions of operations, bytes of objects.

    python -m firmware.tools.simulated.measure kilobot|epuck2|qemu_virt [--json]

Runs the applications `latency` and `footprint` as they are: scenarios and loads are written into the image from
outside, and counted between symbols.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any

from elftools.elf.elffile import ELFFile

from firmware.tools.simulated.kilobot import Kilobot
from firmware.tools.simulated.machine import Machine, NotInstalled, Stopped, Symbols, peek_words, pointer, poke_words
from firmware.tools.simulated.qemu import EPUCK2, QEMU_VIRT, Qemu

FIRMWARE = Path(__file__).resolve().parents[2]
FIELDS = ("threads", "yielders", "subscribers", "waiters", "events", "payload", "sender")
"""Values of latency_wanted, in order (apps/latency/latency.h)."""
SETTLING = 6
"""Measurement windows skipped until every thread has run and yielded."""
PATIENCE = 3000
"""Maximum length of a window in instructions."""
ATTEMPTS = 50
LOADS = (
    (0, 0, 0, 0, 0), (1, 0, 0, 0, 0), (2, 0, 0, 0, 0), (4, 0, 0, 0, 0), (0, 1, 0, 0, 0), (0, 5, 0, 0, 0),
    (0, 1, 1, 0, 0), (0, 2, 4, 0, 0), (1, 3, 5, 0, 0), (0, 1, 1, 1, 0), (0, 1, 1, 1, 8), (0, 1, 1, 3, 16),
    (2, 3, 4, 2, 12), (3, 2, 2, 4, 24),
)  # fmt: skip
"""n threads, m events, s subscriptions, messages, payload of each (apps/footprint/footprint.h)."""


@dataclass(frozen=True)
class Robot:
    """A target of `make` and its simulator."""

    target: str
    port: str
    unit: str
    """Unit that its simulator counts."""
    open: Callable[[Path], Machine]
    slice_entry: Callable[[Symbols], int]
    """First instruction after the slice interrupt was taken."""
    nop: bytes
    loop: int
    """Cycles or instructions of the measuring loop: a `nop` and the jump back to the call."""
    response: int
    """Cycles of the chip from a request to its vector, which the simulator omits."""
    defines: str = ""
    """Sizes for `latency` and `footprint`, whose constants take RAM on an AVR."""


def limit(robot: Robot, name: str) -> int:
    """Return a number of the port's hal_limits.h."""
    header = FIRMWARE / "openswarm" / "port" / robot.port / "hal_limits.h"
    found = re.search(rf"#define {name} (\d+)", header.read_text(encoding="utf-8"))
    assert found, name
    return int(found[1])


ROBOTS = {
    "kilobot": Robot("kilobot", "avr", "cycles", Kilobot, lambda _: 14 * 4, b"\0\0", 3, 4, "-DSYS_HEAP=1000"),
    "epuck2": Robot(
        "epuck2", "cortex_m", "instructions", partial(Qemu, EPUCK2), itemgetter("PendSV_Handler"), b"\0\xbf", 2, 0
    ),
    "qemu_virt": Robot(
        "qemu_virt", "riscv", "instructions", partial(Qemu, QEMU_VIRT), itemgetter("slice_interrupt"), b"\1\0", 2, 0
    ),
}


def build(robot: Robot, app: str, out: Path, defines: str = "") -> Path:
    """Build and return an image of one of firmware/apps. Raises NotInstalled with make's output."""
    words = [f"APP={app}", f"TARGET={robot.target}", f"OUT={out}", f"DEFINES={defines}"]
    done = subprocess.run(
        ["make", "-s", "-C", str(FIRMWARE), *words],
        capture_output=True, text=True, check=False, env={**os.environ, "MAKEFLAGS": ""},
    )  # fmt: skip
    if done.returncode != 0:
        raise NotInstalled(done.stderr.strip())
    return out / "firmware.elf"


# ---- Cycles ---------------------------------------------------------------------------------------------------------


def _start(robot: Robot, image: Path, **scenario: int) -> Machine:
    machine = robot.open(image)
    machine.run_to("latency_begin")
    poke_words(
        machine, "latency_wanted", tuple(scenario.get(field, 2 if field == "payload" else 0) for field in FIELDS)
    )
    machine.run_to("latency_ready")
    return machine


def _follow(machine: Machine, arrived: Callable[[int], bool]) -> int:
    """Step until the program counter reaches an address; return the cost, or PATIENCE if interrupts fill the window.

    On a busy host this happens in QEMU: its clock advances to the next tick while the debugger reads the CPU's state.
    """
    begin = machine.now
    for _ in range(PATIENCE):
        machine.step()
        if arrived(machine.pc):
            return machine.now - begin
    return PATIENCE


def _code(image: Path, address: int, size: int) -> bytes:
    with image.open("rb") as file:
        for section in ELFFile(file).iter_sections():
            if section["sh_type"] == "SHT_PROGBITS" and 0 <= address - section["sh_addr"] < section["sh_size"]:
                return section.data()[address - section["sh_addr"] :][:size]
    raise Stopped(f"no code at {address:#x}")


def _nop(robot: Robot, image: Path, symbols: Symbols, function: str) -> int:
    """Return the address of the `nop` in a function."""
    span = symbols.span(function)
    return span.start + _code(image, span.start, len(span)).index(robot.nop)


def preemption(robot: Robot, image: Path, threads: int) -> int:
    """Measure from the slice interrupt's first instruction to the next thread's, with registers restored."""
    machine = _start(robot, image, threads=threads)
    try:
        entry, span = robot.slice_entry(machine.symbols), machine.symbols.span("latency_spin")
        seen = []
        for _ in range(SETTLING + 2 * threads):  # a thread that never ran is resumed by another path
            machine.run_to(entry)
            before = pointer(machine, "os_running")
            taken = _follow(machine, lambda pc: pc in span)
            if pointer(machine, "os_running") != before:
                seen.append(taken)
        return _undisturbed_window(seen)
    finally:
        machine.close()


def yielding(robot: Robot, image: Path) -> int:
    """Measure from the call of Sys_Yield in one thread to the instruction after it in another."""
    machine = _start(robot, image, yielders=2)
    try:
        nop = _nop(robot, image, machine.symbols, "latency_yield")
        seen = []
        for _ in range(ATTEMPTS):
            machine.run_to(nop)
            seen.append(_follow(machine, nop.__eq__) - robot.loop)
        return _undisturbed_window(seen)
    finally:
        machine.close()


def _undisturbed_window(seen: list[int]) -> int:
    """Return the window that no other interrupt disturbs: the minimum, seen more than once."""
    settled = [taken for taken in seen[SETTLING:] if taken < PATIENCE]
    if not settled or settled.count(min(settled)) < 2:
        raise Stopped(f"no two windows are alike: {seen}")
    return min(settled)


def sending(robot: Robot, image: Path, **scenario: int) -> int:
    """Measure from the first instruction of a function that only sends to the one after its call."""
    machine = _start(robot, image, sender=1, **scenario)
    try:
        seen = []
        for _ in range(ATTEMPTS):
            machine.run_to("latency_send")
            seen.append(_follow(machine, machine.return_address().__eq__))
        return _undisturbed_window(seen)
    finally:
        machine.close()


def reaching(robot: Robot, image: Path, place: str, **scenario: int) -> int:
    """Measure from the first instruction of the sending function to that of a handler or of a waiting thread."""
    machine = _start(robot, image, **scenario)
    try:
        seen = []
        for _ in range(ATTEMPTS):
            machine.run_to("latency_send")
            seen.append(_follow(machine, machine.symbols[place].__eq__))
        return _undisturbed_window(seen)
    finally:
        machine.close()


def cycles(robot: Robot, image: Path) -> dict[str, int]:
    """Return all measures in the machine's `unit`."""
    found = {f"preemptive switch, {n} ready threads": preemption(robot, image, n) for n in (2, 4)}
    found["Sys_Yield to a yielded thread"] = yielding(robot, image)
    for subscribers in (0, 1):
        for payload in (2, 24):
            name = f"send {payload} bytes, {subscribers} subscriber{'s' * (subscribers != 1)}"
            found[name] = sending(robot, image, subscribers=subscribers, payload=payload)
    found["send to handler entry"] = reaching(robot, image, "latency_handler", subscribers=1, sender=1)
    found["send to waiting thread running"] = reaching(robot, image, "latency_woken", waiters=1, sender=2)
    return found


# ---- Bytes ----------------------------------------------------------------------------------------------------------


def _loaded(robot: Robot, image: Path, load: tuple[int, ...]) -> tuple[int, int]:
    """Return the used heap bytes without and with a load."""
    machine = robot.open(image)
    try:
        machine.run_to("footprint_begin")
        poke_words(machine, "footprint_wanted", load)
        machine.run_to("footprint_empty")
        empty = peek_words(machine, "footprint_now", 5)[4]
        machine.run_to("footprint_built")
        made = peek_words(machine, "footprint_now", 5)
        if made[:4] != load[:4]:
            raise Stopped(f"only {made[:4]} of {load[:4]} fit")
        machine.run_to("footprint_undone")
        if peek_words(machine, "footprint_now", 5)[4] != empty:
            raise Stopped(f"load {load} is not given back whole")
        return empty, made[4]
    finally:
        machine.close()


def footprint(robot: Robot, image: Path) -> dict[str, Any]:
    """Fit RAM = A + B n + C m + D s + sum over messages of (E + d) exactly to all LOADS. Raises Stopped."""
    taken = {load: _loaded(robot, image, load) for load in LOADS}
    empty = taken[LOADS[0]][0]
    cost = {load: built - before for load, (before, built) in taken.items()}
    b, c = cost[1, 0, 0, 0, 0], cost[0, 1, 0, 0, 0]
    d = cost[0, 1, 1, 0, 0] - c
    e = cost[0, 1, 1, 1, 0] - c - d
    for load, bytes_ in cost.items():
        n, m, s, messages, payload = load
        wanted = b * n + c * m + d * s + messages * (e + payload)
        if bytes_ != wanted:
            raise Stopped(f"load {load} takes {bytes_} bytes, not {wanted}: the equation does not hold")
    return {"B": b, "C": c, "D": d, "E": e, "system": empty, "loads": len(LOADS)}


def sizes(image: Path) -> dict[str, int]:
    """Return bytes of flash and of RAM, including heap and kernel stack."""
    symbols = Symbols(image)
    ram = {".data", ".bss", ".noinit"}
    flash = sum(size for name, size in symbols.sections.items() if name not in ram | {".main_stack"})
    return {
        "flash": flash + symbols.sections.get(".data", 0),
        "ram": sum(symbols.sections.get(name, 0) for name in ram),
    }


def kernel_ram(robot: Robot, image: Path) -> int:
    """Return the RAM of an image with the port's default sizes, without the heap."""
    heap = Symbols(image).size["os_memory"] - limit(robot, "HAL_KERNEL_STACK")
    return sizes(image)["ram"] - heap


def measure(name: str) -> dict[str, Any]:
    """Return all measures of one robot. Raises NotInstalled, Stopped."""
    robot = ROBOTS[name]
    with tempfile.TemporaryDirectory(prefix="openswarm-measure-") as folder:
        latency, load = (build(robot, app, Path(folder) / app, robot.defines) for app in ("latency", "footprint"))
        hello, smallest = (build(robot, app, Path(folder) / app) for app in ("hello", "smallest"))
        return {
            "robot": name,
            "unit": robot.unit,
            "response": robot.response,
            "cycles": cycles(robot, latency),
            "stack": limit(robot, "HAL_DEFAULT_STACK"),
            "equation": footprint(robot, load),
            "sizes": {
                app: sizes(image) for app, image in (("footprint", load), ("hello", hello), ("smallest", smallest))
            },
            "kernel_ram": kernel_ram(robot, hello),
        }


def text(found: dict[str, Any]) -> str:
    """Return the measures as text."""
    unit, equation = found["unit"], found["equation"]
    lines = [f"{found['robot']:44} {unit:>12}"]
    lines += [f"{name:44} {count:12,}" for name, count in found["cycles"].items()]
    if found["response"]:
        lines.append(f"(the chip takes {found['response']} more from an interrupt's request to its vector)")
    lines += [
        "",
        f"RAM = A + {equation['B']} n + {equation['C']} m + {equation['D']} s + sum ({equation['E']} + d) bytes,",
    ]
    lines += [
        f"exact for {equation['loads']} loads; n threads with their stacks, m events, s subscriptions, d payload",
        "",
    ]
    lines += [f"{'':44} {'flash':>7} {'RAM':>7}"]
    lines += [f"{app:44} {size['flash']:7,} {size['ram']:7,}" for app, size in found["sizes"].items()]
    lines += [f"{'hello without the heap':44} {'':7} {found['kernel_ram']:7,}"]
    return "\n".join(lines)


def main() -> int:
    """Run the command; return exit status 2 with a message if a program is missing."""
    parser = argparse.ArgumentParser(prog="python -m firmware.tools.simulated.measure", description=__doc__)
    parser.add_argument("robot", choices=sorted(ROBOTS))
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    try:
        found = measure(options.robot)
    except (NotInstalled, Stopped) as error:
        print(f"measure: {error}", file=sys.stderr)
        return 2
    print(json.dumps(found, indent=2) if options.json else text(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
