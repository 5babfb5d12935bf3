"""State record of one ATmega328P, declared once for Python (`Avr`) and C (`struct avr`).

The record holds no pointer, so a copy of its bytes is a snapshot of the whole microcontroller. Times are CPU cycles
since power-on; a time of NEVER means that the event is not scheduled.
"""

from __future__ import annotations

import ctypes
from typing import Final

NEVER: Final = (1 << 64) - 1
FLASH_BYTES: Final = 0x8000
DATA_BYTES: Final = 0x900
RAM_START: Final = 0x100
EEPROM_BYTES: Final = 0x400
PAGE_BYTES: Final = 128
LOG_ROOM: Final = 512
INPUT_ROOM: Final = 256
TIMERS: Final = 3
ANALOG_CHANNELS: Final = 11
"""ADC0 to ADC7, the temperature sensor, AIN0 and AIN1."""
EVENTS: Final = ("INPUT", "TIMER0", "TIMER1", "TIMER2", "ADC_SAMPLE", "ADC_DONE", "UART_SENT", "EEPROM_DONE",
                 "FLASH_DONE", "WATCHDOG")  # fmt: skip
"""Events in the order in which those of one cycle are applied."""

_U8, _U16, _U32, _U64 = "u8", "u16", "u32", "u64"
FIELDS: Final[tuple[tuple[str, str, int], ...]] = (
    # time and CPU
    ("cycle", _U64, 1),
    ("until", _U64, 1),  # end of the current call of avr_run
    ("deadline", _U64, 1),  # the interpreter leaves its loop at this cycle
    ("next_due", _U64, 1),
    ("due", _U64, len(EVENTS)),
    ("sleep_from", _U64, 1),  # cycle at which the I/O clock stopped; NEVER: it runs
    ("halted_at", _U64, 1),  # cycle at which nothing could wake the CPU any more
    ("slept", _U64, 1),  # cycles that the CPU was asleep
    ("stalled_until", _U64, 1),  # cycle up to which the CPU wakes up, or waits for the flash; 0: neither
    ("skipped", _U64, 1),  # cycles of waiting loops that were not executed one by one
    ("pc", _U16, 1),  # word address
    ("fault", _U16, 1),  # kind of fault, 0: none
    ("fault_pc", _U16, 1),  # word address of the instruction that faulted
    ("fault_address", _U16, 1),
    ("asleep", _U8, 1),  # 0: awake, otherwise sleep mode plus 1
    ("resting", _U8, 1),  # 1: the CPU does nothing before the next event
    ("counts_until", _U64, 1),  # a countdown ends at this cycle, if no event ends it before
    ("touched", _U8, 1),  # 1: an access in this round depends on time or changes a device
    ("tracing", _U8, 1),  # 1: the interpreter looks for a round that repeats
    ("round", _U32, 1),  # cycles after which the whole state repeats until the next event; 0: unknown
    ("trace_pc", _U16, 1),
    ("trace_from", _U64, 1),
    ("trace_window", _U32, 1),
    ("trace_end", _U64, 1),  # cycle at which the window is over
    ("trace_failures", _U8, 1),
    ("trace_after", _U64, 1),  # executed cycles before which no new search begins
    ("trace_data", _U8, DATA_BYTES),  # data memory at trace_from
    ("shadow", _U8, 1),  # 1: one instruction runs before the next interrupt
    ("halted", _U8, 1),  # 1: nothing can wake the CPU
    ("started", _U8, 1),  # 1: the program has started since the last reset
    ("data_end", _U16, 1),  # last address of the program's variables, 0: unknown
    ("stack_low", _U16, 1),  # lowest address that the first stack has reached since the reset
    ("overflow_at", _U64, 1),  # cycle at which the first stack reached data_end, 0: never
    ("overflow_pc", _U16, 1),
    ("must_reset", _U8, 1),  # 1: the watchdog resets the microcontroller before the next instruction
    ("looping", _U8, 1),  # cycles of a jump to itself that was just executed, else 0
    ("program_changed", _U8, 1),  # 1: flash was written and must be decoded again
    ("unmodelled", _U8, 1),  # data address of the last access to a register without model, 0: none
    ("boot_start", _U16, 1),  # word address of the boot section (fuses)
    ("starts_in_boot", _U8, 1),  # 1: reset starts in the boot section (fuse)
    ("resets", _U32, 1),
    ("interrupts", _U32, 1),  # entries of interrupts since power-on
    # inputs from the board, in order of time
    ("input_first", _U16, 1),
    ("input_count", _U16, 1),
    ("input_cycle", _U64, INPUT_ROOM),
    ("input_kind", _U8, INPUT_ROOM),
    ("input_value", _U32, INPUT_ROOM),
    ("pin_level", _U8, 3),  # levels that the board drives
    ("pin_driven", _U8, 3),  # pins that the board drives; others float or are pulled up
    ("analog_uv", _U32, ANALOG_CHANNELS),
    ("aref_uv", _U32, 1),
    ("avcc_uv", _U32, 1),
    ("noise_uv", _U32, ANALOG_CHANNELS),  # peak-to-peak noise of each channel
    ("random", _U32, 1),
    # outputs for the board: changes of watched registers
    ("watched", _U8, 256),
    ("emitters", _U8, 1),  # pins of port B whose light ends a run
    ("lit", _U8, 1),  # emitters that are on
    ("light_changed", _U8, 1),  # 1: light went on or off at light_cycle
    ("light_cycle", _U64, 1),
    ("log_count", _U32, 1),
    ("log_cycle", _U64, LOG_ROOM),
    ("log_register", _U8, LOG_ROOM),
    ("log_value", _U8, LOG_ROOM),
    # ports
    ("pin_before", _U8, 3),  # levels before the last change, which the synchroniser still shows
    ("pin_now", _U8, 3),
    ("pin_changed", _U64, 3),
    # timers
    ("prescaler_start", _U64, 2),  # cycle of the last reset of the prescaler: of T0 and T1, of T2
    ("timer_at", _U64, TIMERS),  # cycle for which the count is valid
    ("timer_position", _U32, TIMERS),  # phase within the period
    ("timer_turn", _U16, TIMERS),  # count at which a dual-slope timer turned; 0: it counts up
    ("timer_compare", _U16, TIMERS * 2),  # active compare values; in PWM modes a written value waits in timer_buffer
    ("timer_buffer", _U16, TIMERS * 2),
    ("timer_capture", _U16, 1),
    ("timer_temp", _U8, 1),
    ("timer_blocked", _U8, TIMERS),  # 1: a write of the count suppresses the match of the next tick
    # analog comparator
    ("comparator_out", _U8, 1),
    # converter
    ("adc_clock_start", _U64, 1),
    ("adc_channel", _U8, 1),  # ADMUX of the running conversion
    ("adc_value", _U16, 1),
    ("adc_locked", _U8, 1),  # 1: ADCL was read, the result is held until ADCH is read
    ("adc_warm", _U8, 1),  # 1: the first conversion after switching on is over
    # UART
    ("uart_shifting", _U8, 1),
    ("uart_shift", _U8, 1),
    ("uart_next", _U8, 1),
    ("uart_has_next", _U8, 1),
    ("uart_fifo", _U8, 2),
    ("uart_fifo_count", _U8, 1),
    # EEPROM, flash, watchdog
    ("eeprom_window", _U64, 1),  # cycle at which EEMPE falls
    ("spm_window", _U64, 1),
    ("spm_page", _U16, 1),
    ("spm_latched", _U8, PAGE_BYTES),
    ("watchdog_window", _U64, 1),
    ("clock_window", _U64, 1),
    ("vector_window", _U64, 1),
    # memories
    ("page", _U8, PAGE_BYTES),
    ("data", _U8, DATA_BYTES),
    ("eeprom", _U8, EEPROM_BYTES),
    ("flash", _U8, FLASH_BYTES),
)
"""Fields of the record: name, type, number of elements."""
BOOKKEEPING: Final = (
    "until", "deadline", "skipped", "resting", "counts_until", "touched", "tracing", "round", "trace_pc", "trace_from",
    "trace_window", "trace_end", "trace_failures", "trace_after", "trace_data", "looping", "watched", "light_changed",
    "light_cycle", "log_count", "log_cycle", "log_register", "log_value",
)  # fmt: skip
"""Fields that depend on the calls in which a machine ran, and do not affect what it does."""

