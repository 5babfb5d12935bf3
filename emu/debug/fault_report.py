"""Diagnosis of firmware faults: cause, place, variables, thread, call stack and the branches that led there.

Inputs: a stopped machine and its checkpoints (`emu.machine.stops.RunCheckpoints`). Output: the `Stop` with a
`FaultReport`, or the unchanged stop if the firmware ended regularly.

- A handled trap is not a fault, unless the firmware never returns from its handler, or the handler ends a thread of
  OpenSwarm (`thread_overflow`).
- A kernel that stops the system is a fault.
- An unhandled exception is recognised by a debugger word at the vector's target, where the linkers of XC16 and of this
  project put one (abi-elf.md §3.3).

The fault often happens long before the stop. The diagnosis therefore replays the run in a sandbox
(`emu.debug.replay`) up to the faulty instruction, and reads variables and call stack there.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Final

from emu.chips.chip import Vector
from emu.debug.dwarf.location import Unavailable
from emu.debug.frame import Frame
from emu.debug.inspector import Inspector
from emu.debug.replay import ExecutionTrace, retrace, sandboxed
from emu.debug.threads import Threads
from emu.dspic30f.exceptions.faults import RESTART
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.debugger_words import FAILED_CHECK, PLAIN_TRAP
from emu.dspic30f.state.state import IPL3, STACK_POINTER
from emu.image.model import ERASED
from emu.image.symbols import STOP_FUNCTION
from emu.machine.fault import FaultReport, StackEntry, TakenBranch

if TYPE_CHECKING:
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

TRAPS: Final = {
    "OscillatorFail": ("OSCFAIL", "oscillator failure trap"),
    "AddressError": ("ADDRERR", "address error trap"),
    "StackError": ("STKERR", "stack error trap"),
    "MathError": ("MATHERR", "math error trap"),
}
"""Flag in INTCON1 (isa.md §14.4) and description of each trap, by the name of its vector."""
REPORTING_FUNCTIONS: Final = frozenset(
    (STOP_FUNCTION, "stop", "os_trap", "Sys_Assertion_Failed", "__assert_fail", "abort")
)
"""Functions that report a fault that their caller made."""
TRAP_FUNCTION: Final = "os_trap"
OVERFLOW_FUNCTION: Final = "_os_overflow"
"""Function of OpenSwarm that ends a thread after its stack overflow (firmware/openswarm/kernel/fault.c)."""
RUNNING_THREAD: Final = "_os_running"
LARGEST_GUARD: Final = 128
"""Maximum number of bytes from a thread's stack limit to its control block (port/dspic30f/cpu.c of the kernel)."""
RESET_WORD: Final = 0xFE0000
CHECKS: Final = {
    0: "integer overflow in an addition",
    1: "a place that cannot be reached",
    3: "an integer division by zero, or one that overflows",
    5: "a float that does not fit into the integer",
    6: "a function called through a pointer of another type",
    7: "an implicit conversion that changes the value",
    8: "a builtin called with what it is not defined for",
    10: "a value that the type does not have (bool, enum)",
    11: "the end of a function that returns a value, without return",
    12: "integer overflow in a multiplication",
    13: "integer overflow in a negation",
    14: "an argument that is null where it must not be",
    15: "a result that is null where it must not be",
    16: "an argument that is null where it must not be",
    17: "a result that is null where it must not be",
    18: "an index out of bounds",
    19: "a pointer that overflows",
    20: "a shift by too many bits, or of a sign",
    21: "integer overflow in a subtraction",
    22: "a null or misaligned pointer, or an object too small for its type",
    23: "a pointer that is not aligned as promised",
    24: "an array whose length is not positive",
    PLAIN_TRAP: "__builtin_trap()",
}
"""Causes by clang's SanitizerHandler number (clang 20, CodeGen/SanitizerHandler.h).

The tests compile the usual checks. For a number that is not listed, a report shows the number.
"""
VECNUM: Final = 0x3F
"""Field of INTTREG with the vector number of the last exception entered (isa.md §14.4)."""
FRAMES_WITH_VARIABLES: Final = 2


@dataclass(slots=True)
class _Case:
    """Facts known about a fault. The diagnosis refines `cause` and `pc`."""

    cause: str
    pc: int
    cycle: int
    fault_state: bytes | None = None
    """Snapshot taken at the fault; None if the machine is still in that state."""
    start: bytes | None = None
    """Earlier snapshot from which the run to the fault can be replayed."""
    vector: Vector | None = None
    is_exact: bool = False
    """Whether `pc` is exactly the faulty instruction."""


