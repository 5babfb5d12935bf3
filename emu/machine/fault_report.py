"""Why a run ended badly, told so that one finds the bug: what, where, with which values, in which thread, after what.

What enters: a machine that has stopped, what it kept on the way (`machine.Evidence`). What leaves: the `Stop` with a
`Fault`, or as it was when the firmware simply ended. A trap that is handled is none, unless the firmware never comes
back from it; a kernel that stops itself is one. An unhandled exception is seen as its vector's handler being a
debugger word: both XC16's linker and ours put one into vectors without a function (abi-elf.md §3.3).

The report is about the moment it went wrong, which is often long before the stop: the machine is put back to it, aside.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING, Any, Final

from emu.chips.chip import Vector
from emu.debug.dwarf.location import Unavailable
from emu.debug.inspector import Frame, Inside
from emu.debug.replay import Branch, Trail, aside, trail
from emu.debug.threads import Threads
from emu.dspic30f.exceptions.faults import RESTART
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.debug import FAILED_CHECK, PLAIN_TRAP
from emu.dspic30f.state.state import IPL3, STACK_POINTER
from emu.image.model import ERASED

if TYPE_CHECKING:
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

TRAPS: Final = {
    "OscillatorFail": ("OSCFAIL", "oscillator failure trap"),
    "AddressError": ("ADDRERR", "address error trap"),
    "StackError": ("STKERR", "stack error trap"),
    "MathError": ("MATHERR", "math error trap"),
}
"""By vector: flag of INTCON1 (isa.md §14.4), and what to call it."""
STOP_FUNCTION: Final = "hal_stop"
"""Where OpenSwarm goes to sleep after a failed assertion or a fatal trap (firmware/openswarm/hal/hal_cpu.h)."""
MESSENGERS: Final = frozenset((STOP_FUNCTION, "stop", "os_trap", "Sys_Assertion_Failed", "__assert_fail", "abort"))
"""Functions that tell of a fault and are not where it is."""
TRAP_FUNCTION: Final = "os_trap"
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
"""clang's SanitizerHandler numbers (clang 20, CodeGen/SanitizerHandler.h; the tests compile the usual ones); what is
not listed is told by number."""
VECNUM: Final = 0x3F
"""Field of INTTREG: slot of the exception entered last (isa.md §14.4)."""
FRAMES_TOLD: Final = 12


@dataclass(frozen=True, slots=True)
class At:
    """One entry of the report's call stack."""

    pc: int
    function: str
    line: str | None
    kind: str
    variables: tuple[tuple[str, str], ...] = ()
    """Name and value of parameters and locals, of the innermost entries."""


