"""`emu run`: run a firmware image and show its UART output."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Final, TextIO

from emu.boards import BOARDS
from emu.commands import kilobot_board
from emu.commands.board_options import add_board_options, add_watch_option, board_of, links_of, set_up, start_watch
from emu.commands.image_option import add_chip_option, image_of
from emu.host.command import CommandError, Parser, cycles, seconds
from emu.host.exit_status import DONE, FAULT
from emu.host.files import atomic_text_file
from emu.image.model import Image
from emu.run.input_log import HEADER, TimestampedInput, read_input_log
from emu.run.session import FOREVER, Session
from emu.run.summary import RunResult, firmware_status, report
from emu.run.uart_backends import SPECIFICATIONS, ConsolePort, open_port

if TYPE_CHECKING:
    from emu.api import Machine
    from emu.dspic30f.isa.row import Insn
    from emu.instruments.trace import Tracer
    from emu.instruments.vcd import WaveformRecorder
    from emu.machine.stops import Stop

STATISTICS: Final = "os_statistics"
REFUSED: Final = 6
"""Offset of `refused` in sys_statistics (firmware/openswarm/include/openswarm.h)."""
CLOCK_RUNS: Final = 1 << 15
"""TON of T1CON, OpenSwarm's clock, which Sys_Start_Kernel starts (firmware/openswarm/port/dspic30f)."""

DESCRIPTION: Final = """\
Run a firmware image and show its UART output.

The run ends when the firmware sleeps without a wake-up source, executes the debugger word DA4000, faults, or
reaches the limit; Ctrl-C ends it cleanly. The last line, on stderr, gives reason, address and time.

Exit status: 0 firmware ended or limit reached, 1 firmware fault, 2 bad input.
With --exit-code: the firmware's own status (main's result, low 8 bits), 124 limit, 125 fault, 126 bad input."""


def parser() -> Parser:
    made = Parser("run", DESCRIPTION, "emu run firmware.elf --seconds 5 --uart2 log.txt")
    made.add_argument("image", metavar="IMAGE", help="ELF executable or Intel HEX file")
    add_chip_option(made)
    limit = made.add_mutually_exclusive_group()
    limit.add_argument("--seconds", metavar="S", type=seconds, help="stop after S simulated seconds")
    limit.add_argument("--cycles", metavar="N", type=cycles, help="stop after N instruction cycles")
    made.add_argument("--uart1", metavar="WHERE", help=f"{SPECIFICATIONS} (default -: stdout and stdin)")
    made.add_argument("--uart2", metavar="WHERE", default="none", help=f"{SPECIFICATIONS} (default none)")
    made.add_argument(
        "--break", dest="breaks", metavar="SYM|ADDR", action="append", default=[], help="stop there; may be repeated"
    )
    made.add_argument(
        "--trace",
        metavar="FILE",
        help="write cycle, PC, disassembly and changed registers (-: stdout, UART1 is silent then)",
    )
    made.add_argument("--vcd", metavar="FILE", help="write pins and UART bytes as a waveform (GTKWave)")
    made.add_argument(
        "--vcd-watch",
        metavar="LIST",
        type=lambda text: [name.strip() for name in text.split(",") if name.strip()],
        default=[],
        help="add ipl, asleep, thread and variables to the waveform; a register is slow",
    )
    made.add_argument("--json", action="store_true", help="print one JSON object instead of text; UARTs go into it")
    made.add_argument("--exit-code", action="store_true", help="use the firmware's status as the exit status")
    made.add_argument("--engine", metavar="NAME", default="auto", help="auto, jit or plain (default auto)")
    made.add_argument(
        "--ipl-slip", type=int, choices=(0, 1), default=0, help="1: one interrupt may slip through after raising IPL"
    )
    made.add_argument("--record", metavar="FILE", help="write every input with the cycle of its arrival")
    made.add_argument("--replay", metavar="FILE", help="take input from a recorded file instead")
    made.add_argument("--pace", choices=("realtime",), help="run no faster than the real robot")
    made.add_argument(
        "--strict",
        action="store_true",
        help="null pointers, uninitialised reads and stores into another thread's stack are faults (slow)",
    )
    made.add_argument("--stats", action="store_true", help="print statistics of the engine")
    made.add_argument(
        "--dump-native",
        metavar="PLACE",
        help="print the native code compiled for a function or address (0x...), with its source instructions",
    )
    add_board_options(made, (*BOARDS, kilobot_board.BOARD))
    kilobot_board.add_options(made)
    add_watch_option(made)
    return made