def attach(machine: Machine) -> None:
    """Make `machine` report firmware faults in its stops."""
    machine.diagnose = partial(explain, machine)


def explain(machine: Machine, stop: Stop) -> Stop:
    """Return `stop` with reason "fault" and a `FaultReport` if the firmware failed, else the unchanged `stop`."""
    inspector = Inspector(machine)
    case = _case_of_stop(machine, inspector, stop)
    return stop if case is None else replace(stop, reason="fault", fault=_diagnose(machine, inspector, case))


def never_started(machine: Machine, stop: Stop, refused: int) -> Stop:
    """Return `stop` as a fault: the kernel was never started and refused `refused` calls."""
    calls = "a call that needs" if refused == 1 else f"{refused:,} calls that need"
    cause = f"the kernel was never started (Sys_Start_Kernel) and refused {calls} it to run; ended"
    case = _Case(cause, stop.pc, stop.cycle, is_exact=True)
    return replace(stop, reason="fault", fault=_diagnose(machine, Inspector(machine), case))


def is_thread_overflow(machine: Machine) -> bool:
    """Whether a stack error trap that is about to be entered ends a thread of OpenSwarm, and not the whole system.

    The stack limit in force is then that of the running thread: it lies just below the thread's control block.
    """
    symbols = None if machine.image is None else machine.image.symbols
    running = None if symbols is None else symbols.find(RUNNING_THREAD)
    if symbols is None or running is None or symbols.find(OVERFLOW_FUNCTION) is None:
        return False
    return 0 < machine.peek(running.address) - machine.state.splim <= LARGEST_GUARD


def thread_overflow(machine: Machine, stop: Stop) -> Stop:
    """Return `stop` as the fault of an OpenSwarm thread that overflowed its stack in the last trap."""
    assert machine.checkpoints.trap is not None
    case = _case_of_trap(machine, machine.checkpoints.trap)
    return replace(stop, reason="fault", fault=_diagnose(machine, Inspector(machine), case))


def state_report(machine: Machine, cause: str) -> FaultReport:
    """Return the thread, call stack and last branches of a machine without a fault, as a `FaultReport`."""
    case = _Case(cause, machine.pc, machine.cycle, None, machine.checkpoints.start)
    return _diagnose(machine, Inspector(machine), case)


# Classification of a stop


def _case_of_stop(machine: Machine, inspector: Inspector, stop: Stop) -> _Case | None:
    """Return the fault that caused `stop`, None for a regular end."""
    checkpoints = machine.checkpoints
    if stop.reason == "fault":
        reset = checkpoints.reset
        return _Case(stop.detail, stop.pc, stop.cycle, reset, checkpoints.start, is_exact=reset is not None)
    in_trap = bool(machine.peek("CORCON") & IPL3)
    if stop.reason == "breakpoint":
        return _case_of_debugger_word(machine, inspector, stop, in_trap)
    if inspector.function_name(stop.pc) == STOP_FUNCTION and machine.is_asleep:
        called = {one.function for one in inspector.frames()}
        if checkpoints.trap is not None and (in_trap or TRAP_FUNCTION in called):
            return _case_of_trap(machine, checkpoints.trap)
        return _Case("the kernel stopped the system; UART1 said why,", stop.pc, stop.cycle, None, checkpoints.start)
    if not in_trap:
        return None
    if checkpoints.trap is not None:
        case = _case_of_trap(machine, checkpoints.trap)
        case.cause += ", in whose handler the firmware went to sleep,"
        return case
    name = machine.chip.vectors[machine.peek("INTTREG") & VECNUM].name
    return _Case(f"{name} trap, in whose handler the firmware went to sleep,", stop.pc, stop.cycle)


def _case_of_debugger_word(machine: Machine, inspector: Inspector, stop: Stop, in_trap: bool) -> _Case | None:
    """Return the fault that ends in a debugger word: a failed sanitizer check or an unhandled exception.

    None means that the debugger word is a regular end.
    """
    program, image = machine.program, inspector.image
    check = program.word(stop.pc + 4) - FAILED_CHECK
    if program.word(stop.pc + 2) == RESET_WORD and 0 <= check <= PLAIN_TRAP:
        what = CHECKS.get(check, f"check {check}")
        cause = f"{what}," if check == PLAIN_TRAP else f"undefined behaviour: {what},"
        return _Case(cause, stop.pc, stop.cycle, None, machine.checkpoints.start, is_exact=True)
    vectors = [one for one in image.chip.vectors if stop.pc in (image.word(one.ivt), image.word(one.aivt))]
    if not vectors:
        return None
    if in_trap and machine.checkpoints.trap is not None:
        case = _case_of_trap(machine, machine.checkpoints.trap)
        case.cause += ", no handler,"
        return case
    for vector in vectors:
        if vector.irq in machine.chip.interrupts and _is_pending(machine, vector.irq):
            return _Case(f"{vector.name}, no handler,", _return_address(machine) or stop.pc, stop.cycle)
    return None


