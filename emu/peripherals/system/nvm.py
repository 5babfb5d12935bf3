"""Run-time programming of flash and EEPROM (§16): NVMCON, NVMADR, NVMADRU, NVMKEY.

When an operation starts, it reads the row address and the write latches. When it ends, 2 ms later, it changes the
memory. Flash operations stall the CPU for that time; EEPROM operations do not. A reset during an operation sets WRERR
and leaves the row erased but not programmed (§16).
"""

from __future__ import annotations

from typing import Final

from emu.peripherals.base import ChipContext, Peripheral
from emu.peripherals.interrupt_lines import Interrupts
from emu.system.program import EEPROM_LATCHES, ERASED_HALF, ERASED_WORD, FLASH_LATCHES

BUSY_SECONDS: Final = 2e-3
"""Typical duration of every operation in s (§16)."""
_KEY: Final = (0x55, 0xAA)
_WINDOW: Final = 3
"""Maximum Tcy between two steps of the key sequence.

UNVERIFIED: other instructions may be between the steps within this limit. The manual requires consecutive instructions,
with at most a literal load between the two keys. An interrupt takes longer than the limit, so it breaks the sequence as
on silicon (§16).
"""

ERASE_FLASH_ROW, PROGRAM_FLASH_ROW = 0x41, 0x01
ERASE_WORD, ERASE_ROW, ERASE_ALL = 0x44, 0x45, 0x46
PROGRAM_WORD, PROGRAM_ROW = 0x04, 0x05
WRITE_CONFIG: Final = 0x08
"""PROGOP codes of the operations (§16)."""
_ERASING: Final = 0x40
"""PROGOP bit that is set in all erase operations."""
_FLASH: Final = (ERASE_FLASH_ROW, PROGRAM_FLASH_ROW)
_EEPROM: Final = (ERASE_WORD, ERASE_ROW, ERASE_ALL, PROGRAM_WORD, PROGRAM_ROW)


class Nvm(Peripheral):
    """State machine of flash and EEPROM programming."""

    def __init__(self, context: ChipContext, interrupts: Interrupts) -> None:
        super().__init__("nvm", context)
        self._line: Final = interrupts.line(context.chip.nvm_irq)
        self.con: Final = self.register("NVMCON")
        self.adr: Final = self.register("NVMADR")
        self.adru: Final = self.register("NVMADRU")
        self.key: Final = self.register("NVMKEY")
        self.con.written_by(self._con_written)
        self.key.written_by(self._key_written)
        self.key.computed(lambda: 0)
        self._stage: Final = self.cell("stage", "B")
        self._stage_cycle: Final = self.cell("stage_cycle", "Q")
        self._operation: Final = self.cell("operation", "H")
        self._address: Final = self.cell("address", "I")
        self._data: Final = self.array("data", "I", FLASH_LATCHES)
        self._done: Final = self.slot("done", self._finish, in_seconds=True)
        self._wr, self._wren = (1 << context.chip.sfrs["NVMCON"].fields[name][0] for name in ("WR", "WREN"))
        context.program.captured_in = self.adr.address, self.adru.address

    def stops_in(self, mode: int) -> bool:
        """Return False: the memory array times the operation itself."""
        return False

    def reset(self, power_on: bool) -> None:
        """Reset: abort a running operation and set WRERR (§16)."""
        if self._operation.value and not power_on:
            if not self._operation.value & _ERASING:
                self._operation.value = 0
            else:
                self._apply()  # a partly erased row then reads as erased
            self.con["WRERR"] = 1
        self._operation.value = 0
        self._stage.value = 0
        self.context.program.clear_latches()

    @property
    def is_busy(self) -> bool:
        """Whether an operation is running."""
        return bool(self.con["WR"])

    def _key_written(self, _old: int, new: int, _lanes: int) -> None:
        self.key.value = 0
        stage = self._stage.value if self.now - self._stage_cycle.value <= _WINDOW else 0
        expected = _KEY[stage] if stage < len(_KEY) else None
        self._stage.value = stage + 1 if new & 0xFF == expected else 0
        self._stage_cycle.value = self.now

    def _con_written(self, old: int, new: int, _lanes: int) -> None:
        if old & self._wr:  # software cannot end an operation early
            self.con.value = old | self._wr
            return
        unlocked = self._stage.value == len(_KEY) and self.now - self._stage_cycle.value <= _WINDOW
        self._stage.value = 0
        if not new & self._wr:
            return
        operation = new & 0x7F
        if not (unlocked and new & self._wren and operation in (*_FLASH, *_EEPROM, WRITE_CONFIG)):
            self.con.value = new & ~self._wr
            return
        self._begin(operation)

    def _begin(self, operation: int) -> None:
        program = self.context.program
        self._operation.value = operation
        self._address.value = self.adru.value << 16 | self.adr.value
        latches = program.eeprom_latch if operation in _EEPROM else program.flash_latch
        for index, word in enumerate(latches):
            self._data[index] = word
        end = self.now + 1 + round(BUSY_SECONDS * self.context.fcy())
        self.events.set(self._done, end)
        if operation in _FLASH:
            self.context.cpu_signals.stall_until(end)

    def clock_changed(self) -> None:
        """Adjust the CPU stall of a flash operation to the operation's rescheduled end."""
        if self.is_busy and self._operation.value in _FLASH:
            self.context.cpu_signals.stall_until(self.events.due(self._done))

    def _finish(self, _due: int) -> None:
        self._apply()
        self.con["WR"] = 0
        self._line.request()

    def _apply(self) -> None:
        operation = self._operation.value
        self._operation.value = 0
        address = self._address.value
        if operation in _FLASH:
            self._apply_flash(operation, address & ~(2 * FLASH_LATCHES - 1))
        elif operation in _EEPROM:
            self._apply_eeprom(operation, address)
        elif address in self.context.chip.program["config"]:
            self.context.program.put(address & ~1, self._data[address >> 1 & FLASH_LATCHES - 1])
        if not operation & _ERASING:
            self.context.program.clear_latches()

    def _apply_flash(self, operation: int, row: int) -> None:
        """Erase or program a flash row. Rows outside flash are ignored. Programming can only clear bits (§16)."""
        program = self.context.program
        if row not in self.context.chip.program["flash"]:
            return
        words = [ERASED_WORD] * FLASH_LATCHES
        if operation == PROGRAM_FLASH_ROW:
            words = [program.word(row + 2 * index) & self._data[index] for index in range(FLASH_LATCHES)]
        program.put_flash(row, words)

    def _apply_eeprom(self, operation: int, address: int) -> None:
        program = self.context.program
        region = self.context.chip.program["eedata"]
        if address not in region:
            return
        first, count = address & ~1, 1
        if operation in (ERASE_ROW, PROGRAM_ROW):
            first, count = address & ~(2 * EEPROM_LATCHES - 1), EEPROM_LATCHES
        elif operation == ERASE_ALL:
            first, count = region.start, region.size // 2
        for cell in range(first, first + 2 * count, 2):
            erasing = operation in (ERASE_WORD, ERASE_ROW, ERASE_ALL)
            latch = self._data[cell >> 1 & EEPROM_LATCHES - 1]
            program.put(cell, ERASED_HALF if erasing else program.word(cell) & latch)
