"""Compare OpenSwarm on three CPUs with FreeRTOS on the same emulator and with the literature: docs/table2.md.

    python -m bench.kernel.rtos [--freertos DIR] [--page docs/table2.md] [--json]

FreeRTOS is built from the user's checkout of github.com/FreeRTOS/FreeRTOS-Kernel: the official dsPIC port, compiled
with our compiler at -Os and measured on our emulator. Without --freertos, its column shows the last measurement
(bench/kernel/rtos.json, which names the version). simavr counts cycles of the Kilobot, QEMU instructions of the
e-puck2. If a Debian package is missing, the last measurement is shown as well, and the package is named.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from emu.commands.footprint import _equation as memory_equation
from emu.image.footprint import pieces, totals
from emu.image.loader import load_image
from emu.image.model import Image
from emu.kernel_metrics.meter import Meter
from emu.kernel_metrics.suite.latency import run_measures
from emu.kernel_metrics.target import Target
from firmware.tools.simulated.machine import NotInstalled
from firmware.tools.simulated.measure import measure

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).parent
KEPT, LITERATURE, GLUE = HERE / "rtos.json", HERE / "literature.csv", HERE.parent / "c" / "freertos"
PORT = Path("portable/MPLAB/PIC24_dsPIC")
SOURCES = ("tasks.c", "list.c", "queue.c", "portable/MemMang/heap_1.c", PORT / "port.c", PORT / "portasm_dsPIC.S")
TICK, YIELD, QUEUE = 1, 2, 3
STACK_BYTES = 256
"""Stack size of a task in main.c."""
SETTLING = 8
"""Number of measurement windows that are skipped at the start."""
FRAMES_SEEN = 24
"""Switches of each kind examined in bench/c/saved_frames: every thread is among them."""
RETURN_ADDRESS = 4
"""Bytes that a call or an interrupt pushes (isa.md §7.4)."""
PCB_STATUS, SYS_DSP = 8, 0x10
"""Place and bit of the DSP flag in a control block (port/dspic30f/cpu.c)."""

ROWS = (
    ("flash of the kernel, all calls linked", "flash"),
    ("flash: kernel, one thread, one UART", "smallest flash"),
    ("RAM of the kernel, its stack included", "A"),
    ("RAM a thread costs beside its stack", "pcb"),
    ("frame of a yielded thread on its stack", "yielded"),
    ("the same, DSP state kept", "yielded, DSP"),
    ("frame of a preempted thread on its stack", "preempted"),
    ("the same, DSP state kept", "preempted, DSP"),
    ("RAM of an event, a subscription, a message", "objects"),
    ("switch at the end of a slice", "switch"),
    ("switch by a yield", "yield"),
    ("send 2 bytes, one listener", "send"),
    ("send until the waiting thread runs", "wake"),
)
INTRODUCTION = """\
# OpenSwarm and other kernels

For readers who compare kernels: the paper's Table II with a figure in each cell. This command writes the page:

```
python -m bench.kernel.rtos --freertos DIR --page docs/table2.md
```

## Measured

Bytes and CPU cycles; for the Cortex-M4 *instructions*, because QEMU counts no cycles. An exception costs the chip 12
more cycles each way.
"""
NOTES = """
- dsPIC30F6014A: the same emulator and the same compiler at -Os for both kernels. ATmega328P: simavr, with the 4 cycles
  of interrupt response added that it omits. Cortex-M4: QEMU's netduinoplus2.
- Frames: read from the stacks of threads at the switch, with what the call or the interrupt pushes. OpenSwarm keeps DSP
  state (accumulators, CORCON, DO loops: none open here) for threads that ask for it, FreeRTOS for all. Not measured on
  the other CPUs: their sources have 37 bytes preempted and 22 yielded (`port/avr`), 68 for both (`port/cortex_m`).
- Switch at the end of a slice: from the timer's request (Cortex-M4: from PendSV's first instruction) to the first
  instruction of the next thread. OpenSwarm has a slice of 10 ms and a separate clock interrupt; FreeRTOS's tick of 1 ms
  counts time and switches.
- Send until the waiting thread runs: OpenSwarm from the call in one thread, through delivery at its next yield, to the
  first instruction of the application in the other; FreeRTOS from xQueueSend to a waiting task of higher priority.
- Flash of the kernel: on the dsPIC30F the kernel alone; on the others the whole image of the application `footprint`,
  with drivers, C library and the program itself. FreeRTOS: the share of tasks.c, list.c, queue.c, heap_1.c and the
  port in a program with the corresponding calls, without an allocator that frees (heap_4.c).
- RAM of the kernel: on ATmega328P and Cortex-M4 all variables and the kernel stack of `hello`, including devices.
  FreeRTOS runs its interrupts on the tasks' stacks, which must have room for them. Its idle task (a control block and
  210 bytes of stack) is not counted.

## Literature

Published figures, and figures cited by others; **not measured here**.