@dataclass(frozen=True, slots=True)
class Fault:
    """What went wrong and where. `pc` is the culprit, as well as it can be known."""

    cause: str
    pc: int
    cycle: int
    where: str = ""
    """`pc` with function and source line."""
    symbol: str | None = None
    line: str | None = None
    thread: str | None = None
    """`thread 1 (worker)` of an OpenSwarm firmware."""
    frames: tuple[At, ...] = ()
    """The call stack at `pc`, innermost first, through interrupts."""
    branches: tuple[Branch, ...] = ()
    """The last branches before it, oldest first; empty if the machine was not run by `run` or the command line."""
    branch_texts: tuple[str, ...] = ()

    @property
    def function(self) -> str | None:
        """The function it happened in, None outside the program."""
        return self.frames[0].function if self.frames else None

    def report(self) -> str:
        """All of it in lines for people."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        yield f"firmware fault: {self.cause} at {self.where}" + (f" in {self.thread}" if self.thread else "")
        for number, frame in enumerate(self.frames[:FRAMES_TOLD]):
            note = f"  <{frame.kind}>" if frame.kind != "call" else ""
            yield f"  #{number} {frame.function} at {frame.line or f'{frame.pc:#08x}'}{note}"
            for name, value in frame.variables:
                yield f"       {name} = {value}"
        if len(self.frames) > FRAMES_TOLD:
            yield f"  ... and {len(self.frames) - FRAMES_TOLD} more"
        if self.branches:
            yield "  last branches, newest first:"
        for _, same in groupby(
            zip(reversed(self.branches), reversed(self.branch_texts), strict=True),
            lambda one: (one[0].source, one[0].target),
        ):
            times = [text for _, text in same]
            yield f"    {times[0]}" + (f", {len(times)} times" if len(times) > 1 else "")

    def facts(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "cause": self.cause,
            "pc": self.pc,
            "cycle": self.cycle,
            "symbol": self.symbol,
            "line": self.line,
            "thread": self.thread,
            "frames": [asdict(at) | {"variables": dict(at.variables)} for at in self.frames],
            "branches": [
                {"from": one.source, "to": one.target, "cycle": one.cycle, "kind": one.kind, "text": text}
                for one, text in zip(self.branches, self.branch_texts, strict=True)
            ],
        }


@dataclass(slots=True)
class _Case:
    """What is known of a fault before the machine is put back to it."""

    cause: str
    pc: int
    cycle: int
    scene: bytes | None = None
    """State in which it had just happened; None: the present one."""
    began: bytes | None = None
    """State to find the way from."""
    vector: Vector | None = None
    is_exact: bool = False
    """`pc` is the instruction that did it."""


def explained(machine: Machine, stop: Stop) -> Stop:
    """`stop` as a fault if it is one."""
    inside = Inside(machine)
    case = _case(machine, inside, stop)
    if case is None:
        return stop
    fault = _told(machine, inside, case)
    return replace(stop, reason="fault", fault=fault)


def never_started(machine: Machine, stop: Stop, refused: int) -> Stop:
    """The end of a whole run as a fault: a kernel that was never started refused so many calls."""
    calls = "a call that needs" if refused == 1 else f"{refused:,} calls that need"
    cause = f"the kernel was never started (Sys_Start_Kernel) and refused {calls} it to run; ended"
    case = _Case(cause, stop.pc, stop.cycle, is_exact=True)
    return replace(stop, reason="fault", fault=_told(machine, Inside(machine), case))


def standing(machine: Machine, why: str) -> Fault:
    """Where a machine stands that has done nothing wrong, told like a fault: thread, call stack, last branches."""
    return _told(machine, Inside(machine), _Case(why, machine.pc, machine.cycle, None, machine.evidence.began))


def _case(machine: Machine, inside: Inside, stop: Stop) -> _Case | None:
    evidence = machine.evidence
    if stop.reason == "fault":
        reset = evidence.reset
        return _Case(stop.detail, stop.pc, stop.cycle, reset, evidence.began, is_exact=reset is not None)
    in_trap = bool(machine.peek("CORCON") & IPL3)
    if stop.reason == "breakpoint":
        return _debug_word(machine, inside, stop, in_trap)
    if inside.name_of(stop.pc) == STOP_FUNCTION and stop.reason == "halt":
        if evidence.trap is not None and (in_trap or TRAP_FUNCTION in {one.function for one in inside.frames()}):
            return _trap_case(machine, evidence.trap, stop)
        return _Case("the kernel stopped the system; UART1 said why,", stop.pc, stop.cycle, None, evidence.began)
    if in_trap:
        if evidence.trap is not None:
            case = _trap_case(machine, evidence.trap, stop)
            case.cause += ", in whose handler the firmware went to sleep,"
            return case
        name = machine.chip.vectors[machine.peek("INTTREG") & VECNUM].name
        return _Case(f"{name} trap, in whose handler the firmware went to sleep,", stop.pc, stop.cycle)
    return None


def _debug_word(machine: Machine, inside: Inside, stop: Stop, in_trap: bool) -> _Case | None:
    """A check of the compiler that failed, an exception nobody handles, or (None) an end."""
    program, image = machine.program, inside.image
    check = program.word(stop.pc + 4) - FAILED_CHECK
    if program.word(stop.pc + 2) == RESET_WORD and 0 <= check <= PLAIN_TRAP:
        what = CHECKS.get(check, f"check {check}")
        cause = f"{what}," if check == PLAIN_TRAP else f"undefined behaviour: {what},"
        return _Case(cause, stop.pc, stop.cycle, None, machine.evidence.began, is_exact=True)
    vectors = [one for one in image.chip.vectors if stop.pc in (image.word(one.ivt), image.word(one.aivt))]
    if not vectors:
        return None
    if in_trap and machine.evidence.trap is not None:
        case = _trap_case(machine, machine.evidence.trap, stop)
        case.cause += ", no handler,"
        return case
    for vector in vectors:
        if vector.irq in machine.chip.interrupts and _is_pending(machine, vector.irq):
            back = _return_address(machine) or stop.pc
            return _Case(f"{vector.name}, no handler,", back, stop.cycle)
    return None


def _trap_case(machine: Machine, trap: tuple[Vector, bytes, bytes | None], stop: Stop) -> _Case:
    vector, scene, began = trap
    cause = TRAPS[vector.name][1] if vector.name in TRAPS else f"{vector.name} trap"
    with aside(machine, scene):
        pc, cycle = machine.pc, machine.cycle
    return _Case(cause, pc, cycle, scene, began, vector)


def _told(machine: Machine, inside: Inside, case: _Case) -> Fault:
    """Put the machine back to the culprit and look around."""
    way = _way(machine, case)
    wild = _wild_jump(inside, case, way)
    culprit_cycle = None
    if way is not None and way.last is not None and (case.vector is not None or not case.is_exact):
        case.pc, culprit_cycle = way.last, way.cycle
        case.is_exact = True
    if wild is not None:
        case.pc, culprit_cycle, case.is_exact = wild.source, wild.cycle, True
        case.cause = _jump_text(machine, inside, wild, case.cause)
    with ExitStack() as stack:
        if culprit_cycle is not None and case.began is not None:
            stack.enter_context(aside(machine, case.began))
            machine.run_until(culprit_cycle)
        elif case.scene is not None:
            stack.enter_context(aside(machine, case.scene))
        if not case.is_exact and case.vector is not None:
            case.pc = _guessed(inside, case)
        case.cause = _with_details(machine, inside, case, way)
        frames = inside.frames(case.pc)
        if inside.name_of(case.pc) in MESSENGERS:
            frames = [frame for frame in frames if frame.function not in MESSENGERS] or frames
            case.pc = frames[0].pc
        thread = _thread(inside)
        entries = tuple(_entry(inside, frame, number < 2) for number, frame in enumerate(frames))
    branches = way.branches if way is not None else ()
    symbol = inside.image.symbols.text(case.pc) if inside.is_code(case.pc) else None
    line = inside.image.lines.find(case.pc)
    return Fault(
        case.cause, case.pc, case.cycle, inside.where(case.pc), symbol, str(line) if line else None, thread or None,
        entries, branches, tuple(_branch_text(inside, one) for one in branches),
    )  # fmt: skip


def _way(machine: Machine, case: _Case) -> Trail | None:
    """How it came to that; of a trap up to the instruction that asked for it."""
    if case.began is None:
        return None
    if case.cause == RESTART:
        return trail(machine, case.began, case.cycle, lambda: not machine.pc and machine.cycle == case.cycle)
    if case.vector is None:
        return trail(machine, case.began, case.cycle)
    flag = 1 << machine.chip.sfrs["INTCON1"].fields[TRAPS[case.vector.name][0]][0] if case.vector.name in TRAPS else 0
    return trail(machine, case.began, case.cycle, lambda: bool(machine.state.intcon1 & flag))


def _wild_jump(inside: Inside, case: _Case, way: Trail | None) -> Branch | None:
    """The branch that left the program, if one did and the program never came back."""
    if way is None:
        return None
    if case.cause == RESTART:
        return next((one for one in reversed(way.branches) if one.target == 0), None)
    if inside.is_code(way.last if way.last is not None else case.pc):
        return None
    return next((one for one in reversed(way.branches) if inside.is_code(one.source)), None)


def _jump_text(machine: Machine, inside: Inside, jump: Branch, cause: str) -> str:
    word = machine.program.word(jump.source)
    insn = decode_for_execution(word, machine.program.word(jump.source + 2))
    name = insn.row.mnemonic if insn is not None else ""
    verb = "call to" if "CALL" in name else "return to" if name.startswith("RET") else "jump to"
    if jump.target == 0:
        what = " (a null function pointer?)" if verb == "call to" else ""
        return f"{verb} address 0{what}"
    nothing = "erased flash" if machine.program.word(jump.target) == ERASED else "no code of the program"
    return f"{verb} {jump.target:#08x}, where there is {nothing} ({cause.rstrip(',')}),"


def _guessed(inside: Inside, case: _Case) -> int:
    """The culprit of a trap from what it pushes: a division its own address, the others what follows (isa.md §14.4)."""
    assert case.vector is not None
    if case.vector.name == "MathError":
        return case.pc
    return case.pc - 2 if inside.is_code(case.pc - 2) else case.pc


def _with_details(machine: Machine, inside: Inside, case: _Case, way: Trail | None) -> str:
    """The cause, with what the registers say about it."""
    if case.vector is None or case.vector.name not in ("AddressError", "StackError"):
        return case.cause
    top, ram = machine.w[STACK_POINTER], machine.chip.data["ram"]
    limit = machine.state.splim if machine.state.limit_armed else ram.end
    deepest = max(top, way.top if way is not None else 0)
    if deepest > limit or deepest >= ram.end:
        return f"stack overflow: W15 is {deepest:#06x}, the limit {limit:#06x} ({case.cause.rstrip(',')}),"
    if top < ram.start:
        return f"stack underflow: W15 is {top:#06x}, below RAM ({case.cause.rstrip(',')}),"
    if way is not None and way.access is not None and case.vector.name == "AddressError":
        address, size, is_write = way.access
        why = "an odd address" if size == 2 and address & 1 else "where no memory is"
        verb = "writing" if is_write else "reading"
        return case.cause.replace("trap", f"trap: {verb} {size} byte{'s' * (size > 1)} at {address:#06x}, {why}", 1)
    return case.cause


def _thread(inside: Inside) -> str:
    try:
        return Threads(inside).running()
    except (Unavailable, KeyError, TypeError, ValueError):
        return ""  # the kernel's variables are part of what is broken


def _entry(inside: Inside, frame: Frame, with_values: bool) -> At:
    values = []
    for one in inside.variables(frame) if with_values else ():
        try:
            values.append((one.name, inside.value(one, frame).text()))
        except Unavailable as why:
            values.append((one.name, f"<{why}>"))
    return At(frame.pc, frame.function, str(frame.line) if frame.line else None, frame.kind, tuple(values))


def _branch_text(inside: Inside, one: Branch) -> str:
    arrow = "=>" if one.kind == "exception" else "->"
    return f"cycle {one.cycle:,}: {inside.where(one.source)} {arrow} {inside.where(one.target)}"


def _return_address(machine: Machine) -> int:
    """What the exception pushed last, 0 if the stack pointer was not in RAM."""
    ram = machine.chip.data["ram"]
    place = machine.w[STACK_POINTER] - 4
    if place not in ram or place + 4 > ram.end:
        return 0
    return (machine.peek(place + 2) & 0x7F) << 16 | machine.peek(place) & 0xFFFE


def _is_pending(machine: Machine, irq: int | None) -> bool:
    """Whether flag and enable of an interrupt are set."""
    assert irq is not None
    source = machine.chip.interrupts[irq]
    return all(machine.peek(register) >> bit & 1 for register, bit in (source.flag, source.enable))
