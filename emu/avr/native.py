"""The emulator's native code: one C file made of the state record, the instruction table, the core and the devices."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Final

from emu.avr.core.addresses import enumeration
from emu.avr.core.state import declaration
from emu.avr.isa.c_code import bodies, decoder, labels
from emu.native_library import ADDRESS, INT, functions_of

HERE: Final = Path(__file__).parent
PARTS: Final = ("core/avr.h", "devices/timers.c", "devices/analog.c", "devices/ports.c", "devices/uart.c",
                "devices/memories.c", "devices/system.c", "core/registers.c", "core/meanings.c", "core/boundary.c",
                "core/waiting.c", "core/interpreter.c", "core/set_up.c", "core/observed.c")  # fmt: skip
TYPES: Final = """#include <stdint.h>
typedef uint8_t u8;
typedef uint16_t u16;
typedef uint32_t u32;
typedef uint64_t u64;
typedef int8_t i8;
typedef int32_t i32;
typedef int64_t i64;
"""


def source() -> str:
    """Return the text of the C file."""
    parts = [f'#line 1 "emu/avr/{part}"\n{(HERE / part).read_text("utf-8")}' for part in PARTS]
    text = "\n".join([TYPES, declaration(), enumeration(), parts[0], decoder(), *parts[1:]])
    return text.replace("    INSTRUCTION_LABELS\n", labels() + "\n").replace(
        "    INSTRUCTION_BODIES\n", bodies() + "\n"
    )


@cache
def native() -> dict[str, Callable[..., Any]]:
    """Return the functions of the emulator, compiled on first use. Raises HostCodeError."""
    return functions_of(source(), "avr", {
        "avr_run": (INT, (ADDRESS, ADDRESS, INT)),
        "avr_run_observed": (INT, (ADDRESS, ADDRESS, INT, ADDRESS)),
        "avr_input_observed": (INT, (ADDRESS, INT, INT, INT, ADDRESS)),
        "avr_decode": (None, (ADDRESS, ADDRESS, INT, INT)),
        "avr_power_on": (None, (ADDRESS,)), "avr_apply_due": (None, (ADDRESS,)),
        "avr_input": (INT, (ADDRESS, INT, INT, INT)),
    })  # fmt: skip