def run(options: argparse.Namespace) -> int:
    """Run the command. Return the exit status as listed in DESCRIPTION."""
    if options.board == kilobot_board.BOARD:
        return kilobot_board.run(options, parser())
    kilobot_board.refuse_options(options)
    if options.json and options.dump_native:
        raise CommandError("only one of --dump-native and --json can use standard output")
    image = image_of(options)
    _print_warnings(image)
    machine = _machine(options, image)
    native_address = _native_address(machine, options.dump_native) if options.dump_native else None
    replay = _replay(options, machine) if options.replay else []
    with ExitStack() as stack:
        result = _run_session(options, machine, image, replay, stack)
    status = _status(options, machine, image, result.stop)
    report(machine, image, result, status, as_json=options.json, with_statistics=options.stats)
    if native_address is not None:
        _dump_native(native_address, machine, image, options.dump_native)
    return status


def _print_warnings(image: Image) -> None:
    """Print the loader's warnings on standard error."""
    for warning in image.warnings:
        print(f"emu run: warning: {image.path}: {warning}", file=sys.stderr)


def _run_session(
    options: argparse.Namespace, machine: Machine, image: Image, replay: list[TimestampedInput], stack: ExitStack
) -> RunResult:
    """Open the files and ports of the run in `stack`, and run until a stop."""
    captured: dict[int, bytearray] = {}
    ports = _ports(options, stack, captured)
    advance = _instruments(options, machine, image, stack)
    record = stack.enter_context(_recording(options.record)) if options.record else None
    session = Session(
        machine,
        ports,
        limit=_limit(options, machine),
        replay=replay,
        record=record,
        realtime=options.pace == "realtime",
        advance=advance,
        links=links_of(machine),
    )
    end_watch = start_watch(machine, options)
    stop, host_seconds = session.run()
    end_watch()
    lost = {number: port.lost for number, port in ports.items() if port.lost}
    return RunResult(_checked_start(machine, image, stop), host_seconds, lost, captured)


def _instruments(options: argparse.Namespace, machine: Machine, image: Image, stack: ExitStack) -> Any:
    """Open trace and waveform files in `stack`. Return the function that runs the machine; None without instruments."""
    advance: Any = None
    if options.trace:
        tracer = _tracer(machine, image, stack.enter_context(atomic_text_file(options.trace)))
        stack.callback(tracer.close)
        advance = tracer.advance
    if options.vcd:
        waveforms = _waveforms(options, machine, stack.enter_context(atomic_text_file(options.vcd)), advance)
        stack.callback(waveforms.close)
        advance = waveforms.advance
    elif options.vcd_watch:
        raise CommandError("--vcd-watch needs --vcd FILE")
    return advance


def _checked_start(machine: Machine, image: Image, stop: Stop) -> Stop:
    """Return `stop`, or a fault if the firmware called the OpenSwarm kernel without ever starting it."""
    if stop.reason not in ("halt", "limit", "interrupted"):
        return stop
    refused = _refused_before_start(machine, image)
    if not refused:
        return stop
    from emu.debug.fault_report import never_started

    return never_started(machine, stop, refused)


def _status(options: argparse.Namespace, machine: Machine, image: Image, stop: Stop) -> int:
    """Return the exit status as listed in DESCRIPTION."""
    if options.exit_code:
        return firmware_status(machine, image, stop)
    return FAULT if stop.reason == "fault" else DONE


def _native_address(machine: Machine, text: str) -> int:
    """Return the address for --dump-native.

    Raises CommandError for an unknown address, or for an engine without native code.
    """
    from emu.dspic30f.jit.engine import JitEngine

    if not isinstance(machine.runner, JitEngine):
        raise CommandError(f"--dump-native: the engine {machine.engine} compiles no native code")
    try:
        return machine.program_address(int(text, 16) if text.lower().startswith("0x") else text)
    except (KeyError, ValueError) as error:
        raise CommandError(f"--dump-native: {error.args[0]}") from None


def _dump_native(address: int, machine: Machine, image: Image, text: str) -> None:
    """Print the native code compiled for an address or function. Raises CommandError if there is none."""
    from emu.debug.disassembly import instruction
    from emu.dspic30f.jit.dump import dump
    from emu.dspic30f.jit.engine import JitEngine

    assert isinstance(machine.runner, JitEngine)  # checked by _native_address

    def text_of(pc: int, insn: Insn) -> str:
        item = instruction(image, pc, insn.word1, insn.word2)
        return "" if item is None else item.text

    def is_selected(pc: int) -> bool:
        function = None if text.lower().startswith("0x") else image.symbols.code(pc)
        return pc == address if function is None else function[0].address == address

    listings = list(dump(machine.runner, is_selected, text_of))
    if not listings:
        raise CommandError(f"--dump-native: no native code was compiled for {text}: it was executed too rarely")
    print("\n".join(listings))


