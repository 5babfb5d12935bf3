"""All mutable state of devices and boards is in the record, or it is named here with the reason why it need not be.

For every object of a machine with its board, the test finds the attributes that its methods assign or change. Each of
them must be a view of the record, a register, a cell, or listed in OUTSIDE.
"""

from __future__ import annotations

import ast
import ctypes
import inspect
import textwrap
from collections.abc import Iterator
from functools import cache
from typing import Any

import pytest

from emu.boards import board_named
from emu.chips import chip_named
from emu.machine.machine import Machine
from emu.peripherals.base import Peripheral, StateCell
from emu.system.device import Irq, Register

CHANGES = {"append", "add", "extend", "clear", "pop", "popleft", "update", "remove", "discard", "insert", "setdefault"}
DERIVED, CACHE, WIRING, OBSERVER, SNAPSHOT, HOST = (
    "computed from the record by restored()",
    "cache of values that its key determines",
    "made while the machine is built or an observer is added",
    "listener or log of a host program",
    "appended to the record's copy by Machine.snapshot",
    "input of the host program, which sets it again after a restore",
)
OUTSIDE = {
    "AnalogInputs._source": WIRING, "Peripherals.config": WIRING, "Peripheral._timestamps": WIRING,
    "Peripheral._slots": WIRING, "I2cBus.devices": WIRING, "Timer.high": WIRING, "Timer.upper": WIRING,
    "Timer._hold": WIRING, "Uart._capture": WIRING, "Spi._exchange": WIRING, "Pins._readers": WIRING,
    "Pins._ports_with_ring_watchers": WIRING, "Pins.rule_waveforms": WIRING, "Pins._on_waveform": WIRING,
    "Bus.writable": DERIVED, "Bus.clear_only": DERIVED, "Bus.compute": DERIVED, "Bus.on_read": DERIVED,
    "Bus.on_write": DERIVED, "Bus.rules": DERIVED, "ModuleDisable._off": DERIVED, "Pins._waveforms": DERIVED,
    "Scan.timing": DERIVED, "Scan.start": DERIVED, "Scan.running": DERIVED, "Camera._readout": DERIVED,
    "Camera._timing": DERIVED, "Camera._picture": DERIVED, "Camera._settings": DERIVED,
    "Timer._on_match": DERIVED, "Timer._on_change": DERIVED,
    "Camera._has_native_source": HOST, "Camera._pixels": HOST, "Camera._still": HOST, "Infrared._is_ready": HOST,
    "Infrared._prepare": HOST, "Infrared._tau_seconds": HOST, "Stimulus._steps": HOST,
    "Can._r": WIRING, "Pins._ring_watchers": WIRING, "Pins._handlers": WIRING, "RuleInterpreter._views": WIRING,
    "Adc._settings_cache": CACHE, "Bus._noted": OBSERVER, "Bus._reported": OBSERVER,
    "Pins._edges": OBSERVER, "Pins._eager_before_log": OBSERVER, "Pins.frames": OBSERVER, "Uart._matcher": OBSERVER,
    "Uart._listeners": OBSERVER, "Stepper._on_step": OBSERVER, "Stepper._history": OBSERVER,
    "Bluetooth._listeners": OBSERVER, "Bluetooth._remove_listener": OBSERVER,
    "RxQueue._backlog": SNAPSHOT, "RxQueue._first": SNAPSHOT,
}  # fmt: skip
"""Attributes outside the record by class and name, with the reason."""


OWN = ("emu.peripherals", "emu.boards", "emu.system", __name__)
"""Packages of the classes that are searched."""


@cache
def changed_attributes(kind: type) -> frozenset[str]:
    """Return the attributes that methods of a class, except __init__, assign, change by element or call to change."""
    found: set[str] = set()
    tree = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0]
    assert isinstance(tree, ast.ClassDef)
    for method in tree.body:
        if isinstance(method, ast.FunctionDef) and method.name != "__init__":
            for node in ast.walk(method):
                found |= {name for target in _targets(node) if (name := _own(target))}
    properties = {name for name, value in vars(kind).items() if isinstance(value, property)}
    return frozenset(found - properties)