def _case_of_trap(machine: Machine, trap: tuple[Vector, bytes, bytes | None]) -> _Case:
    """Return the fault that caused the trap entered last."""
    vector, state, start = trap
    cause = TRAPS[vector.name][1] if vector.name in TRAPS else f"{vector.name} trap"
    with sandboxed(machine, state):
        pc, cycle = machine.pc, machine.cycle
    return _Case(cause, pc, cycle, state, start, vector)


# Diagnosis


def _diagnose(machine: Machine, inspector: Inspector, case: _Case) -> FaultReport:
    """Find the faulty instruction of `case`, replay the run up to it and describe the state there."""
    trace = _trace(machine, case)
    replay_cycle = _locate(machine, inspector, case, trace)
    with _state_at_fault(machine, case, replay_cycle):
        if not case.is_exact and case.vector is not None:
            case.pc = _estimated_pc(inspector, case)
        case.cause = _detailed_cause(machine, case, trace)
        frames = _frames_of_culprit(inspector, case)
        thread = _running_thread(inspector)
        entries = tuple(_entry(inspector, frame, number < FRAMES_WITH_VARIABLES) for number, frame in enumerate(frames))
    branches = trace.branches if trace is not None else ()
    symbol = inspector.image.symbols.text(case.pc) if inspector.is_code(case.pc) else None
    line = inspector.image.lines.find(case.pc)
    return FaultReport(
        case.cause, case.pc, case.cycle, inspector.where(case.pc), symbol, str(line) if line else None, thread or None,
        entries, branches, tuple(_branch_text(inspector, one) for one in branches),
    )  # fmt: skip


def _trace(machine: Machine, case: _Case) -> ExecutionTrace | None:
    """Return a trace of the run to the fault. For a trap, it ends with the instruction that requested the trap."""
    if case.start is None:
        return None
    if case.cause == RESTART:
        return retrace(machine, case.start, case.cycle, lambda: not machine.pc and machine.cycle == case.cycle)
    if case.vector is None:
        return retrace(machine, case.start, case.cycle)
    flag = 1 << machine.chip.sfrs["INTCON1"].fields[TRAPS[case.vector.name][0]][0] if case.vector.name in TRAPS else 0
    return retrace(machine, case.start, case.cycle, lambda: bool(machine.state.intcon1 & flag))


def _locate(machine: Machine, inspector: Inspector, case: _Case, trace: ExecutionTrace | None) -> int | None:
    """Set `case.pc` to the faulty instruction if `trace` contains it. Return its first cycle, otherwise None."""
    cycle = None
    jump = _wild_jump(inspector, case, trace)
    if trace is not None and trace.last is not None and (case.vector is not None or not case.is_exact):
        case.pc, cycle, case.is_exact = trace.last, trace.cycle, True
    if jump is not None:
        case.pc, cycle, case.is_exact = jump.source, jump.cycle, True
        case.cause = _jump_text(machine, jump, case.cause)
    return cycle


@contextmanager
def _state_at_fault(machine: Machine, case: _Case, replay_cycle: int | None) -> Iterator[None]:
    """Run the block with the machine before the faulty instruction; without a replay, in the state after the fault."""
    if replay_cycle is not None and case.start is not None:
        with sandboxed(machine, case.start):
            machine.run_until(replay_cycle)
            yield
    elif case.fault_state is not None:
        with sandboxed(machine, case.fault_state):
            yield
    else:
        yield


def _frames_of_culprit(inspector: Inspector, case: _Case) -> list[Frame]:
    """Return the call stack of the fault without the functions that only report it."""
    frames = inspector.frames(case.pc)
    if inspector.function_name(case.pc) in REPORTING_FUNCTIONS:
        frames = [frame for frame in frames if frame.function not in REPORTING_FUNCTIONS] or frames
        case.pc = frames[0].pc
    return frames


