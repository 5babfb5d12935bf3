"""The SPI module on the emulated bus (firmware/apps/spi, io/spi/spi.h)."""

from __future__ import annotations

from pathlib import Path

import pytest

from emu import Machine
from tests.firmware.conftest import Build
from tests.firmware.drivers.test_drivers_on_target import robot

FCY = 14_745_600
RG9 = 1 << 9
MEASUREMENT = 12_345
ARGUMENT = 5


class Turret:
    """SPI slave that answers command 1 with a measurement and a check byte, and records the bytes while selected."""

    def __init__(self, machine: Machine, damage: int = 0) -> None:
        self.machine = machine
        self.damage = damage
        self.heard: list[int] = []
        self.unselected = 0
        machine.peripherals.spi[2].exchange = self.exchange
        self.said = bytearray()
        machine.uart[1].on_byte = lambda byte, _cycle: self.said.append(byte)

    def exchange(self, word: int, bits: int) -> int:
        assert bits == 8
        self.unselected += bool(self.machine.peek("LATG") & RG9)
        answer = [1, MEASUREMENT >> 8, MEASUREMENT & 0xFF]
        answer.append(-sum(answer) - self.damage & 0xFF)
        self.heard.append(word)
        return answer[(len(self.heard) - 1) % 4]

    def lines(self, cycles: int) -> list[str]:
        """Run and return the whole lines that UART1 sends in that time."""
        self.said.clear()
        self.machine.run(cycles=cycles)
        return self.said.decode().split("\r\n")[:-1]


@pytest.fixture
def path(image: Build) -> Path:
    return image("spi")


@pytest.mark.slow
def test_bytes_go_both_ways_while_the_slave_is_selected(path: Path) -> None:
    turret = Turret(robot(path))
    assert turret.lines(FCY // 2) == [str(MEASUREMENT)] * 5
    assert turret.heard == [1, 0, 0, 0] * 5
    assert turret.unselected == 0
    assert turret.machine.peek("LATG") & RG9, "let go between transfers"


@pytest.mark.slow
def test_the_processor_is_exchanged_while_the_program_runs(path: Path) -> None:
    """The SPI processor receives sent and received bytes and may refuse the received ones; it is exchanged at run
    time."""
    turret = Turret(robot(path), damage=1)
    assert turret.lines(FCY // 4) == [str(MEASUREMENT)] * 3
    for letter, says, last in ((b"c", f"error {ARGUMENT}", 0xFF), (b"r", str(MEASUREMENT), 0)) * 2:
        turret.machine.uart[1].feed(letter)
        turret.lines(FCY // 20)
        turret.heard.clear()
        assert turret.lines(FCY // 5) == [says] * 2
        assert turret.heard == [1, 0, 0, last] * 2
    turret.machine.uart[1].feed(b"c")
    turret.damage = 0
    assert turret.lines(FCY // 2)[1:] == [str(MEASUREMENT)] * 4


@pytest.mark.slow
def test_every_size_and_the_bounds(image: Build, tmp_path: Path) -> None:
    """Transfers of 1 to 1,024 bytes work in place, without output or without input; larger ones are refused."""
    app = tmp_path / "sizes"
    app.mkdir()
    (app / "app.mk").write_text("DEVICES := spi\n")
    (app / "main.c").write_text("""#include <openswarm.h>
#include <spi.h>
volatile uint16 wrong __attribute__((used)), done __attribute__((used));
static uint8 bytes[1024];
static void work(void *unused)
{
    static const uint16 sizes[] = {1, 2, 3, 33, 34, 255, 256, 1024};
    (void)unused;
    for (uint16 i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        for (uint16 k = 0; k < sizes[i]; k++) {
            bytes[k] = (uint8)(k * 5);
        }
        wrong += !Sys_SPI_Transfer(bytes, bytes, sizes[i]);
        for (uint16 k = 0; k < sizes[i]; k++) {
            wrong += bytes[k] != (uint8)~(k * 5);
        }
        wrong += !Sys_SPI_Transfer(NULL, bytes, sizes[i]);
        wrong += bytes[0] != 0xFF || bytes[sizes[i] - 1] != 0xFF;
        wrong += !Sys_SPI_Transfer(bytes, NULL, sizes[i]);
    }
    wrong += Sys_SPI_Transfer(bytes, bytes, 0) || Sys_Get_LastError() != SYS_ERROR_ARGUMENT;
    wrong += Sys_SPI_Transfer(bytes, bytes, 1025) || Sys_Get_LastError() != SYS_ERROR_ARGUMENT;
    Sys_Start_CriticalSection();
    wrong += Sys_SPI_Transfer(bytes, bytes, 1) || Sys_Get_LastError() != SYS_ERROR_CONTEXT;
    Sys_End_CriticalSection();
    done = 1;
}
int main(void)
{
    static const sys_process_config config = {work, NULL, 200, 0, 0, 0, 0};
    Sys_Init_Kernel();
    Sys_Start_SPI();
    SYS_ASSERT(Sys_Start_ProcessWith(&config) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
""")
    machine = robot(image("sizes", tmp_path))
    machine.peripherals.spi[2].exchange = lambda word, _bits: ~word & 0xFF
    machine.run(cycles=FCY)
    assert machine.peek("done") == 1
    assert machine.peek("wrong") == 0