def _targets(node: ast.AST) -> Iterator[ast.expr]:
    """Yield the expressions that a node assigns to or changes."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in CHANGES:
        yield node.func.value
    targets = node.targets if isinstance(node, ast.Assign) else []
    if isinstance(node, ast.AugAssign | ast.AnnAssign):
        targets = [node.target]
    for target in targets:
        yield from target.elts if isinstance(target, ast.Tuple) else [target]


def _own(target: ast.expr) -> str:
    """Return NAME of an expression self.NAME, self.NAME[...], and so on; empty for any other."""
    while isinstance(target, ast.Subscript | ast.Starred):
        target = target.value
    is_own = isinstance(target, ast.Attribute) and isinstance(target.value, ast.Name) and target.value.id == "self"
    return target.attr if is_own and isinstance(target, ast.Attribute) else ""


def parts(root: Any) -> Iterator[Any]:
    """Yield all objects of the project's own classes that are reachable from `root`."""
    seen: set[int] = set()
    waiting = [root]
    while waiting:
        one = waiting.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        if isinstance(one, dict):
            waiting += one.values()
        elif isinstance(one, list | tuple | set):
            waiting += one
        elif type(one).__module__.startswith(OWN):
            yield one
            waiting += values(one).values()


def values(one: Any) -> dict[str, Any]:
    """Return the attributes of an object, those in slots too."""
    slots = [name for kind in type(one).__mro__ for name in vars(kind).get("__slots__", ())]
    return {name: getattr(one, name) for name in slots if hasattr(one, name)} | getattr(one, "__dict__", {})


def is_in_record(value: Any, machine: Machine) -> bool:
    """Whether a value is, or lives in, the machine's record."""
    if isinstance(value, StateCell | Register | Irq):
        return True
    if isinstance(value, memoryview):
        place = ctypes.addressof(ctypes.c_char.from_buffer(value)) if not value.readonly else 0
        first = machine.record.address
        return first <= place < first + len(machine.record.bytes)
    return False


def outside(machine: Machine) -> Iterator[str]:
    """Yield `Class.attribute` of mutable attributes that are not in the record."""
    for one in parts([machine.peripherals, machine.board]):
        held = values(one)
        for kind in type(one).__mro__:
            if not kind.__module__.startswith(OWN) or kind.__module__ in INFRASTRUCTURE:
                continue
            for name in changed_attributes(kind) & held.keys():
                if not is_in_record(held[name], machine) and not isinstance(held[name], Peripheral):
                    yield f"{kind.__name__}.{name}"


INFRASTRUCTURE = {"emu.system.record", "emu.system.events", "emu.system.observers", "emu.system.program"}
"""Modules that manage the record itself, event handlers and listeners."""


@pytest.mark.parametrize(("chip", "board"), [("30F6014A", "epuck"), ("30F4013", "none"), ("30F4011", "none")])
def test_no_mutable_state_is_outside_the_record(chip: str, board: str) -> None:
    machine = Machine(chip_named(chip), engine="plain", board=board_named(board))
    assert sorted(set(outside(machine)) - OUTSIDE.keys()) == []


def test_state_outside_is_found() -> None:
    """A device that counts in a Python attribute is found."""
    machine = Machine(engine="plain")
    machine.peripherals.leaky = Leaky()  # type: ignore[attr-defined]
    assert {"Leaky.count", "Leaky.seen"} <= set(outside(machine))


class Leaky:
    """A device with state in attributes."""

    def __init__(self) -> None:
        self.count = 0
        self.seen: list[int] = []

    def edge(self) -> None:
        """Count an edge."""
        self.count += 1
        self.seen.append(self.count)


def test_a_held_bus_is_released_after_a_restore() -> None:
    """The pulses that a stuck slave still needs are part of a snapshot."""
    machine = Machine(engine="plain")
    assert machine.peripherals.i2c is not None
    wire = machine.peripherals.i2c.wire
    wire.hold(sda=True, clocks=3)
    wire.pulses(1)
    state = machine.snapshot()
    wire.pulses(2)
    assert machine.pins.get("RG3") == 1
    machine.restore(state)
    assert machine.pins.get("RG3") == 0
    wire.pulses(1)
    assert machine.pins.get("RG3") == 0
    wire.pulses(1)
    assert machine.pins.get("RG3") == 1
