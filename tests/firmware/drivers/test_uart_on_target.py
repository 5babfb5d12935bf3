"""Dynamically buffered UART transmission on the emulated robot (openswarm_io.h, io/README.md)."""

from __future__ import annotations

from pathlib import Path

import pytest

from emu import Machine
from tests.cases import check_all
from tests.firmware.conftest import Build
from tests.firmware.kernel.test_kernel_on_target import FCY, load

TX = 1024
"""Bytes of the transmit limit SYS_UART_TX: a third of the heap."""
E, LARGEST = 6, 33
"""Overhead of a message in bytes, and largest message in bytes that fits one block (SYS_SMALL_PAYLOAD - 1)."""

SOURCE = """#include <openswarm.h>
#include <openswarm_io.h>
static uint8 text[1100];
volatile uint16 size __attribute__((used)), go __attribute__((used)), taken __attribute__((used));
volatile uint16 accepted __attribute__((used)), error __attribute__((used)), ready __attribute__((used));
volatile uint16 room __attribute__((used));
static bool on_ready(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    room = data->value;
    ready++;
    return true;
}
static void writer(void)
{
    for (uint16 i = 0; i < sizeof text; i++) {
        text[i] = (uint8)(i % 251);
    }
    for (;;) {
        if (go != 0) {
            uint16 before = Sys_Get_Statistics()->heap_used;
            go--;
            bool done = Sys_Write_UART1(text, size);
            accepted += done;
            error = done ? 0 : Sys_Get_LastError();
            taken = (uint16)(Sys_Get_Statistics()->heap_used - before);
        }
        Sys_Yield();
    }
}
int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Subscribe_to_Event(SYS_UART1_READY, 0, on_ready, NULL));
    SYS_ASSERT(Sys_Start_Process(writer) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
"""
BUSY, ARGUMENT = 6, 5


@pytest.fixture(scope="module")
def path(image: Build, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("apps")
    (folder / "writer").mkdir()
    (folder / "writer" / "main.c").write_text(SOURCE)
    return image("writer", folder)


def text(size: int) -> bytes:
    return bytes(i % 251 for i in range(size))


def bytes_of_heap(size: int) -> int:
    """Return the heap bytes that a message occupies while it waits for its UART (io/README.md)."""
    blocks = [LARGEST] * (size // LARGEST) + [size % LARGEST] * bool(size % LARGEST)
    return sum((E + 1 + block + 1) // 2 * 2 for block in blocks)


def started(path: Path) -> tuple[Machine, bytearray]:
    machine = load(path)
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _cycle: said.append(byte)
    machine.run(cycles=FCY // 50)
    return machine, said


@pytest.mark.slow
def test_a_message_of_any_size_goes_out_whole_and_takes_what_is_said(path: Path) -> None:
    """A message of 65 bytes is sent completely; a fixed buffer of 64 bytes would always refuse it."""
    machine, said = started(path)
    used = machine.peek("os_statistics")

    def check(size: int) -> None:
        said.clear()
        machine.poke("accepted", 0)
        machine.poke("size", size)
        machine.poke("go", 1)
        machine.run(cycles=FCY // 100)
        assert (machine.peek("accepted"), machine.peek("error")) == (1, 0)
        assert machine.peek("taken") == bytes_of_heap(size)
        machine.run(cycles=FCY * (size + 40) // 11_520)
        assert bytes(said) == text(size)
        assert machine.peek("os_statistics") == used, "all of it is given back"

    check_all(check, [1, 2, 32, 33, 34, 64, 65, 66, 67, 100, 500, 800])


def test_busy_is_followed_by_ready_and_then_there_is_room(path: Path) -> None:
    machine, said = started(path)
    machine.poke("size", 65)
    machine.poke("go", 40)
    machine.run(cycles=FCY // 100)
    fit = TX // bytes_of_heap(65)
    assert machine.peek("error") == BUSY
    assert machine.peek("accepted") >= fit
    assert machine.peek("ready") == 0
    machine.poke("go", 0)
    count = machine.peek("accepted")
    machine.run(cycles=FCY // 5)
    assert bytes(said) == text(65) * count
    assert (machine.peek("ready"), machine.peek("room")) == (1, TX)
    machine.poke("go", 1)
    machine.run(cycles=FCY // 50)
    assert (machine.peek("accepted"), machine.peek("ready")) == (count + 1, 1)


def test_what_can_never_fit_is_an_argument_error(path: Path) -> None:
    machine, said = started(path)
    largest = max(size for size in range(1100) if bytes_of_heap(size) <= TX)
    for size, error in ((largest, 0), (largest + 1, ARGUMENT)):
        machine.poke("size", size)
        machine.poke("go", 1)
        machine.run(cycles=FCY // 5)
        assert machine.peek("error") == error, size
    assert bytes(said) == text(largest)
    assert machine.peek("ready") == 0
