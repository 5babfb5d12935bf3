"""The applications of firmware/apps, on the emulated robot and on a host."""

from __future__ import annotations

import binascii
import math
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

import emu
from emu.cli import main
from tests.firmware.conftest import FIRMWARE, Build, run_make
from tests.firmware.kernel.test_kernel_on_target import FCY, load


def test_hello_says_hello_every_second(image: Build) -> None:
    """`hello` prints its greeting (firmware/apps/hello/README.md)."""
    machine = load(image("hello"))
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)
    machine.run(cycles=21 * FCY // 10)
    assert said.decode() == "hello, swarm\r\n" * 3


# ---- processors -----------------------------------------------------------------------------------------------------


def cobs(message: bytes) -> bytes:
    """Return the COBS frame of a message with its CRC-16/CCITT-FALSE and end mark; messages below 253 bytes."""
    body = message + binascii.crc_hqx(message, 0xFFFF).to_bytes(2, "big")
    return b"".join(bytes([len(run) + 1]) + run for run in body.split(b"\0")) + b"\0"


def uncobs(frame: bytes) -> bytes:
    """Return the message of a frame without end mark; fail on a damaged frame."""
    body = b""
    while frame:
        run, frame = frame[1 : frame[0]], frame[frame[0] :]
        body += run + (b"\0" if frame else b"")
    assert binascii.crc_hqx(body, 0xFFFF) == 0
    return body[:-2]


def test_processors_are_swapped_under_traffic_without_loss(image: Build) -> None:
    """Virtual actuator, safety post-processor, COBS + CRC-16 as Rx/Tx pair; the paper."""
    machine = load(image("processors"))
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)
    machine.run(cycles=FCY // 4)
    assert said.decode().splitlines()[1:] == ["+085+115"] * 2  # v = 100 mm/s, omega = 0.6 rad/s, axle 53 mm
    machine.uart[1].feed(b"u")
    machine.run(cycles=FCY)
    assert said.decode().splitlines()[-1] == "+057+042"  # the next command of the pilot, halved
    machine.uart[1].feed(b"f")
    machine.run(cycles=FCY // 100)
    plain = len(said)
    machine.run(cycles=FCY // 2)
    *frames, rest = bytes(said[plain:]).split(b"\0")
    assert rest == b""
    assert len(frames) == 5
    assert {uncobs(frame) for frame in frames} == {b"+057+042\r\n"}
    machine.uart[1].feed(cobs(b"st"))
    machine.run(cycles=FCY // 100)
    framed = len(said)
    machine.run(cycles=FCY)
    lines = bytes(said[framed:]).decode().splitlines()
    assert len(lines) == 10
    assert lines[-1] == "+085+115", "full speed again, in text"


# ---- stress ---------------------------------------------------------------------------------------------------------


def test_stress_neither_leaks_nor_traps(image: Build) -> None:
    """Every 200 actions the application asserts that the heap is as it was."""
    machine = load(image("stress"))
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)
    stop = machine.run(cycles=41 * FCY // 10)
    assert stop.reason == "limit"
    text = said.decode()
    handled = [int(n) for n in re.findall(r"ms: (\d+) handled", text)]
    assert len(handled) >= 3
    assert handled == sorted(set(handled))
    heaps = set(re.findall(r"heap (\d+),", text))
    assert len(heaps) == 1, "reported after each take-down"
    assert "in thread" not in text
    assert all(int(n) >= 64 for n in re.findall(r"kernel stack left (\d+)", text))


# ---- Setting up -----------------------------------------------------------------------------------------------------

SETS_UP = re.compile(
    r"^\s*(?:\(void\))?(?:Sys_Subscribe_to_Event|Sys_Start_Process(?:With)?|Sys_Connect_Motors)\(", re.MULTILINE
)
"""Matches a statement that ignores a result."""


@pytest.mark.parametrize("app", ["clustering", "hello", "listing1", "processors", "selftest", "spi"])
def test_no_application_drops_the_result_of_a_call_that_sets_it_up(app: str) -> None:
    """Every application checks its subscriptions: an unnoticed failure would leave a robot without reactions."""
    for source in (FIRMWARE / "apps" / app).glob("*.c"):
        assert not SETS_UP.findall(source.read_text()), source


# ---- Faults ---------------------------------------------------------------------------------------------------------


def test_a_failed_assertion_is_a_firmware_fault(image: Build, tmp_path: Path, capfd) -> None:
    """UART1 says where, `emu run` ends with status 1."""
    (tmp_path / "wrong").mkdir()
    (tmp_path / "wrong" / "main.c").write_text("""#include <openswarm.h>
int main(void) {
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Get_ProcessID() == 0);
    SYS_ASSERT(Sys_Get_ProcessID() == 7);
    return 0;
}
""")
    assert main(["run", str(image("wrong", tmp_path)), "--seconds", "1"]) == 1
    said = capfd.readouterr()
    assert re.search(r"main\.c:5 in thread 0", said.out)
    assert "firmware fault: the kernel stopped the system" in said.err


# ---- On a host -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("gcc") is None:
        pytest.skip("the POSIX port is built with gcc, which is not installed (Debian package gcc)")
    return tmp_path_factory.mktemp("host")


@pytest.mark.parametrize("app", ["listing1", "processors", "stress", "footprint", "latency", "hello"])
def test_every_application_builds_for_a_host(host: Path, app: str) -> None:
    """The same kernel and applications on Linux, without warnings."""
    run_make(FIRMWARE, f"APP={app}", "TARGET=posix", f"OUT={host / app}")


def test_listing1_runs_on_a_host_in_real_time(host: Path) -> None:
    """Preemption by signal, sanitizers on; the line of 300 ms is there, whatever the host's speed."""
    flags = "HOST_FLAGS=-O1 -g -fsanitize=address,undefined -fno-sanitize-recover=undefined"
    run_make(FIRMWARE, "APP=listing1", "TARGET=posix", f"OUT={host / 'sanitized'}", flags)
    with subprocess.Popen([host / "sanitized" / "firmware"], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as program:
        assert program.stdout is not None
        lines = [program.stdout.readline() for _ in range(2)]
        program.kill()
    assert lines == [b"50:(0,0)\r\n", b"300:(0,0)\r\n"]


def test_sources_written_for_the_original_compile(host: Path) -> None:
    """openswarm_compat.h: the repository's spellings (openswarm-original.md §2.3)."""
    source = host / "compat.c"
    source.write_text("""#include <openswarm_compat.h>
static bool handler(uint16 pid, uint16 id, sys_event_data *data) { (void)pid; (void)id; return data->value != 0; }
static void thread(void) { Sys_event_data *d = Sys_Wait_For_Event(SYS_EVENT_1ms_CLOCK); Sys_Clear_EventData(&d); }
int main(void) {
    pFunction f = thread; pEventHandlerFunction h = handler; pConditionFunction c = 0;
    Sys_Init_Kernel(); System_Start_Process(f); Sys_Subscribe_to_Event(SYS_EVENT_IO_CAMERA, 0, h, c);
    Sys_Set_LeftWheelSpeed(Sys_Get_LeftWheelSpeed()); Sys_Writeto_UART1("x", 1);
    Sys_Unsubscribe_Handler_from_Event(SYS_EVENT_IO_CAMERA, h, 0); Sys_Start_Kernel(); Sys_Run_SystemThread();
    return (int)Sys_Get_SystemClock();
}
""")
    openswarm = FIRMWARE / "openswarm"
    includes = [f"-I{openswarm / folder}" for folder in ("include", "hal", "port/posix")]
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", *includes, str(source)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


# ---- tone, commands, patrol -----------------------------------------------------------------------------------------


def on_both_engines(folder: Path, ask: Callable[[emu.Machine], str]) -> str:
    """Return the output of a program for `ask`; interpreter and native code must agree."""
    first, second = (ask(emu.load(folder, engine=engine)) for engine in ("plain", "jit"))
    assert first == second
    return first


def sines(*tones: tuple[int, int]) -> Callable[[int], float]:
    """Return a sum of sines of (Hz, counts)."""
    return lambda cycle: sum(a * math.sin(2 * math.pi * hz * cycle / FCY) for hz, a in tones)


def test_tone_hears_what_its_filter_lets_through(image: Build) -> None:
    """firmware/apps/tone/README.md: 200 Hz below a cut-off at 400 Hz, and nine times louder 560 Hz."""

    def ask(machine: emu.Machine) -> str:
        said = bytearray()
        machine.uart[1].listen(lambda byte, _: said.append(byte))
        machine.run(seconds=0.2)
        machine.board.microphones.play(0, sines((200, 100), (560, 900)))
        machine.run(seconds=0.42)
        return said.decode()

    lines = on_both_engines(image("tone"), ask).split()
    assert lines[0] == "silence"
    assert lines[-4:] == ["200", "Hz"] * 2


def test_commands_are_read_with_sscanf(image: Build) -> None:
    """`commands` answers its commands (firmware/apps/commands/README.md)."""

    def ask(machine: emu.Machine) -> str:
        said = bytearray()
        machine.uart[1].listen(lambda byte, _: said.append(byte))
        for line in ("speed 50, -30", "get speed", "sum 0x10 010", "speed 1", "get lost", "speed 1,2 3"):
            machine.uart[1].feed(line.encode() + b"\r\n")
            machine.run(seconds=0.05)
        return said.decode()

    assert on_both_engines(image("commands"), ask).split() == ["ok", "50,-30", "24", "?", "?", "?"]


def test_patrol_runs_its_behaviours_in_turn(image: Build) -> None:
    """firmware/apps/patrol/README.md: C++ on the kernel."""

    def ask(machine: emu.Machine) -> str:
        said = bytearray()
        machine.uart[1].listen(lambda byte, _: said.append(byte))
        machine.run(seconds=1.7)
        return said.decode()

    lines = on_both_engines(image("patrol"), ask).splitlines()
    assert lines == ["1 straight 60 60", "2 spin 30 -30", "3 straight 60 60", "4 spin -30 30"]