| kernel | CPU, condition | RAM per thread | RAM of the kernel | ROM | switch | source |
|---|---|---|---|---|---|---|"""
COLUMNS = ("dsPIC30F", "ATmega328P", "Cortex-M4", "FreeRTOS")


def run(*words: str | Path) -> None:
    """Run a command and print its output only if it fails."""
    done = subprocess.run([str(word) for word in words], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"rtos: {' '.join(str(word) for word in words[:6])} ...\n{done.stdout}{done.stderr}")


# ---- OpenSwarm ------------------------------------------------------------------------------------------------------


def on_dspic(folder: Path) -> dict[str, Any]:
    """Return the cells of the dsPIC30F, measured as by `emu cycles` and `emu footprint`."""
    images = {}
    for app in ("latency", "footprint", "smallest", "saved_frames"):
        apps = ["APPS=../bench/c"] if app == "saved_frames" else []
        run("make", "-s", "-C", "firmware", f"APP={app}", f"OUT={folder / app}", f"PYTHON={sys.executable}", *apps)
        images[app] = load_image(str(folder / app / "firmware.elf"))
    cycles = {name: window.cycles for name, window in run_measures(images["latency"]).items()}
    equation = memory_equation(images["footprint"])
    if equation is None:
        raise SystemExit("rtos: the footprint image has no symbols of the measuring application")
    alone = equation["sizes"]["kernel"]
    return {
        "flash": alone["rom"],
        "smallest flash": sum(piece.rom for piece in pieces(images["smallest"])),
        "A": alone["A"],
        "pcb": round(equation["B"]) - 128,
        **frames(images["saved_frames"]),
        "objects": [round(equation[name]) for name in "CDE"],
        "switch": cycles["preemptive switch, 2 ready threads"],
        "yield": cycles["Sys_Yield to a yielded thread"],
        "send": cycles["send 2 bytes, 1 subscriber, thread"],
        "wake": cycles["send to waiting thread running"],
        "unit": "cycles",
    }


def frames(image: Image) -> dict[str, int]:
    """Return the bytes of saved frames, read from the stacks of the threads of bench/c/saved_frames."""
    target = Target(image, "main", "auto")
    machine, found = target.machine, {}
    for kind, entry, saved in (("preempted", "_T2Interrupt", "os_slice_end"), ("yielded", "hal_yield", "os_yield")):
        for _ in range(FRAMES_SEEN):
            target.run_to(entry)
            before, thread = machine.w[15] - RETURN_ADDRESS, target.words("os_running", 1)[0]
            keeps_dsp = target.word(thread + PCB_STATUS) & SYS_DSP
            target.run_to(saved)
            found[f"{kind}, DSP" if keeps_dsp else kind] = target.word(thread) - before
    return found


def on_port(robot: str) -> dict[str, Any]:
    """Return the table cells of a simulated robot. Raises NotInstalled if its tools are missing."""
    found = measure(robot)
    cycles, equation, sizes = found["cycles"], found["equation"], found["sizes"]
    return {
        "flash": sizes["footprint"]["flash"],
        "smallest flash": sizes["smallest"]["flash"],
        "A": found["kernel_ram"],
        "pcb": equation["B"] - found["stack"],
        **dict.fromkeys(("yielded", "yielded, DSP", "preempted", "preempted, DSP")),
        "objects": [equation[name] for name in "CDE"],
        "switch": cycles["preemptive switch, 2 ready threads"] + found["response"],
        "yield": cycles["Sys_Yield to a yielded thread"],
        "send": cycles["send 2 bytes, 1 subscriber"],
        "wake": cycles["send to waiting thread running"],
        "unit": found["unit"],
    }


# ---- FreeRTOS -------------------------------------------------------------------------------------------------------


def version(checkout: Path) -> str:
    """Return the version that the checkout states, and its commit if git knows it."""
    header = (checkout / "include" / "task.h").read_text(encoding="utf-8")
    said = next(
        (line.split('"')[1] for line in header.splitlines() if "tskKERNEL_VERSION_NUMBER" in line and '"' in line), "?"
    )
    done = subprocess.run(
        ["git", "-C", str(checkout), "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    )
    return f"{said} {done.stdout.strip()}".strip()


def build_freertos(checkout: Path, out: Path) -> Image:
    """Build the measuring program with the official dsPIC port. Exits with a message if the folder is no checkout."""
    missing = [str(source) for source in SOURCES if not (checkout / source).exists()]
    if missing:
        raise SystemExit(f"rtos: {checkout} is no checkout of FreeRTOS-Kernel: it has no {missing[0]}")
    includes = [f"-I{folder}" for folder in (GLUE, checkout / "include", checkout / PORT)]
    sources = [GLUE / "main.c", *(checkout / source for source in SOURCES)]
    # its portmacro.h redefines SIZE_MAX
    run(sys.executable, "-m", "toolchain", "cc", "-Os", "-g", "-Wno-macro-redefined", *includes, *sources, "-o", out)
    return load_image(str(out))


def on_freertos(checkout: Path, folder: Path) -> dict[str, Any]:
    """Return the cells of FreeRTOS on the emulated dsPIC30F6014A."""
    image = build_freertos(checkout, folder / "freertos.elf")
    target = Target(image, "rtos_begin", "auto")
    modules = totals(pieces(image), "module")
    own = {name: size for name, size in modules.items() if not name.endswith("freertos/main.c")}
    kernel = [size for name, size in own.items() if any(name.endswith(str(source)) for source in SOURCES)]
    heap = image.symbols.find("_ucHeap")
    assert heap is not None

    def settle(scenario: int, take: Callable[[Meter], int]) -> int:
        target.restart()
        target.set_words("rtos_wanted", [scenario])
        target.run_to("rtos_created")
        meter = Meter(target)
        return [take(meter) for _ in range(SETTLING)][-1]

    def running() -> int:
        return target.words("pxCurrentTCB", 1)[0]

    def by_tick(meter: Meter) -> int:
        target.run_to("_T1Interrupt")
        before, spinning = running(), meter.inside("rtos_spin")
        return meter.measure_until(lambda: spinning() and running() != before, meter.rise("T1")).cycles

    def by_yield(meter: Meter) -> int:
        target.run_to("vPortYield")
        before, inside = running(), meter.inside("rtos_yield")
        call = 2  # cycles of CALL (isa.md §13.1)
        return meter.measure_until(lambda: inside() and running() != before, meter.machine.cycle - call).cycles

    def frame(entry: str) -> Callable[[Meter], int]:
        def take(meter: Meter) -> int:
            target.run_to(entry)
            before, thread = meter.machine.w[15] - RETURN_ADDRESS, running()
            target.run_to("vTaskSwitchContext")
            return target.word(thread) - before

        return take

    def sending(meter: Meter) -> int:
        target.run_to("rtos_send")
        return meter.measure_until(meter.inside("rtos_received")).cycles

    switch, yielded, wake = settle(TICK, by_tick), settle(YIELD, by_yield), settle(QUEUE, sending)
    free = target.words("rtos_free", 3)
    return {
        "flash": sum(rom for rom, _ in kernel),
        "smallest flash": None,
        "A": sum(ram for _, ram in kernel) - heap.size,
        "pcb": free[1] - free[2] - STACK_BYTES,
        "yielded": None,
        "yielded, DSP": settle(YIELD, frame("vPortYield")),
        "preempted": None,
        "preempted, DSP": settle(TICK, frame("_T1Interrupt")),
        "objects": None,
        "switch": switch,
        "yield": yielded,
        "send": None,
        "wake": wake,
        "unit": "cycles",
        "version": version(checkout),
    }


# ---- The page -------------------------------------------------------------------------------------------------------


def collect(checkout: Path | None) -> dict[str, Any]:
    """Measure the systems whose tools are installed and take the others from the last measurement; "kept" names those
    columns."""
    before = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    cells: dict[str, Any] = {}
    kept = []
    with tempfile.TemporaryDirectory(prefix="openswarm-rtos-") as name:
        folder = Path(name)
        cells["dsPIC30F"] = on_dspic(folder)
        for column, robot in (("ATmega328P", "kilobot"), ("Cortex-M4", "epuck2")):
            try:
                cells[column] = on_port(robot)
            except NotInstalled as missing:
                print(f"rtos: {column} as measured before: {missing}", file=sys.stderr)
                kept.append(column)
        if checkout is not None:
            cells["FreeRTOS"] = on_freertos(checkout, folder)
        else:
            kept.append("FreeRTOS")
    for column in kept:
        if column not in before:
            raise SystemExit(f"rtos: {column} was never measured here")
        cells[column] = before[column]
    KEPT.write_text(json.dumps({column: cells[column] for column in COLUMNS}, indent=1) + "\n")
    return {**cells, "kept": kept}


def cell(column: dict[str, Any], key: str) -> str:
    value = column[key]
    if value is None:
        return "-"
    return ", ".join(map(str, value)) if isinstance(value, list) else f"{value:,}"


def page(found: dict[str, Any]) -> str:
    """Return the text of docs/table2.md."""
    freertos = found["FreeRTOS"]["version"]
    lines = [
        INTRODUCTION,
        f"| | OpenSwarm, dsPIC30F | OpenSwarm, ATmega328P | OpenSwarm, Cortex-M4 | FreeRTOS {freertos}, dsPIC30F |",
        "|---|---|---|---|---|",
    ]
    for name, key in ROWS:
        cells = " | ".join(cell(found[column], key) for column in COLUMNS)
        lines.append(f"| {name} | {cells} |")
    lines.append(NOTES)
    with LITERATURE.open(encoding="utf-8", newline="") as file:
        lines += [
            "| " + " | ".join(row[name] or "-" for name in row) + " |"
            for row in csv.DictReader(line for line in file if not line.startswith("#"))
        ]
    if found["kept"]:
        lines += ["", f"Not measured again in the last run: {', '.join(found['kept'])}."]
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--freertos", metavar="DIR", type=Path, help="a checkout of FreeRTOS-Kernel")
    parser.add_argument("--page", metavar="FILE", type=Path, help="write the page there instead of printing it")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    found = collect(options.freertos)
    if options.page:
        options.page.write_text(page(found), encoding="utf-8")
    print(json.dumps(found, indent=2) if options.json else "" if options.page else page(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
