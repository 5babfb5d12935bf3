"""The kernel on an ATmega328P in simavr and on a Cortex-M4 in QEMU; the conformance suite on every target."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

import emu
from firmware.tools.simulated import epuck2
from firmware.tools.simulated.kilobot import HZ, Kilobot
from firmware.tools.simulated.machine import NotInstalled, Stopped, pointer, poke_words
from firmware.tools.simulated.measure import sizes
from tests.cases import check_all
from tests.firmware.conftest import FIRMWARE, TARGET_APPS, Build, run_make
from tests.firmware.kernel.test_kernel_on_target import run_to
from tests.fuzz.seeds import base_seed
from tests.watchdog import HANG

CONFORMS = re.compile(rb"conforms: (\d+) checks")
CHECKS, CHECKS_OF_OPTIONS = 283, 543
"""Number of checks of the conformance suite and of its options part.

The numbers reveal checks that are not reached.
"""
OPTIONS = "DEFINES=-DSUITE_OF_OPTIONS"
"""Make variable that builds the second image, the options part of the suite."""


def make(target: str, app: str, out: Path, *words: str, apps: Path | None = None) -> Path:
    """Build an image for another robot; skip the test if a Debian package is missing."""
    folder = [f"APPS={os.path.relpath(apps, FIRMWARE)}"] if apps else []
    command = ["make", "-s", "-C", str(FIRMWARE), f"TARGET={target}", f"APP={app}", f"OUT={out}", *folder, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "MAKEFLAGS": ""})
    if "is not installed" in done.stderr:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stdout + done.stderr
    return out / "firmware.elf"


def kilobot(image: Path) -> Kilobot:
    try:
        return Kilobot(image)
    except NotInstalled as missing:
        pytest.skip(str(missing))


def said_by_kilobot(image: Path, seconds: float) -> bytes:
    machine = kilobot(image)
    machine.run(int(seconds * HZ))
    return machine.uart()


def said_by_epuck2(image: Path, text: bytes) -> bytes:
    try:
        return epuck2.run_until(image, text)
    except NotInstalled as missing:
        pytest.skip(str(missing))


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
    check_conforms(done.stdout, checks)
    assert done.returncode == 0


NEARLY_ROUND = (("now_ms", 0xFE00), ("newest_pid", 0xFF00))
"""Kernel variables with values that wrap after half a second and after 256 threads."""
WRAPS, DEADLINES = "clock and PIDs wrap", "earliest deadline first"
ROBOTS = ("epuck", "kilobot", "epuck2")


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
def test_the_epuck2_conforms(tmp_path: Path) -> None:
    """The Cortex-M4 passes the conformance suite with FPU and MPU enabled."""

    def check(condition: str) -> None:
        image = make("epuck2", "conformance", tmp_path, *words_of(condition), apps=TARGET_APPS)
        check_conforms(said_by_epuck2(image, b" checks"))

    check_all(check, conditions("epuck2"))


@pytest.mark.slow
def test_the_options_of_the_dspic30f_conform(image: Build) -> None:
    """The dsPIC30F passes the options part: mutex, join, cleanup, quota, services and hostile programs."""
    check_conforms(said_by_epuck(image("conformance", TARGET_APPS, OPTIONS), 5), CHECKS_OF_OPTIONS)


def test_the_options_of_the_kilobot_conform(tmp_path: Path) -> None:
    image = make("kilobot", "conformance", tmp_path, OPTIONS, apps=TARGET_APPS)
    check_conforms(said_by_kilobot(image, 5), CHECKS_OF_OPTIONS)


@pytest.mark.slow
def test_the_options_of_the_epuck2_conform(tmp_path: Path) -> None:
    image = make("epuck2", "conformance", tmp_path, OPTIONS, apps=TARGET_APPS)
    check_conforms(said_by_epuck2(image, b" checks"), CHECKS_OF_OPTIONS)


# ---- Listing 1 and stress -------------------------------------------------------------------------------------------

LINES = b"".join(b"%d:(0,0)\r\n" % ms for ms in range(0, 2000, 250))


def test_listing_1_logs_on_the_kilobot(tmp_path: Path) -> None:
    """Listing 1 on the Kilobot logs every 250 ms of the robot's clock, from the start on."""
    assert said_by_kilobot(make("kilobot", "listing1", tmp_path), 2.0) == LINES


def test_listing_1_logs_on_the_epuck2(tmp_path: Path) -> None:
    image = make("epuck2", "listing1", tmp_path)
    assert said_by_epuck2(image, rb"1750:\(0,0\)\r\n").startswith(LINES)


def check_stress(said: bytes, reports: int) -> None:
    """Assert one report per second, no failed assertion (which would name a file) and an unchanged heap in each
    report."""
    text = said.decode()
    assert ".c:" not in text
    assert "trap" not in text
    heaps = re.findall(r"heap (\d+), peak \d+", text)
    assert len(heaps) >= reports
    assert len(set(heaps)) == 1


def test_stress_on_the_kilobot(tmp_path: Path) -> None:
    """The stress application with six threads and eight events runs 20 s of random actions on the Kilobot."""
    check_stress(said_by_kilobot(make("kilobot", "stress", tmp_path), 20.2), 18)


