"""The kernel on an ATmega328P in simavr and on a Cortex-M4 in QEMU, and the conformance suite on every target."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest

import emu
from firmware.tools.simulated import epuck2
from firmware.tools.simulated.kilobot import HZ, Kilobot
from firmware.tools.simulated.machine import NotInstalled, Stopped, pointer, poke_words
from firmware.tools.simulated.measure import sizes
from tests.firmware.conftest import FIRMWARE, TARGET_APPS, Build, run_make
from tests.firmware.kernel.test_kernel_on_target import run_to

CONFORMS = re.compile(rb"conforms: (\d+) checks")
CHECKS, CHECKS_OF_OPTIONS = 282, 417
"""Of the conformance suite and of its part about options; a check that is not reached would be missed otherwise."""
OPTIONS = "DEFINES=-DSUITE_OF_OPTIONS"
"""For `make`: the second image."""


def make(target: str, app: str, out: Path, *words: str, apps: Path | None = None) -> Path:
    """An image for one of the other robots; skips with the Debian package that is missing."""
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


# ---- The conformance suite: one text --------------------------------------------------------------------------------


def check_conforms(said: bytes, checks: int = CHECKS) -> None:
    found = CONFORMS.search(said)
    assert found, said.decode(errors="replace")
    assert int(found[1]) == checks


@pytest.mark.parametrize(
    ("words", "checks"), [((), CHECKS), ((OPTIONS,), CHECKS_OF_OPTIONS)], ids=["kernel", "options"]
)
@pytest.mark.parametrize("target", ["posix", "template"])
def test_a_host_conforms(target: str, words: tuple[str, ...], checks: int, tmp_path: Path) -> None:
    """The unchanged template compiles and conforms (docs/porting.md); so does the port with real signals."""
    flags = "-O1 -g -fsanitize=undefined -fno-sanitize-recover=undefined"
    run_make(FIRMWARE, f"TARGET={target}", "APPS=../tests/firmware/target", "APP=conformance", f"OUT={tmp_path}",
             f"HOST_FLAGS={flags}", *words)  # fmt: skip
    done = subprocess.run([tmp_path / "firmware"], capture_output=True, timeout=120, check=False)
    check_conforms(done.stdout, checks)
    assert done.returncode == 0


ON_TARGETS = ("nothing", "clock and PIDs wrap", "earliest deadline first")
"""What is different from a plain start; the suite itself begins with fixed priorities."""
NEARLY_ROUND = (("now_ms", 0xFE00), ("newest_pid", 0xFF00))
"""Words of the kernel that wrap half a second and 256 threads later."""


def words_of(case: str) -> tuple[str, ...]:
    """For `make`."""
    return ("DEFINES=-DFIRST_SCHEDULER=sys_earliest_deadline",) if "deadline" in case else ()


@pytest.mark.parametrize("case", ON_TARGETS)
def test_the_dspic30f_conforms(image: Build, case: str) -> None:
    """The same text on the emulated e-puck."""
    machine = emu.load(image("conformance", TARGET_APPS, *words_of(case)), engine="jit")
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)
    if "wrap" in case:
        run_to(machine, "main")
        for name, value in NEARLY_ROUND:
            machine.poke(name, value)
    machine.run(cycles=7 * 14_745_600)
    check_conforms(bytes(said))


@pytest.mark.parametrize("case", ON_TARGETS)
def test_the_kilobot_conforms(case: str, tmp_path: Path) -> None:
    """The same text on an ATmega328P, where a pointer is two stores."""
    machine = kilobot(make("kilobot", "conformance", tmp_path, *words_of(case), apps=TARGET_APPS))
    if "wrap" in case:
        machine.run_to("main")
        for name, value in NEARLY_ROUND:
            poke_words(machine, name, (value,))
    machine.run(7 * HZ)
    check_conforms(machine.uart())


@pytest.mark.parametrize("case", [case for case in ON_TARGETS if "wrap" not in case])
def test_the_epuck2_conforms(case: str, tmp_path: Path) -> None:
    """The same text on a Cortex-M4 with its FPU and MPU at work."""
    image = make("epuck2", "conformance", tmp_path, *words_of(case), apps=TARGET_APPS)
    check_conforms(said_by_epuck2(image, b" checks"))


def test_the_options_of_the_dspic30f_conform(image: Build) -> None:
    """Mutex, join, cleanup, quota, services, and what hostile programs do to them."""
    machine = emu.load(image("conformance", TARGET_APPS, OPTIONS), engine="jit")
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)
    machine.run(cycles=5 * 14_745_600)
    check_conforms(bytes(said), CHECKS_OF_OPTIONS)


def test_the_options_of_the_kilobot_conform(tmp_path: Path) -> None:
    image = make("kilobot", "conformance", tmp_path, OPTIONS, apps=TARGET_APPS)
    check_conforms(said_by_kilobot(image, 5), CHECKS_OF_OPTIONS)


def test_the_options_of_the_epuck2_conform(tmp_path: Path) -> None:
    image = make("epuck2", "conformance", tmp_path, OPTIONS, apps=TARGET_APPS)
    check_conforms(said_by_epuck2(image, b" checks"), CHECKS_OF_OPTIONS)


# ---- Listing 1 and stress -------------------------------------------------------------------------------------------

LINES = b"".join(b"%d:(0,0)\r\n" % ms for ms in range(50, 2050, 250))


def test_listing_1_logs_on_the_kilobot(tmp_path: Path) -> None:
    """Every 250 ms of the robot's clock, from the 50th ms on."""
    assert said_by_kilobot(make("kilobot", "listing1", tmp_path), 2.0) == LINES


