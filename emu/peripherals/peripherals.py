"""All peripherals of a chip, connected to each other. The machine builds and resets them and stops their clocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from emu.chips.chip import Chip
from emu.peripherals.adc.adc import Adc
from emu.peripherals.base import IDLE, SLEEP, ChipContext, CpuSignals, Peripheral, StateCell
from emu.peripherals.can.can import Can
from emu.peripherals.i2c.i2c import I2c
from emu.peripherals.interrupt_lines import Interrupts
from emu.peripherals.motor.pwm import Pwm
from emu.peripherals.motor.qei import Qei
from emu.peripherals.pins import PORTS, Pins
from emu.peripherals.ports.ports import ChangeNotice, ExternalInterrupts, Port
from emu.peripherals.spi.dci import Dci
from emu.peripherals.spi.spi import Spi
from emu.peripherals.system.low_voltage import LowVoltageDetect
from emu.peripherals.system.module_disable import ModuleDisable
from emu.peripherals.system.nvm import Nvm
from emu.peripherals.system.oscillator import Oscillator
from emu.peripherals.system.resets import Resets, Watchdog
from emu.peripherals.timers.input_capture import Capture
from emu.peripherals.timers.output_compare import Compare
from emu.peripherals.timers.timers import timers
from emu.peripherals.uart.uart import Uart
from emu.system.bus import Bus
from emu.system.program import ProgramMemory

CRYSTAL_HZ: Final = 7_372_800
"""Default crystal frequency of a bare chip in Hz, from which UARTs derive exact baud rates."""
CONFIG: Final[Mapping[str, int]] = MappingProxyType({"FWDT": 0x7FFF})
"""Default configuration words of a bare chip, for images without any: watchdog off.

