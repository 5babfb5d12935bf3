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


def heard(path: Path) -> tuple[emu.Machine, bytearray]:
    """Return a robot with an image, and a buffer that collects what the robot sends on UART1."""
    machine, said = load(path), bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)
    return machine, said


def test_hello_says_hello_every_second(image: Build) -> None:
    """`hello` prints its greeting once a second (firmware/apps/hello/README.md)."""
    machine, said = heard(image("hello"))
    machine.run(cycles=21 * FCY // 10)
    assert said.decode() == "hello, swarm\r\n" * 3


# ---- processors -----------------------------------------------------------------------------------------------------


def cobs(message: bytes) -> bytes:
    """Return a message as a COBS frame with CRC-16/CCITT-FALSE and end mark. The message has at most 252 bytes."""
    body = message + binascii.crc_hqx(message, 0xFFFF).to_bytes(2, "big")
    return b"".join(bytes([len(run) + 1]) + run for run in body.split(b"\0")) + b"\0"


def uncobs(frame: bytes) -> bytes:
    """Decode a COBS frame without its end mark and return the message. A damaged frame fails the test."""
    body = b""
    while frame:
        run, frame = frame[1 : frame[0]], frame[frame[0] :]
        body += run + (b"\0" if frame else b"")
    assert binascii.crc_hqx(body, 0xFFFF) == 0
    return body[:-2]


@pytest.mark.slow
def test_processors_are_swapped_under_traffic_without_loss(image: Build) -> None:
    """Exchange three processors while traffic runs: no message may be lost.

    The processors are the virtual actuator, the safety post-processor and the pair that adds and checks COBS frames
    with CRC-16, as in the paper.
    """
    machine, said = heard(image("processors"))
    machine.run(cycles=FCY // 4)
    assert said.decode().splitlines()[1:] == ["+085+115"] * 2  # v = 100 mm/s, omega = 0.6 rad/s, axle 53 mm
    machine.uart[1].feed(b"u")
    machine.run(cycles=FCY)
    assert said.decode().splitlines()[-1] == "+057+042"  # the pilot's next command, halved
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


@pytest.mark.slow
def test_stress_neither_leaks_nor_traps(image: Build) -> None:
    """`stress` runs without trap or leak: after every 200 actions it asserts that the heap is as before."""
    machine, said = heard(image("stress"))
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


# ---- Results of set-up calls ----------------------------------------------------------------------------------------

SETS_UP = re.compile(
    r"^\s*(?:\(void\))?(?:Sys_Subscribe_to_Event|Sys_Start_Process(?:With)?|Sys_Connect_Motors)\(", re.MULTILINE
)
"""Pattern of a statement that discards the result of subscribing, starting a thread or connecting the motors."""


@pytest.mark.parametrize("app", ["clustering", "hello", "processors", "selftest", "spi"])
def test_no_application_drops_the_result_of_a_call_that_sets_it_up(app: str) -> None:
    """Applications check the results of their set-up calls: a failed subscription leaves a robot without reaction.
    Listing 1 has the paper's text, which does not check them."""
    for source in (FIRMWARE / "apps" / app).glob("*.c"):
        assert not SETS_UP.findall(source.read_text()), source


def test_a_device_without_the_one_it_needs_is_refused() -> None:
    """`DEVICES=camera` without `i2c` is refused with the line to write, not with a missing header."""
    words = ["make", "-n", "-C", str(FIRMWARE), "APP=hello"]
    done = subprocess.run([*words, "DEVICES=camera"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "DEVICES=camera: the camera needs i2c, too: DEVICES := camera i2c" in done.stderr
    assert subprocess.run([*words, "DEVICES=camera i2c"], capture_output=True, check=False).returncode == 0


# ---- Faults ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_failed_assertion_is_a_firmware_fault(image: Build, tmp_path: Path, capfd) -> None:
    """A failed assertion is reported on UART1 with its source line, and `emu run` exits with status 1, however short
    the run is."""
    (tmp_path / "wrong").mkdir()
    (tmp_path / "wrong" / "main.c").write_text("""#include <openswarm.h>
int main(void) {
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Get_ProcessID() == 0);
    SYS_ASSERT(Sys_Get_ProcessID() == 7);
    return 0;
}
""")
    for seconds in ("1", "0.02"):
        assert main(["run", str(image("wrong", tmp_path)), "--seconds", seconds]) == 1
        said = capfd.readouterr()
        assert re.search(r"main\.c:5 in thread 0", said.out)
        assert "firmware fault: the kernel stopped the system" in said.err


# ---- Applications on a host ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("gcc") is None:
        pytest.skip("the POSIX port is built with gcc, which is not installed (Debian package gcc)")
    return tmp_path_factory.mktemp("host")


@pytest.mark.slow
@pytest.mark.parametrize("app", ["listing1", "processors", "stress", "footprint", "latency", "hello"])
def test_every_application_builds_for_a_host(host: Path, app: str) -> None:
    """Every application builds for Linux with the same kernel, without compiler warnings."""
    run_make(FIRMWARE, f"APP={app}", "TARGET=posix", f"OUT={host / app}")


@pytest.mark.slow
def test_listing1_runs_on_a_host_in_real_time(host: Path) -> None:
    """Listing 1 runs on Linux with preemption by signals and with sanitizers.

    Lines are printed however slow the host is.
    """
    flags = "HOST_FLAGS=-O1 -g -fsanitize=address,undefined -fno-sanitize-recover=undefined"
    run_make(FIRMWARE, "APP=listing1", "TARGET=posix", f"OUT={host / 'sanitized'}", flags)
    with subprocess.Popen([host / "sanitized" / "firmware"], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as program:
        assert program.stdout is not None
        lines = [program.stdout.readline() for _ in range(2)]
        program.kill()
    assert all(re.fullmatch(rb"\d+:\(0,0\)\r\n", line) for line in lines), lines


def test_sources_written_for_the_original_compile(host: Path) -> None:
    """Sources in the spelling of the original repository compile with openswarm_compat.h (openswarm-original.md
    §2.3)."""
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


def sines(*tones: tuple[int, int]) -> Callable[[int], float]:
    """Return a sum of sine waves, each given as (frequency in Hz, amplitude in counts)."""
    return lambda cycle: sum(a * math.sin(2 * math.pi * hz * cycle / FCY) for hz, a in tones)


@pytest.mark.slow
def test_tone_hears_what_its_filter_lets_through(image: Build) -> None:
    """`tone` measures 560 Hz nine times louder than 200 Hz, which its filter attenuates (cut-off 400 Hz).

    Source: firmware/apps/tone/README.md.
    """
    machine, said = heard(image("tone"))
    machine.run(seconds=0.2)
    machine.board.microphones.play(0, sines((200, 100), (560, 900)))
    machine.run(seconds=0.42)
    lines = said.decode().split()
    assert lines[0] == "silence"
    assert lines[-4:] == ["200", "Hz"] * 2


@pytest.mark.slow
def test_commands_are_read_with_sscanf(image: Build) -> None:
    """`commands` parses its text commands with sscanf and answers each (firmware/apps/commands/README.md)."""
    machine, said = heard(image("commands"))
    for line in ("speed 50, -30", "get speed", "sum 0x10 010", "speed 1", "get lost", "speed 1,2 3"):
        machine.uart[1].feed(line.encode() + b"\r\n")
        machine.run(seconds=0.05)
    assert said.decode().split() == ["ok", "50,-30", "24", "?", "?", "?"]


@pytest.mark.slow
def test_patrol_runs_its_behaviours_in_turn(image: Build) -> None:
    """`patrol`, a C++ application, runs its behaviours one after the other (firmware/apps/patrol/README.md)."""
    machine, said = heard(image("patrol"))
    machine.run(seconds=1.7)
    assert said.decode().splitlines() == ["1 straight 60 60", "2 spin 30 -30", "3 straight 60 60", "4 spin -30 30"]
