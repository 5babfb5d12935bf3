"""The kernel on an ATmega328P in simavr, a Cortex-M4 and a RISC-V in QEMU; the conformance suite on every target."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

import emu
from firmware.tools.simulated.kilobot import HZ
from firmware.tools.simulated.machine import pointer, poke_words
from firmware.tools.simulated.measure import sizes
from tests.cases import check_all
from tests.firmware.conftest import FIRMWARE, TARGET_APPS, Build, run_make
from tests.firmware.kernel.test_kernel_on_target import run_to
from tests.firmware.ports.targets import BOARDS, kilobot, make, said_by_kilobot, said_in_qemu
from tests.fuzz.seeds import base_seed
from tests.watchdog import HANG

CONFORMS = re.compile(rb"conforms: (\d+) checks")
CHECKS, CHECKS_OF_OPTIONS = 283, 545
"""Number of checks of the conformance suite and of its options part.

The numbers reveal checks that are not reached.
"""
OPTIONS = "DEFINES=-DSUITE_OF_OPTIONS"
"""Make variable that builds the second image, the options part of the suite."""


# ---- Conformance suite ----------------------------------------------------------------------------------------------


def check_conforms(said: bytes, checks: int = CHECKS) -> None:
    found = CONFORMS.search(said)
    assert found, said.decode(errors="replace")
    assert int(found[1]) == checks


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "checks"), [((), CHECKS), ((OPTIONS,), CHECKS_OF_OPTIONS)], ids=["kernel", "options"]
)
@pytest.mark.parametrize("target", ["posix", "template"])
def test_a_host_conforms(target: str, words: tuple[str, ...], checks: int, tmp_path: Path) -> None:
    """The unchanged template port and the POSIX port with real signals pass the conformance suite (docs/porting.md)."""
    sanitizers = "address,undefined" if target == "posix" else "undefined"  # the template has contexts unknown to ASan
    flags = f"-O1 -g -fsanitize={sanitizers} -fno-sanitize-recover=undefined"
    run_make(FIRMWARE, f"TARGET={target}", "APPS=../tests/firmware/target", "APP=conformance", f"OUT={tmp_path}",
             f"HOST_FLAGS={flags}", *words)  # fmt: skip
    done = subprocess.run([tmp_path / "firmware"], capture_output=True, timeout=HANG, check=False)
    assert done.returncode == 0, (done.returncode, done.stdout[-200:], done.stderr.decode(errors="replace"))
    check_conforms(done.stdout, checks)


NEARLY_ROUND = (("now_ms", 0xFE00), ("newest_pid", 0xFF00))
"""Kernel variables with values that wrap after half a second and after 256 threads."""
WRAPS, DEADLINES = "clock and PIDs wrap", "earliest deadline first"
ROBOTS = ("epuck", "kilobot", *BOARDS)


def conditions(robot: str, *more: str) -> list[str]:
    """Return the starting conditions under which the suite runs; the suite itself begins with fixed priorities.

    The commit determines on which robot it begins with deadlines.
    """
    return ["nothing", *more, *[DEADLINES] * (robot == ROBOTS[base_seed() % len(ROBOTS)])]


def words_of(condition: str) -> tuple[str, ...]:
    """Return the make arguments that set the starting condition."""
    return ("DEFINES=-DFIRST_SCHEDULER=sys_earliest_deadline",) if condition == DEADLINES else ()


def said_by_epuck(image: Path, seconds: int, start: Sequence[tuple[str, int]] = ()) -> bytes:
    """Return the UART output of the emulated e-puck until the suite ends; `start` sets variables at main."""
    machine = emu.load(image, engine="jit")
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)
    if start:
        run_to(machine, "main")
    for name, value in start:
        machine.poke(name, value)
    while machine.cycle < seconds * emu.FCY_HZ and b" checks" not in said:
        machine.run(seconds=0.1)
    return bytes(said)


@pytest.mark.slow
def test_the_dspic30f_conforms(image: Build) -> None:
    """The emulated e-puck passes the conformance suite."""

    def check(condition: str) -> None:
        start = NEARLY_ROUND if condition == WRAPS else ()
        check_conforms(said_by_epuck(image("conformance", TARGET_APPS, *words_of(condition)), 7, start))

    check_all(check, conditions("epuck", WRAPS))


@pytest.mark.slow
def test_the_kilobot_conforms(tmp_path: Path) -> None:
    """The ATmega328P, on which storing a pointer takes two instructions, passes the conformance suite."""

    def check(condition: str) -> None:
        machine = kilobot(make("kilobot", "conformance", tmp_path, *words_of(condition), apps=TARGET_APPS))
        if condition == WRAPS:
            machine.run_to("main")
            for name, value in NEARLY_ROUND:
                poke_words(machine, name, (value,))
        machine.run(7 * HZ)
        check_conforms(machine.uart())

    check_all(check, conditions("kilobot", WRAPS))


@pytest.mark.slow
@pytest.mark.parametrize("target", BOARDS)
def test_a_cpu_in_qemu_conforms(target: str, tmp_path: Path) -> None:
    """The Cortex-M4, with FPU and MPU enabled, and the RISC-V pass the conformance suite."""

    def check(condition: str) -> None:
        image = make(target, "conformance", tmp_path, *words_of(condition), apps=TARGET_APPS)
        check_conforms(said_in_qemu(target, image, b" checks"))

    check_all(check, conditions(target))


@pytest.mark.slow
def test_the_options_of_the_dspic30f_conform(image: Build) -> None:
    """The dsPIC30F passes the options part: mutex, join, cleanup, quota, services and hostile programs."""
    check_conforms(said_by_epuck(image("conformance", TARGET_APPS, OPTIONS), 5), CHECKS_OF_OPTIONS)


@pytest.mark.slow
def test_the_options_of_the_kilobot_conform(tmp_path: Path) -> None:
    image = make("kilobot", "conformance", tmp_path, OPTIONS, apps=TARGET_APPS)
    check_conforms(said_by_kilobot(image, 5), CHECKS_OF_OPTIONS)


@pytest.mark.slow
@pytest.mark.parametrize("target", BOARDS)
def test_the_options_of_a_cpu_in_qemu_conform(target: str, tmp_path: Path) -> None:
    image = make(target, "conformance", tmp_path, OPTIONS, apps=TARGET_APPS)
    check_conforms(said_in_qemu(target, image, b" checks"), CHECKS_OF_OPTIONS)


# ---- Listing 1 and stress -------------------------------------------------------------------------------------------

LINES = b"".join(b"%d:(0,0)\r\n" % ms for ms in range(0, 2000, 250))


def test_listing_1_logs_on_the_kilobot(tmp_path: Path) -> None:
    """Listing 1 on the Kilobot logs every 250 ms of the robot's clock, from the start on."""
    assert said_by_kilobot(make("kilobot", "listing1", tmp_path), 2.0) == LINES