_TYPES: Final = {_U8: ctypes.c_uint8, _U16: ctypes.c_uint16, _U32: ctypes.c_uint32, _U64: ctypes.c_uint64}


class Avr(ctypes.Structure):
    """The state record (`struct avr`). Fields are those of FIELDS."""

    _fields_ = [(name, _TYPES[kind] if count == 1 else _TYPES[kind] * count) for name, kind, count in FIELDS]
    cycle: int
    pc: int
    fault: int
    fault_pc: int
    fault_address: int
    halted: int
    halted_at: int
    asleep: int
    log_count: int
    input_first: int
    input_count: int
    resets: int
    data_end: int
    overflow_at: int
    overflow_pc: int
    program_changed: int
    slept: int
    stalled_until: int
    boot_start: int
    avcc_uv: int
    aref_uv: int
    random: int
    emitters: int
    lit: int
    unmodelled: int
    light_changed: int
    skipped: int
    tracing: int
    round: int
    counts_until: int
    resting: int
    data: ctypes.Array[ctypes.c_uint8]
    flash: ctypes.Array[ctypes.c_uint8]
    eeprom: ctypes.Array[ctypes.c_uint8]


class Decoded(ctypes.Structure):
    """One decoded instruction (`struct insn`)."""

    _fields_ = [("op", ctypes.c_uint8), ("words", ctypes.c_uint8), ("d", ctypes.c_uint8), ("r", ctypes.c_uint8),
                ("k", ctypes.c_uint16), ("word", ctypes.c_uint16)]  # fmt: skip


PROGRAM_ENTRIES: Final = FLASH_BYTES // 2 + 3
"""Entries of a decoded program: one per word, two behind the end of flash, which fault, and one for address 0."""
RESTARTED: Final = 0
"""Watched "register" whose change is a jump to address 0, which starts the program again without a reset."""


def declaration() -> str:
    """Return the C text of the record, its sizes and its events."""
    sizes = {"FLASH_BYTES": FLASH_BYTES, "DATA_BYTES": DATA_BYTES, "RAM_START": RAM_START,
             "EEPROM_BYTES": EEPROM_BYTES, "PAGE_BYTES": PAGE_BYTES, "LOG_ROOM": LOG_ROOM, "INPUT_ROOM": INPUT_ROOM,
             "TIMERS": TIMERS, "RESTARTED": RESTARTED}  # fmt: skip
    lines = [f"enum {{ {', '.join(f'{name} = {value}' for name, value in sizes.items())} }};"]
    lines.append(f"enum {{ {', '.join(f'EVENT_{name}' for name in EVENTS)}, EVENTS }};")
    members = (f"    {kind} {name}{'' if count == 1 else f'[{count}]'};" for name, kind, count in FIELDS)
    lines += ["struct avr {", *members, "};"]
    lines += ["struct insn {", "    u8 op, words, d, r;", "    u16 k, word;", "};"]
    return "\n".join(lines)