def test_listing_1_logs_on_the_epuck2(tmp_path: Path) -> None:
    image = make("epuck2", "listing1", tmp_path)
    assert said_by_epuck2(image, rb"1800:\(0,0\)\r\n").startswith(LINES)


def check_stress(said: bytes, reports: int) -> None:
    """Reports every second, no assertion (they name a file), the heap as it was in each of them."""
    text = said.decode()
    assert ".c:" not in text
    assert "trap" not in text
    heaps = re.findall(r"heap (\d+), peak \d+", text)
    assert len(heaps) >= reports
    assert len(set(heaps)) == 1


def test_stress_on_the_kilobot(tmp_path: Path) -> None:
    """Six threads, eight events, everything at random, for 20 s."""
    check_stress(said_by_kilobot(make("kilobot", "stress", tmp_path), 20.2), 18)


def test_stress_on_the_epuck2(tmp_path: Path) -> None:
    """The same for 20 s."""
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
    """A folder of applications with one whose second thread needs more stack than it has."""
    (tmp_path / "overflowing").mkdir()
    (tmp_path / "overflowing" / "main.c").write_text(OVERFLOW)
    return tmp_path


def test_the_epuck2_buries_a_thread_that_overflows(overflowing: Path) -> None:
    """The MPU stops the thread, the fault is reported, the others continue (port/cortex_m/README.md)."""
    image = make("epuck2", "overflowing", overflowing / "out", apps=overflowing)
    said = said_by_epuck2(image, rb"(on\n){3}")
    assert b"stack overflow: thread 2\r\n" in said


def test_the_kilobot_stops_when_a_stack_has_overflown(overflowing: Path) -> None:
    """port/avr/README.md: nothing stops the thread, so that the system does, at the next switch.

    Below this one lies untouched memory; another thread there would have been damaged first."""
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
    """The MPU traps where it happens; the AVR sees it behind the handlers, by the paint of the stack's last byte.

    There only if what lies below the stack lets it come so far, the kernel's own variables (port/avr/README.md): so the
    handler leaves the stack's last bytes to the tick above it."""
    (tmp_path / "handler").mkdir()
    (tmp_path / "handler" / "main.c").write_text(IN_A_HANDLER)
    bytes_of = {"kilobot": "(SYS_KERNEL_STACK-32)", "epuck2": "SYS_KERNEL_STACK"}
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
    """Kernel, one thread and UART: 6 kB of flash, and 500 bytes of RAM, main's included."""
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
    """In 2 kB of RAM, each for its slice."""
    machine = kilobot(make("kilobot", "latency", tmp_path, "DEFINES=-DSYS_HEAP=1130"))
    machine.run_to("latency_begin")
    poke_words(machine, "latency_wanted", (7, 0, 0, 0, 0, 0, 0))
    machine.run_to("latency_ready")
    ran = set()
    for _ in range(14):
        machine.run(HZ // 100)
        ran.add(pointer(machine, "os_running"))
    assert len(ran) == 7


# ---- Building -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("port", "packages"), [("avr", "gcc-avr avr-libc"), ("cortex_m", "gcc-arm-none-eabi libnewlib-arm-none-eabi")]
)
def test_a_missing_compiler_is_named_with_its_packages(port: str, packages: str, tmp_path: Path) -> None:
    """Exit status 2 and one line; nothing is built."""
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