@pytest.mark.slow
@pytest.mark.parametrize("target", BOARDS)
def test_listing_1_logs_in_qemu(target: str, tmp_path: Path) -> None:
    image = make(target, "listing1", tmp_path)
    assert said_in_qemu(target, image, rb"1750:\(0,0\)\r\n").startswith(LINES)


def check_stress(said: bytes, reports: int) -> None:
    """Assert one report per second, no failed assertion (which would name a file) and an unchanged heap in each
    report."""
    text = said.decode()
    assert ".c:" not in text
    assert "trap" not in text
    heaps = re.findall(r"heap (\d+), peak \d+", text)
    assert len(heaps) >= reports
    assert len(set(heaps)) == 1


@pytest.mark.slow
def test_stress_on_the_kilobot(tmp_path: Path) -> None:
    """The stress application with six threads and eight events runs 20 s of random actions on the Kilobot."""
    check_stress(said_by_kilobot(make("kilobot", "stress", tmp_path), 20.2), 18)


@pytest.mark.slow
@pytest.mark.parametrize("target", BOARDS)
def test_stress_in_qemu(target: str, tmp_path: Path) -> None:
    """The stress application runs 20 s of random actions on the Cortex-M4 and the RISC-V."""
    check_stress(said_in_qemu(target, make(target, "stress", tmp_path), rb"\n2\d{4} ms"), 17)


# ---- Size ---------------------------------------------------------------------------------------------------------


def test_the_smallest_program_of_the_kilobot(tmp_path: Path) -> None:
    """Kernel, one thread and UART take at most 6 kB of flash and 500 bytes of RAM, including main's stack."""
    image = make("kilobot", "smallest", tmp_path)
    machine = kilobot(image)
    behind, last = machine.symbols["_end"] & 0xFFFF, 0x8FF
    paint = b"\xa5"
    machine.poke_bytes(behind + 1, paint * (last - behind))
    machine.run_to("main")
    assert pointer(machine, "os_running") == machine.symbols["os_system"] & 0xFFFF, "a fault here names thread 0"
    machine.run(3 * HZ)
    assert machine.uart() == b"hello, swarm\r\n" * 3
    main_stack = len(machine.peek_bytes(behind + 1, last - behind).lstrip(paint))
    size = sizes(image)
    assert size["flash"] <= 6144
    assert size["ram"] + main_stack <= 500


def test_seven_threads_of_128_bytes_run_on_the_kilobot(tmp_path: Path) -> None:
    """Seven threads with 128-byte stacks each run for their slices in the 2 kB of RAM of the Kilobot."""
    machine = kilobot(make("kilobot", "latency", tmp_path, "DEFINES=-DSYS_HEAP=1130"))
    machine.run_to("latency_begin")
    poke_words(machine, "latency_wanted", (7, 0, 0, 0, 0, 0, 0))
    machine.run_to("latency_ready")
    ran = set()
    for _ in range(14):
        machine.run(HZ // 100)
        ran.add(pointer(machine, "os_running"))
    assert len(ran) == 7


# ---- Build errors ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("port", "packages"),
    [
        ("avr", "gcc-avr avr-libc"),
        ("cortex_m", "gcc-arm-none-eabi libnewlib-arm-none-eabi"),
        ("riscv", "gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf"),
    ],
)
def test_a_missing_compiler_is_named_with_its_packages(port: str, packages: str, tmp_path: Path) -> None:
    """A missing compiler ends the build with exit status 2 and one line that names its packages."""
    for tool in ("make", "sh", "grep", "cat", "dirname"):
        found = next(Path(folder) / tool for folder in os.get_exec_path() if (Path(folder) / tool).exists())
        (tmp_path / tool).symlink_to(found)
    command = ["make", "-s", "-C", str(FIRMWARE), f"PORT={port}", "APP=hello", f"OUT={tmp_path / 'out'}"]
    environment = {**os.environ, "PATH": str(tmp_path), "MAKEFLAGS": ""}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 2
    assert packages in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_port_and_a_target_that_do_not_belong_together_are_refused() -> None:
    command = ["make", "-s", "-C", str(FIRMWARE), "PORT=avr", "TARGET=epuck"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "MAKEFLAGS": ""})
    assert done.returncode == 2
    assert "PORT=avr does not belong to TARGET=epuck" in done.stderr