def _refused_before_start(machine: Machine, image: Image) -> int:
    """Return the number of calls refused by an OpenSwarm kernel that was never started, 0 if it was started."""
    kernel = image.symbols.find(STATISTICS)
    if kernel is None or machine.peek("T1CON") & CLOCK_RUNS:
        return 0
    return machine.peek(kernel.address + REFUSED)


def _machine(options: argparse.Namespace, image: Image) -> Machine:
    """Return the machine with the image loaded and breakpoints set. It reports accesses to unmodelled registers."""
    from emu.api import Machine

    try:
        machine = Machine(
            image.chip, engine=options.engine, ipl_slip=options.ipl_slip, board=board_of(options), strict=options.strict
        )
    except ValueError as error:
        raise CommandError(str(error)) from None
    measure_time = getattr(machine.runner, "measure_time", None)
    if options.stats and measure_time is not None:
        measure_time()
    machine.load(image)
    set_up(machine, options)
    for address in _addresses(image, options.breaks):
        machine.hook_pc(address, lambda: True)

    def report(address: int, is_write: bool) -> None:
        name = image.register_names.get(address, f"address {address:#06x}")
        note(f"{name} is {'written' if is_write else 'read'}", "but has no model; it behaves as plain memory")

    def note(what: str, how: str) -> None:
        here = machine.pc - 2  # PC points to the next instruction; no two-word instruction accesses a register
        print(f"emu run: note: {what} at {here:#08x} ({image.symbols.text(here)}) {how}", file=sys.stderr)

    machine.bus.report = report
    machine.bus.note = lambda what: note("a device is configured", f"for an unmodelled function: {what}")
    return machine


def _addresses(image: Image, places: list[str]) -> set[int]:
    if not places:
        return set()
    from emu.commands.disasm import code_address

    return {code_address(image, place) for place in places}


def _replay(options: argparse.Namespace, machine: Machine) -> list[TimestampedInput]:
    try:
        return read_input_log(options.replay, tuple(machine.uart))
    except ValueError as error:
        raise CommandError(str(error)) from None


def _ports(options: argparse.Namespace, stack: ExitStack, captured: dict[int, bytearray]) -> dict[int, ConsolePort]:
    """Open the ports of both UARTs. With --json, capture their output for standard output."""
    texts = [options.trace, options.record]
    places = {1: options.uart1 or ("none" if "-" in texts else "-"), 2: options.uart2}
    if [*places.values(), *texts].count("-") + (options.json and "-" in texts) > 1:
        raise CommandError("only one of the UARTs, --trace, --record and --json can use standard output")
    ports = {}
    for number, place in places.items():
        try:
            port = open_port(place, number, with_input=not options.replay)
        except ValueError as error:
            raise CommandError(str(error)) from None
        stack.callback(port.close)
        if options.json and place == "-":
            port.capture = captured[number] = bytearray()
        ports[number] = port
    return ports


@contextlib.contextmanager
def _recording(path: str) -> Iterator[TextIO]:
    with atomic_text_file(path) as stream:
        print(HEADER, file=stream)
        yield stream


def _limit(options: argparse.Namespace, machine: Machine) -> int:
    if options.cycles is not None:
        return int(options.cycles)
    if options.seconds is not None:
        return max(1, int(options.seconds * Fraction(machine.peripherals.fcy)))
    return FOREVER


def _tracer(machine: Machine, image: Image, stream: TextIO) -> Tracer:
    from emu.instruments.trace import Tracer

    try:
        return Tracer(machine, image, stream)
    except ValueError as error:
        raise CommandError(str(error)) from None


def _waveforms(options: argparse.Namespace, machine: Machine, stream: TextIO, advance: Any) -> WaveformRecorder:
    from emu.instruments.vcd import WaveformRecorder

    if advance is not None and options.vcd_watch:
        raise CommandError("--vcd-watch and --trace: give one of them")
    try:
        return WaveformRecorder(machine, stream, options.vcd_watch, advance)
    except ValueError as error:
        raise CommandError(str(error)) from None
