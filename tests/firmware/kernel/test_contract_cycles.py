"""Cycles of the contract lines that test_contract_bounds.py omits: measured on the emulator, or equal to a bound."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

import emu
from bench.kernel.bounds import PLAIN
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.contracts import CALL, HEADERS, callers, numbers
from tests.firmware.kernel import test_contract_bounds as bounds
from tests.firmware.kernel import test_option_headers as options
from toolchain.bounds.program import Program
from toolchain.bounds.report import BoundAnalysis
from toolchain.elf.read import read_executable

RETURN = 3
"""Tcy of a return, which a macro does not need."""
RESUME = ("os_resume_yielded", "resume_preempted", "os_thread_start")
"""First instruction of each kind of thread that a switch resumes."""
OWN_PATH = ("work", "save_dsp", "resume_dsp", "highest_priority", "earliest_deadline")
"""Functions that are not called on the caller's own path, under round robin (openswarm.h)."""
FAILURES = ("os_fail", "os_refuse")
"""Functions that are called only if a call is refused or fails."""


@dataclass(frozen=True)
class Sizes:
    """Sizes of a kernel: other threads that rest (wait without time-out), nap (with one), are due or are ready; newer
    events in the bucket; holders of the wait result; 1 for a missed deadline; bytes of a message."""

    resting: int = 0
    napping: int = 0
    due: int = 0
    ready: int = 0
    newer: int = 0
    held: int = 0
    late: int = 0
    bytes: int = 0

    @property
    def waiting(self) -> int:
        """The w of openswarm.h."""
        return self.resting + self.napping

    @property
    def threads(self) -> int:
        """The n of openswarm.h: the caller, main and the thread that runs next are further threads."""
        return self.waiting + self.due + self.ready + 3


def _timed(base: int, s: Sizes) -> int:
    return base + 46 * s.waiting + (88 + 7 * s.waiting) * s.due


def _release(s: Sizes, g: int) -> int:
    return 17 + 22 * s.threads + g if s.held else 0


def _wait(s: Sizes, g: int) -> int:
    return 229 + 9 * s.newer + 7 * (s.waiting + s.due) + _release(s, g)


def _wait_with_timeout(s: Sizes, g: int) -> int:
    return _timed(53, s) - 7 * (s.waiting + s.due) + _wait(s, g)


def _period(s: Sizes, _g: int) -> int:
    return _timed(267, s) + (56 + 133 + 10 * s.newer if s.late else 0)


@dataclass(frozen=True)
class Measured:
    """A call, its contract text with its cycles by sizes and g, and the sizes for which it is measured.

    In `exact` scenes the contract is met exactly; in `close` ones it exceeds the measurement by 20 % at most.
    """

    text: str
    cycles: Callable[[Sizes, int], int]
    exact: tuple[Sizes, ...] = ()
    close: tuple[Sizes, ...] = field(default=())


