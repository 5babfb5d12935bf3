"""Calls of individual firmware functions by the host, for tests.

Inputs: a paused machine, a function, arguments. Output: the function's result. Effects on memory and peripherals
persist; registers, stack pointer and priority are restored. Arguments are placed as in calls made by the compiler
(abi-elf.md §2.2): each in the first free registers of W0 to W7 that are aligned to its size.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from emu.debug.dwarf.types import UNSIGNED, Type, decode, encode
from emu.debug.dwarf.units import Scope
from emu.debug.inspector import Inspector

if TYPE_CHECKING:
    from emu.machine.machine import Machine

ARGUMENT_REGISTERS: Final = 8
CALL_LEVEL: Final = 7
"""CPU priority during the call; it blocks all interrupts."""
SAFETY_MARGIN: Final = 32
"""Bytes left free above W15, because the interrupted function may have data there that it has not yet pushed."""
POINTER: Final = Type("pointer", size=2)


class CallError(RuntimeError):
    """The function did not return. The text gives the reason."""


def call(machine: Machine, name: str, arguments: Sequence[Any], cycles: int) -> Any:
    """Call `name(*arguments)` and return its result: None for void, else a Python object as from `Value.get`.

    Numbers are converted to the parameters' types. Bytes are copied to the stack and passed as a pointer. Raises
    KeyError for an unknown function, ValueError for unsuitable arguments, CallError if the function does not return
    within `cycles`.
    """
    inspector = Inspector(machine)
    address = machine.program_address(name)
    function = inspector.debug.function(address)
    types = _parameter_types(function, arguments)
    saved = (machine.pc, [machine.w[n] for n in range(16)], machine.state.sr, machine.state.corcon)
    stall, repeat = machine.state.stall, machine.state.repeat
    end = machine.chip.program["flash"].end - 2
    top = machine.w[15] + SAFETY_MARGIN & 0xFFFE
    placed: list[int] = []
    for value in arguments:
        if isinstance(value, bytes | bytearray):
            machine.poke(top, int.from_bytes(value, "little"), max(len(value), 1))
            placed.append(top)
            top += len(value) + 1 & ~1
    _place_arguments(
        machine, types, [placed.pop(0) if isinstance(one, bytes | bytearray) else one for one in arguments]
    )
    machine.poke(top, end & 0xFFFF, 2)
    machine.poke(top + 2, end >> 16, 2)
    machine.w[15] = top + 4
    machine.state.ipl = CALL_LEVEL
    machine.state.repeat = 0
    machine.pc = address
    remove = machine.hook_pc(end, lambda: True)
    try:
        stop = machine.run(cycles=cycles)
    finally:
        remove()
    result = bytes(machine.record.bytes[0:8])
    if stop.reason != "breakpoint" or stop.pc != end:
        raise CallError(f"{name} did not return: {stop.fault.report() if stop.fault is not None else stop}")
    machine.pc, registers, machine.state.sr, machine.state.corcon = saved
    for number, value in enumerate(registers):
        machine.w[number] = value
    machine.state.stall, machine.state.repeat = stall, repeat
    machine.events.kick()
    returned = function.returns if function is not None else UNSIGNED[2]
    return None if returned is None or not returned.bytes else decode(returned, result)


def _parameter_types(function: Scope | None, arguments: Sequence[Any]) -> list[Type]:
    """Return the parameter types. Without debug information, numbers are passed as 16-bit words."""
    if function is None:
        return [POINTER if isinstance(one, bytes | bytearray) else UNSIGNED[2] for one in arguments]
    types = [one.type for one in function.variables if one.is_parameter]
    if len(types) != len(arguments):
        raise ValueError(f"{function.name} takes {len(types)} arguments, not {len(arguments)}")
    if function.returns is not None and function.returns.bare.kind in ("struct", "union"):
        raise ValueError(f"{function.name} returns a {function.returns}; only numbers can be had from a call")
    return types


def _place_arguments(machine: Machine, types: Sequence[Type], values: Sequence[Any]) -> None:
    """Put the arguments into W0 to W7. Raises ValueError if they do not fit."""
    free = [True] * ARGUMENT_REGISTERS
    for kind, value in zip(types, values, strict=True):
        if not kind.is_number:
            raise ValueError(f"a {kind} cannot be passed from outside")
        data = encode(kind, value)
        data += bytes(len(data) % 2)
        words = len(data) // 2
        places = range(0, ARGUMENT_REGISTERS, words)
        first = next((n for n in places if all(free[n : n + words]) and n + words <= ARGUMENT_REGISTERS), None)
        if first is None:
            raise ValueError("more arguments than fit into W0 to W7 cannot be passed from outside")
        for number in range(words):
            free[first + number] = False
            machine.w[first + number] = int.from_bytes(data[2 * number : 2 * number + 2], "little")