@pytest.mark.slow
def test_stress_on_the_epuck2(tmp_path: Path) -> None:
    """The stress application runs 20 s of random actions on the e-puck2."""
    check_stress(said_by_epuck2(make("epuck2", "stress", tmp_path), rb"\n2\d{4} ms"), 17)


# ---- Stack limits ---------------------------------------------------------------------------------------------------

OVERFLOW = r"""
#include <openswarm.h>
#include <openswarm_io.h>
static volatile uint16 depth;
static uint16 recurse(uint16 n)
{
    volatile uint8 room[16];
    room[0] = (uint8)n;
    if (n == SYS_DEFAULT_STACK / 16) {
        Sys_Sleep(5);
        return depth;
    }
    return (uint16)(recurse((uint16)(n + 1u)) + room[0] + depth);
}
static void greedy(void) { Sys_Sleep(20); depth = recurse(0); }
static void modest(void) { for (;;) { Sys_Sleep(100); Sys_Write_UART1("on\n", 3); } }
int main(void)
{
    Sys_Init_Kernel();
    Sys_Start_Process(modest);
    Sys_Start_Process(greedy);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
"""


@pytest.fixture
def overflowing(tmp_path: Path) -> Path:
    """Return a folder of applications, one of which has a second thread that overflows its stack."""
    (tmp_path / "overflowing").mkdir()
    (tmp_path / "overflowing" / "main.c").write_text(OVERFLOW)
    return tmp_path


DROPS = "DEFINES=-DSYS_ON_OVERFLOW=SYS_DROP_THREAD"
"""Make variable by which a stack overflow ends only its thread."""


@pytest.mark.parametrize(
    ("words", "reported"), [((), b"stack trap at 0x0:0 in thread 2"), ((DROPS,), b"overflow: thread 2")]
)
def test_the_epuck2_stops_at_a_stack_overflow_or_drops_the_thread(
    overflowing: Path, words: tuple[str, ...], reported: bytes
) -> None:
    """The MPU of the e-puck2 stops a thread that overflows: the end of the system, or of the thread.

    Source: port/cortex_m/README.md.
    """
    image = make("epuck2", "overflowing", overflowing / "out", *words, apps=overflowing)
    said = said_by_epuck2(image, rb"(on\n){3}" if words else rb"thread 2\r\n")
    assert reported + b"\r\n" in said
    assert words or b"on\n" not in said


def test_the_kilobot_stops_when_a_stack_has_overflown(overflowing: Path) -> None:
    """On the Kilobot the next switch detects a stack overflow and stops the system (port/avr/README.md).

    Nothing stops the thread itself. Here unused memory lies below the stack; another thread there would have been
    damaged.
    """
    machine = kilobot(make("kilobot", "overflowing", overflowing / "out", apps=overflowing))
    with pytest.raises(Stopped):
        machine.run(HZ)
    assert machine.uart().startswith(b"stack trap at 0x0:0 in thread 2")


IN_A_HANDLER = r"""
#include <openswarm.h>
static volatile uint8 sum;
static bool handler(uint16 pid, uint16 event, sys_event_data *data)
{
    volatile uint8 room[BYTES];
    (void)pid, (void)event;
    for (uint16 i = BYTES; data->value == 25 && i-- != 0;) {
        room[i] = (uint8)i;
        sum += room[i];
    }
    return true;
}
int main(void)
{
    Sys_Init_Kernel();
    Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, handler, NULL);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
"""


@pytest.mark.parametrize("target", ["kilobot", "epuck2"])
def test_an_overflow_of_the_kernel_stack_stops_the_system(target: str, tmp_path: Path) -> None:
    """An overflow of the kernel stack stops the system: by the MPU at once, on the AVR after the handlers.

    The AVR detects it by the fill pattern in the last byte of the stack, which requires that the kernel's variables
    below survive. The handler therefore leaves the last bytes of the stack to the tick that interrupts it
    (port/avr/README.md).
    """
    (tmp_path / "handler").mkdir()
    (tmp_path / "handler" / "main.c").write_text(IN_A_HANDLER)
    bytes_of = {"kilobot": "(SYS_KERNEL_STACK-28)", "epuck2": "SYS_KERNEL_STACK"}
    image = make(target, "handler", tmp_path / "out", f"DEFINES=-DBYTES='{bytes_of[target]}'", apps=tmp_path)
    if target == "epuck2":
        assert said_by_epuck2(image, rb" in thread \d+\r\n").startswith(b"stack trap at 0x")
    else:
        machine = kilobot(image)
        with pytest.raises(Stopped):
            machine.run(HZ)
        assert machine.uart().startswith(b"stack trap at 0x0:0 in thread ")


# ---- Size ---------------------------------------------------------------------------------------------------------


def test_the_smallest_program_of_the_kilobot(tmp_path: Path) -> None:
    """Kernel, one thread and UART take at most 6 kB of flash and 500 bytes of RAM, including main's stack."""
    image = make("kilobot", "smallest", tmp_path)
    machine = kilobot(image)
    behind, last = machine.symbols["_end"] & 0xFFFF, 0x8FF
    paint = b"\xa5"
    machine.poke_bytes(behind + 1, paint * (last - behind))
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
    ("port", "packages"), [("avr", "gcc-avr avr-libc"), ("cortex_m", "gcc-arm-none-eabi libnewlib-arm-none-eabi")]
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