CROWDS = (Sizes(napping=4), Sizes(resting=3, due=3), Sizes(napping=4, due=2), Sizes(due=5))
WAITS = (Sizes(), Sizes(resting=4), Sizes(napping=4), Sizes(newer=4))
MEASURED = {
    "Sys_Sleep": Measured("231 + 46 w + (88 + 7 w) e", lambda s, _: _timed(231, s), (Sizes(), Sizes(ready=3)), CROWDS),
    "Sys_Wait_for_Event": Measured(
        "229 + 9 b + 7 (w + e); 17 + 22 n + g more if it frees a result",
        _wait,
        (*WAITS, Sizes(held=1), Sizes(held=1, ready=3)),
        (Sizes(held=1, resting=4), Sizes(held=1, due=2)),
    ),
    "Sys_Wait_for_Condition": Measured(
        "229 + 9 b + 7 (w + e); 17 + 22 n + g more if it frees a result", _wait, (), (*WAITS, Sizes(held=1, ready=3))
    ),
    "Sys_Wait_for_ConditionTimeout": Measured(
        "as above; with a time-out 53 + 39 w + (81 + 7 w) e more", _wait_with_timeout,
        (Sizes(), Sizes(newer=4), Sizes(held=1, ready=3)), CROWDS,
    ),
    "Sys_Wait_for_Period": Measured(
        "267 + 46 w + (88 + 7 w) e; after a missed deadline another 56 and those of Sys_Send_IntEvent",
        _period, (Sizes(), Sizes(ready=3)), (*CROWDS, Sizes(late=1), Sizes(late=1, resting=2), Sizes(late=1, due=2)),
    ),
    "Sys_Clear_EventData": Measured(
        "88 + 22 n + g", lambda s, g: 88 + 22 * s.threads + g,
        (Sizes(held=1), Sizes(held=1, ready=4)), (Sizes(held=1, resting=4),),
    ),
    "Sys_Write_UART1": Measured(
        "170 + 34 per byte + 75 per block; at most 460 more per block while memory is short, and g per block of a "
        "killed writer's message",
        lambda s, _: 170 + 34 * s.bytes + 75 * -(-s.bytes // 33),
        tuple(Sizes(bytes=size) for size in (1, 2, 33, 34, 60)),
    ),
}  # fmt: skip
UART = "Sys_Write_UART1"
"""Its bound is far from its cycles, because it assumes a new block for each byte."""

EXACT = {
    "contracts": (
        "Sys_Get_ProcessID", "Sys_Get_Statistics", "Sys_Get_MotorSpeed_Left", "Sys_Get_MotorSpeed_Right",
        "Sys_Get_Selector", "Sys_Get_UARTStatistics", "Sys_Set_SelectorProcessor", "Sys_Set_MotorProcessor",
        "Sys_Set_TxProcessor", "Sys_Set_LED", "Sys_Toggle_LED", "Sys_Next_Ready", "Sys_Pid_Of", "Sys_Priority_Of",
    ),
    "infrared-calls": (
        "Sys_Get_InfraredStatistics", "Sys_Get_RemoteStatistics", "Sys_Set_MessageProcessor",
        "Sys_Set_SendingProcessor", "Sys_Set_LeavingProcessor",
    ),
    "device-calls": (
        "Sys_Is_BatteryLow", "Sys_Get_Reflection", "Sys_Get_AmbientLight", "Sys_Get_Acceleration", "Sys_Get_Sound",
        "Sys_Get_CameraType", "Sys_Get_CameraFrame", "Sys_Set_ProximityProcessor", "Sys_Set_AccelerationProcessor",
        "Sys_Set_SoundProcessor", "Sys_Set_LEDProcessor", "Sys_Set_CameraProcessor", "Sys_Set_SPIProcessor",
        "Sys_Set_BluetoothProcessor", "Sys_Set_RemoteProcessor",
    ),
}  # fmt: skip
"""By image: calls whose cycles and stack are exactly their bounds."""
MACROS = {
    "Sys_Enable_Interrupt": ("sys_enable_INT1", 0),
    "Sys_Disable_Interrupt": ("disable_interrupt", RETURN),
    "Sys_Raise_Interrupt": ("raise_interrupt", RETURN),
}
"""For each macro: a function that consists of it, and how many cycles of the function the macro does not take."""
LIKE = {
    "Sys_Set_RxProcessor": ("85; 35 and those of Sys_Send_Event more if bytes were received", "Sys_Send_Event", 120),
    "Sys_Connect_Motors": ("as Sys_Subscribe_to_Event", "Sys_Subscribe_to_Event", 0),
    "Sys_Unsubscribe_from_Event": ("120 + 9 b + (15 + g) s", "Sys_Unsubscribe_Handler", 7),
    "Sys_Write_UART2": (MEASURED[UART].text, UART, 0),
}
"""For each call: its contract text, another call, and the greatest difference of their bounds."""
SHARE_TEXT = "2120 + 405 b + 2 g; at most 460 more while memory is short"
START_UP = "-"
"""Cycles field of TRANSFERS and of calls that main makes once, to start the system or to end its own part."""
DEVICES = ("analog", "battery", "bluetooth", "camera", "i2c", "led", "remote", "spi")
"""Folders of io/ whose header of the same name is for applications."""
OTHER_DEVICES = {
    "infrared": "openswarm_infrared.h, openswarm_remote.h",
    "update": "before the kernel, while flash writes stop the CPU for 2 ms each",
    "update_auth": "no calls",
}
"""The other folders, and where their calls are stated or why they have no cycles."""
TRANSFERS = {"Sys_I2C_Transfer", "Sys_SPI_Transfer"}
"""Calls of threads that last as long as the transfer of the device."""
PROCESSORS = re.compile(r"Sys_(Default|LineOfSight)_\w*Processor|Sys_Line_[RT]x")
"""Calls of drivers, which state no cycles."""
STARTS = ("Sys_Start_Analog", "Sys_Start_I2C", "Sys_Start_LEDs", "Sys_Start_Remote", "Sys_Start_SPI")
"""Start-up calls whose stack has a bound. Those of the camera and of Bluetooth call functions that have none."""


def checked_calls() -> set[str]:
    """Return the names of the calls whose cycles a test compares with bounds or measurements."""
    here = {*MEASURED, *MACROS, *LIKE, "Sys_Share_Event", *(call for calls in EXACT.values() for call in calls)}
    in_bounds = {*bounds.PROMISES, *bounds.MEASURED, *bounds.WITH_ROW.values(), *bounds.LINK}
    return here | in_bounds | set(options.VARIANTS) | {call for calls in options.CALLS.values() for call in calls}


def test_the_cycles_of_every_call_are_checked() -> None:
    """Each call of a public header has cycles that a test checks, except those marked START_UP."""
    declared, start_up = set(), set()
    for header in headers():
        text = (HEADERS / header).read_text()
        calls = [call for call in CALL.findall(text) if not PROCESSORS.fullmatch(call)]
        if header == "openswarm_interrupt.h":
            calls += re.findall(r"^#define (Sys_\w+)\(", text, re.M)
        stated = numbers(header)
        declared |= set(calls)
        start_up |= {call for call in calls if call in stated and stated[call][0] == START_UP}
        assert all(callers(header)[call] in ("M", "T") for call in start_up & set(calls))
    assert declared - checked_calls() - bounds.NO_CALLS == start_up
    assert start_up >= TRANSFERS
    assert checked_calls() <= declared


def test_every_device_states_its_cycles_or_why_not() -> None:
    folders = {path.name for path in (HEADERS.parent / "io").iterdir() if path.is_dir()}
    assert folders == {*DEVICES, *OTHER_DEVICES}


@pytest.fixture(scope="module")
def images(image: Build) -> dict[str, Path]:
    """Return the images of EXACT."""
    return {
        "contracts": image("contracts", TARGET_APPS),
        "infrared-calls": image("infrared-calls", TARGET_APPS, "OPTIMISE=-Os -fno-lto"),
        "device-calls": image("device-calls", TARGET_APPS, "OPTIMISE=-Os -fno-lto"),
    }


def analysis_of(path: Path, excluded: tuple[str, ...] = (), **values: int) -> BoundAnalysis:
    """Return the analysis of an image under the load of test_contract_bounds.py, changed by the given values."""
    image = read_executable(path.read_bytes(), str(path))
    return BoundAnalysis(Program(image, bounds.LOAD | values, excluded))


def bound_of(analysis: BoundAnalysis, call: str) -> tuple[int, int]:
    """Return the bound of a function: cycles, and stack bytes with the return address."""
    address = analysis.program.address(call)
    assert address is not None, call
    bound = analysis.bound(call, address, "call")
    assert not bound.unbounded
    assert bound.cycles is not None
    return bound.cycles, bound.bytes + bounds.RETURN_ADDRESS


def headers() -> list[str]:
    """Return the headers whose calls state cycles, relative to HEADERS."""
    return [path.name for path in HEADERS.glob("openswarm*.h")] + [f"../io/{name}/{name}.h" for name in DEVICES]


def stated(call: str) -> tuple[str, int]:
    """Return the cycles field and the stack bytes of a call."""
    return next(found[call] for header in headers() if call in (found := numbers(header)))


def own_number(call: str) -> int:
    """Return the cycles of a call with a constant number of them: its own one, where calls share a contract line."""
    header = next(header for header in headers() if call in numbers(header))
    line = numbers(header)[call]
    found = [int(number) for number in re.findall(r"\d+", line[0])]
    return found[min([other for other, its in numbers(header).items() if its == line].index(call), len(found) - 1)]


@pytest.mark.slow
@pytest.mark.parametrize("name", EXACT)
def test_constant_cycles_and_stacks_are_their_bounds(images: dict[str, Path], name: str) -> None:
    analysis = analysis_of(images[name])
    for call in EXACT[name]:
        assert (own_number(call), stated(call)[1]) == bound_of(analysis, call), call
    for call in STARTS if name == "device-calls" else ():
        assert bound_of(analysis, call)[1] <= stated(call)[1], call


@pytest.mark.slow
def test_other_bounds_agree_with_their_contracts(images: dict[str, Path]) -> None:
    """Macros, calls that make or resemble another call, and formulas that a bound covers."""
    analysis = analysis_of(images["contracts"])
    header = (HEADERS / "openswarm_interrupt.h").read_text()
    for macro, (function, without) in MACROS.items():
        comment = header[: header.index(f"#define {macro}(")].rpartition("/*")[2]
        assert int(comment.split(" | ")[2]) == bound_of(analysis, function)[0] - without, macro
    for call, (text, other, more) in LIKE.items():
        cycles, stack = bound_of(analysis, call)
        assert stated(call) == (text, stack)
        assert cycles <= bound_of(analysis, other)[0] + more
    for b in (1, 4):
        cycles, stack = bound_of(analysis_of(images["infrared-calls"], FAILURES, b=b, **PLAIN), "Sys_Share_Event")
        assert stated("Sys_Share_Event") == (SHARE_TEXT, stack)
        assert cycles <= 2120 + 405 * b + 2 * bounds.FREE + 460 <= 1.6 * cycles


@pytest.mark.slow
@pytest.mark.parametrize("call", [call for call in MEASURED if call != UART])
def test_a_contract_covers_the_bound_of_the_own_path(image: Build, call: str) -> None:
    """The formula of each call covers its bound, if each of n threads waits or is due, and g is at its most."""
    path = image("calls", TARGET_APPS)
    for n in (2, 4, 8):
        cycles, _ = bound_of(analysis_of(path, (*OWN_PATH, *FAILURES), n=n, **PLAIN), call)
        sizes = Sizes(resting=n, due=n, newer=1, held=1, late=1)
        assert cycles <= MEASURED[call].cycles(sizes, bounds.FREE) <= 2.2 * cycles, n


def return_address(machine: emu.Machine) -> int:
    """Return the return address of the function whose first instruction is next."""
    top = machine.w[15]
    return (machine.peek(top - 4) | (machine.peek(top - 2) & 0x7F) << 16) & ~1


def record_calls(machine: emu.Machine, function: str) -> list[tuple[int, int]]:
    """Return a list to which each call of a function from now on adds the cycles of its begin and end."""
    spans: list[tuple[int, int]] = []

    def enter() -> None:
        begin = machine.cycle

        def leave() -> None:
            spans.append((begin, machine.cycle))
            remove()

        remove = machine.hook_pc(return_address(machine), leave)

    machine.hook_pc(function, enter)
    return spans


def measure(path: Path, call: str, sizes: Sizes) -> tuple[int, int]:
    """Return the cycles of a call's own path (openswarm.h), and those in which it frees a block."""
    machine = emu.load(path)
    assert machine.run(until="contracts_begin", seconds=1).reason == "until"
    for name, value in {**vars(sizes), "wanted": list(MEASURED).index(call)}.items():
        machine.poke(name, value)
    for stop in ("contracts_ready", call):
        assert machine.run(until=stop, seconds=1).reason == "until"
    begin, caller, back = machine.cycle, machine.peek("os_running"), return_address(machine)
    resumed: list[tuple[int, bool]] = []
    for place in RESUME:
        machine.hook_pc(place, lambda: resumed.append((machine.cycle, machine.peek("os_running") == caller)))
    work, free = record_calls(machine, "work"), record_calls(machine, "heap_free")
    machine.write("IPC2", machine.peek("IPC2") & 0x00FF)  # UART1 does not interrupt the call that writes to it
    assert machine.run(until=back, seconds=1).reason == "until"
    g = next((end - start for start, end in free if not resumed or start < resumed[0][0]), 0)
    if not resumed:
        return machine.cycle - begin, g
    switch, again = resumed[0][0], next(cycle for cycle, is_caller in reversed(resumed) if is_caller)
    others = sum(end - start for start, end in work if start < switch)
    return switch - begin - others + machine.cycle - again, g


@pytest.mark.slow
@pytest.mark.parametrize("call", MEASURED)
def test_the_own_path_of_a_call_takes_the_cycles_of_its_contract(images: dict[str, Path], call: str) -> None:
    """Each call takes exactly the cycles of its contract where it has that number, and nearly where it is a maximum."""
    contract = MEASURED[call]
    assert stated(call)[0] == contract.text
    for sizes in (*contract.exact, *contract.close):
        cycles, g = measure(images["contracts"], call, sizes)
        maximum = contract.cycles(sizes, g)
        assert cycles == maximum if sizes in contract.exact else cycles <= maximum <= 1.2 * cycles, (sizes, cycles, g)