An erased word enables the watchdog, which would wake a sleeping program forever.
"""

_CHANGE_NOTICE_IRQ: Final = "CN"


class Peripherals:
    """All devices of a chip. Devices constructed earlier have priority if events are due in the same cycle."""

    def __init__(self, context: ChipContext) -> None:
        self.context: Final = context
        chip = context.chip
        numbers = {source.name: irq for irq, source in chip.interrupts.items()}
        self.pins: Final = context.pins
        self.interrupts: Final = Interrupts(context)
        self.oscillator: Final = Oscillator(context)
        self.resets: Final = Resets(context)
        self.watchdog: Final = Watchdog(context, self.resets)
        self.lvd: Final = (
            LowVoltageDetect(context, self.interrupts, self.resets.rcon, chip.lvd_irq)
            if chip.lvd_irq is not None
            else None
        )
        self.nvm: Final = Nvm(context, self.interrupts)
        self.ports: Final = {PORTS.index(letter): Port(letter, context) for letter in chip.ports}
        self.change_notice: Final = ChangeNotice(context, numbers[_CHANGE_NOTICE_IRQ])
        self.external: Final = ExternalInterrupts(context, self.interrupts)
        self.timer: Final = timers(context)
        self.uart: Final = {site.number: Uart(site, context, self.interrupts, self.ports) for site in chip.uarts}
        self.adc: Final = Adc(chip.adc, context, self.interrupts, self.timer)
        self.external.on_int0 = self.adc.int0
        self.oscillator.before_change.append(self.adc.clock_changes)
        self.oscillator.on_change.extend((self.adc.clock_changed, self.nvm.clock_changed))
        self.spi: Final = {site.number: Spi(site, context, self.interrupts, self.ports) for site in chip.spis}
        self.capture: Final = {
            site.number: Capture(site, context, self.interrupts, self.timer) for site in chip.captures
        }
        self.compare: Final = {
            site.number: Compare(site, context, self.interrupts, self.timer, self.ports) for site in chip.compares
        }
        self.i2c: Final = I2c(chip.i2c, context, self.interrupts, self.ports) if chip.i2c is not None else None
        self.dci: Final = Dci(chip.dci, context, self.interrupts, self.ports) if chip.dci is not None else None
        self.pwm: Final = Pwm(chip.pwm, context, self.interrupts, self.ports) if chip.pwm is not None else None
        self.qei: Final = Qei(chip.qei, context, self.interrupts) if chip.qei is not None else None
        if self.pwm is not None:
            self.pwm.on_special = self.adc.special_event
        self.can: Final = {site.number: Can(site, context, self.interrupts, self.ports) for site in chip.cans}
        for uart in self.uart.values():
            if uart.site.autobaud_capture in self.capture:
                uart.connect_capture(self.capture[uart.site.autobaud_capture])
        self.pmd: Final = ModuleDisable(context, self._modules())
        parts: tuple[Peripheral | None, ...] = (
            self.oscillator,
            self.resets,
            self.watchdog,
            self.lvd,
            self.nvm,
            *self.ports.values(),
            self.change_notice,
            self.external,
            *self.timer.values(),
            *self.uart.values(),
            self.adc,
            *self.spi.values(),
            *self.capture.values(),
            *self.compare.values(),
            self.i2c,
            self.dci,
            *self.can.values(),
            self.pwm,
            self.qei,
            self.pmd,
        )
        self.all: Final[tuple[Peripheral, ...]] = tuple(part for part in parts if part is not None)
        self._stopped: Final = StateCell(context.bus.record, "power.stopped", "B")
        self.config: Mapping[int, int] = {}
        """Configuration words by program address, used if the image contains none."""
        self.configure(crystal=context.crystal)
        self.on_restored: Final[list[Callable[[], None]]] = []
        """Callbacks of board parts, to rebuild state derived from the record."""
        self.on_synchronize: Final[list[Callable[[], None]]] = []
        """Callbacks of board parts that process pin changes lazily."""

    def _modules(self) -> dict[str, Peripheral]:
        """Return the peripherals by the name of their PMD bit."""
        modules: dict[str, Peripheral] = {"ADC": self.adc}
        optional = (("DCI", self.dci), ("I2C", self.i2c), ("PWM", self.pwm), ("QEI", self.qei))
        modules |= {name: device for name, device in optional if device is not None}
        modules |= {f"T{number}": timer for number, timer in self.timer.items()}
        modules |= {f"SPI{number}": spi for number, spi in self.spi.items()}
        modules |= {f"C{number}": can for number, can in self.can.items()}
        modules |= {f"IC{number}": capture for number, capture in self.capture.items()}
        modules |= {f"OC{number}": compare for number, compare in self.compare.items()}
        modules |= {f"U{number}": uart for number, uart in self.uart.items()}
        return modules

    def configure(self, *, crystal: int, config: Mapping[str, int] = CONFIG) -> None:
        """Set the crystal frequency in Hz and the default configuration words by name. Boards call this.

        Call it before the first reset. Raises KeyError for a word that the chip does not have.
        """
        self.context.crystal = crystal
        self.config = {self.context.chip.config[name].address: word for name, word in config.items()}

    def reset(self, cause: str) -> None:
        """Reset all peripheral registers and devices, and record the cause in RCON.

        `cause` is an RCON bit name: POR, BOR, EXTR, SWR, WDTO, TRAPR or IOPUWR (§4). The CPU resets its own registers
        (below INTCON1). Raises ValueError for another cause.
        """
        bus = self.context.bus
        first = self.context.chip.sfrs["INTCON1"].address >> 1
        kept = self.resets.rcon.value
        osccon = self.oscillator.con.value
        for word in range(first, len(bus.reset_value)):
            bus.record.u16[word] = bus.reset_value[word]
        self.resets.record_cause(cause, kept)
        if cause not in ("POR", "BOR"):  # other resets keep the clock selection (§4)
            self.oscillator.con.value = osccon
        self._stopped.value = 0
        for device in self.all:
            device.power_up(power_on=cause == "POR")
        if cause == "BOR":
            self.oscillator.reselect()

    def sleep(self, mode: int, cycle: int) -> None:
        """Handle PWRSAV in `cycle`: `mode` 1 = Idle, 2 = Sleep. Set RCON, restart the watchdog, stop clocks (§17)."""
        if mode == IDLE and self.context.bus.integers.fire(self.watchdog.idling):
            return
        self.watchdog.clear(cycle)
        self.watchdog.power_mode(mode)
        if mode == IDLE and not self.watchdog.stops_devices:
            return
        self._stopped.value = 1
        if mode == SLEEP:
            self.oscillator.abandon_switch()
        for device in self.all:
            if device.stops_in(mode):
                device.freeze(cycle, mode)

    def wake(self, cycle: int) -> None:
        """Handle the CPU's wake-up. `cycle` is the first in which the stopped clocks run again."""
        self.watchdog.power_mode(0)
        if not self._stopped.value:
            return
        self._stopped.value = 0
        for device in self.all:
            if device.is_frozen:
                device.thaw(cycle)

    def clear_watchdog(self, cycle: int) -> None:
        """Handle CLRWDT in `cycle`."""
        self.watchdog.clear(cycle)

    def deliver_uart_output(self) -> None:
        """Call the UARTs' lazy listeners for the characters that native code has sent."""
        for uart in self.uart.values():
            uart.deliver_sent()

    def synchronize(self) -> None:
        """Bring all lazily computed state to the present, so that the record does not depend on earlier reads.

        Conversions whose inputs come later stay as they are: only the program waits for those.
        """
        if not self.adc.inputs_come_later:
            self.adc.synchronize()
        for port in range(len(PORTS)):
            self.pins.invalidate(port)
        for listener in self.on_synchronize:
            listener()

    def restored(self) -> None:
        """Rebuild derived state after the record was replaced by a snapshot."""
        for device in self.all:
            device.restored()
        for listener in self.on_restored:
            listener()

    def seconds(self, cycle: int) -> float:
        """Return the seconds from power-on to `cycle`."""
        return self.oscillator.seconds(cycle)

    @property
    def fcy(self) -> float:
        """Instruction cycles per second at the current clock."""
        return self.oscillator.fcy()


def configure_bus(chip: Chip, bus: Bus) -> None:
    """Copy the implemented bits, writable bits and reset value of every register to the bus."""
    for sfr in chip.sfrs.values():
        if sfr.size != 2:
            continue
        word = sfr.address >> 1
        bus.name[word] = sfr.name
        bus.writable[word] = sfr.writable
        bus.clear_only[word] = sfr.clear_only
        bus.reset_value[word] = sfr.reset


def build(
    chip: Chip, bus: Bus, program: ProgramMemory, cpu_signals: CpuSignals | None = None, crystal: int = CRYSTAL_HZ
) -> Peripherals:
    """Configure the bus from the chip's data and construct all devices on it. `crystal` in Hz.

    The caller keeps `cpu_signals` and may fill in its callbacks later. Call `reset("POR")` once before the first cycle.
    """
    configure_bus(chip, bus)
    pins = Pins(bus.record, bus.events)
    return Peripherals(ChipContext(chip, bus, pins, program, cpu_signals or CpuSignals(), crystal))