def _wild_jump(inspector: Inspector, case: _Case, trace: ExecutionTrace | None) -> TakenBranch | None:
    """Return the branch with which control left the program for the rest of the run, None if there is none."""
    if trace is None:
        return None
    if case.cause == RESTART:
        return next((one for one in reversed(trace.branches) if one.target == 0), None)
    if inspector.is_code(trace.last if trace.last is not None else case.pc):
        return None
    last = next((one for one in reversed(trace.branches) if inspector.is_code(one.source)), None)
    return None if last is None or inspector.is_code(last.target) else last  # else execution ran past the end of code


def _jump_text(machine: Machine, jump: TakenBranch, cause: str) -> str:
    """Describe the cause of a fault after a wild jump."""
    word = machine.program.word(jump.source)
    insn = decode_for_execution(word, machine.program.word(jump.source + 2))
    name = insn.row.mnemonic if insn is not None else ""
    verb = "call to" if "CALL" in name else "return to" if name.startswith("RET") else "jump to"
    if jump.target == 0:
        what = " (a null function pointer?)" if verb == "call to" else ""
        return f"{verb} address 0{what}"
    target = "erased flash" if machine.program.word(jump.target) == ERASED else "no code of the program"
    return f"{verb} {jump.target:#08x}, where there is {target} ({cause.rstrip(',')}),"


def _estimated_pc(inspector: Inspector, case: _Case) -> int:
    """Return the presumably faulty instruction of a trap, from the return address that the trap pushed (isa.md §14.4).

    A math error pushes the address of the division. Other traps push the address of the next instruction.
    """
    assert case.vector is not None
    if case.vector.name == "MathError":
        return case.pc
    return case.pc - 2 if inspector.is_code(case.pc - 2) else case.pc


def _detailed_cause(machine: Machine, case: _Case, trace: ExecutionTrace | None) -> str:
    """Describe the cause. For address and stack errors, add the values of the registers involved."""
    if case.vector is None or case.vector.name not in ("AddressError", "StackError"):
        return case.cause
    top, ram = machine.w[STACK_POINTER], machine.chip.data["ram"]
    limit = machine.state.splim if machine.state.limit_armed else ram.end
    deepest = max(top, trace.stack_pointer if trace is not None else 0)
    if deepest > limit or deepest >= ram.end:
        return f"stack overflow: W15 is {deepest:#06x}, the limit {limit:#06x} ({case.cause.rstrip(',')}),"
    if top < ram.start:
        return f"stack underflow: W15 is {top:#06x}, below RAM ({case.cause.rstrip(',')}),"
    if trace is not None and trace.bad_access is not None and case.vector.name == "AddressError":
        address, size, is_write = trace.bad_access
        why = "an odd address" if size == 2 and address & 1 else "where no memory is"
        verb = "writing" if is_write else "reading"
        return case.cause.replace("trap", f"trap: {verb} {size} byte{'s' * (size > 1)} at {address:#06x}, {why}", 1)
    if case.vector.name == "StackError":  # the access is above the limit, W15 itself is still below it
        return f"stack overflow ({case.cause.rstrip(',')}),"
    return case.cause


def _running_thread(inspector: Inspector) -> str:
    """Return the name of the running thread; empty without a kernel, or if the kernel's variables are corrupt."""
    try:
        return Threads(inspector).running()
    except (Unavailable, KeyError, TypeError, ValueError):
        return ""


def _entry(inspector: Inspector, frame: Frame, with_values: bool) -> StackEntry:
    """Return a call stack entry as text, with the values of variables if `with_values`."""
    values = []
    for one in inspector.variables(frame) if with_values else ():
        try:
            values.append((one.name, inspector.value(one, frame).text()))
        except Unavailable as why:
            values.append((one.name, f"<{why}>"))
    return StackEntry(frame.pc, frame.function, str(frame.line) if frame.line else None, frame.kind, tuple(values))


def _branch_text(inspector: Inspector, one: TakenBranch) -> str:
    arrow = "=>" if one.kind == "exception" else "->"
    return f"cycle {one.cycle:,}: {inspector.where(one.source)} {arrow} {inspector.where(one.target)}"


def _return_address(machine: Machine) -> int:
    """Return the return address that the last exception pushed, 0 if the stack pointer was not in RAM."""
    ram = machine.chip.data["ram"]
    slot = machine.w[STACK_POINTER] - 4
    if slot not in ram or slot + 4 > ram.end:
        return 0
    return (machine.peek(slot + 2) & 0x7F) << 16 | machine.peek(slot) & 0xFFFE


def _is_pending(machine: Machine, irq: int | None) -> bool:
    """Whether an interrupt is both requested and enabled."""
    assert irq is not None
    source = machine.chip.interrupts[irq]
    return all(machine.peek(register) >> bit & 1 for register, bit in (source.flag, source.enable))
