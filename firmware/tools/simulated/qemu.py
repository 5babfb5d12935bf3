"""An e-puck2's Cortex-M4 or a RISC-V in QEMU, driven through the gdb stub; `now` counts instructions that were stepped.

The e-puck2 runs on QEMU's machine netduinoplus2 (STM32F405), which has the same core and UART. `-icount` gives each
instruction a constant time, so that runs repeat exactly. A run that only collects text uses `sleep=off`: the sleep of
the CPU then takes no host time. The gdb stub cannot use it, because the clock would run while the CPU is stopped.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from firmware.tools.simulated.machine import NotInstalled, Stopped, Symbols

PATIENCE = 60.0
"""Host time limit of one run in seconds."""
MOST_BYTES = 2000
"""Bytes of memory in one answer of QEMU's gdb stub, whose packets have at most 4,096 characters."""


@dataclass(frozen=True)
class Board:
    """A machine of QEMU; registers by their numbers in gdb's protocol."""

    program: str
    package: str
    """Debian package of the program."""
    machine: tuple[str, ...]
    """Arguments that choose the machine and leave UART1 as the next serial line."""
    shift: int
    """An instruction takes 2 ** shift ns."""
    pc: int
    link: int
    """Return address of a function."""
    argument: int
    """First argument of a function; the second is the next register."""
    status: int | None = None
    """Register that holds the state of a conditional block, which `store` must leave."""
    conditional: int = 0
    """Bits of that state."""

    def command(self, image: Path, serial: str, sleep: str = "off") -> list[str]:
        """Return QEMU's command line; `serial` receives UART1. Raises NotInstalled."""
        if shutil.which(self.program) is None:
            raise NotInstalled(f"{self.program} is not installed; Debian package: {self.package}")
        quiet = ["-display", "none", "-monitor", "none"]
        clock = ["-icount", f"shift={self.shift},sleep={sleep}"]
        return [self.program, *self.machine, "-kernel", str(image), *quiet, "-serial", serial, *clock]


EPUCK2 = Board(
    "qemu-system-arm",
    "qemu-system-arm",
    ("-M", "netduinoplus2", "-serial", "null", "-serial", "null"),  # the third is USART3
    shift=2,
    pc=15,
    link=14,
    argument=0,
    status=25,
    conditional=0x0600FC00,
)
QEMU_VIRT = Board(
    "qemu-system-riscv32", "qemu-system-misc", ("-M", "virt", "-bios", "none"), shift=5, pc=32, link=1, argument=10
)


def run_until(board: Board, image: Path, text: bytes, seconds: float = 5 * PATIENCE) -> bytes:
    """Return UART1's output up to a match of the regular expression `text`.

    Raises Stopped with the output received instead, or NotInstalled.
    """
    process = subprocess.Popen(
        board.command(image, "stdio"), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert process.stdout is not None
    os.set_blocking(process.stdout.fileno(), False)
    heard = b""
    end = time.monotonic() + seconds
    try:
        while not re.search(text, heard):
            ended = time.monotonic() > end or process.poll() is not None  # before the last bytes are read
            heard += process.stdout.read() or b""
            if ended and not re.search(text, heard):
                raise Stopped(f"no {text!r} after {heard!r}")
            time.sleep(0.01)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    return heard


def run(board: Board, image: Path, seconds: float = PATIENCE) -> tuple[int, bytes]:
    """Return QEMU's exit status and UART1's output, of a program that ends QEMU. Raises Stopped, NotInstalled."""
    try:
        done = subprocess.run(
            board.command(image, "stdio"), stdin=subprocess.DEVNULL, capture_output=True, timeout=seconds, check=False
        )
    except subprocess.TimeoutExpired as expired:
        raise Stopped(f"QEMU still runs after {seconds:g} s and {expired.stdout!r}") from None
    return done.returncode, done.stdout


class Qemu:
    """A CPU at its reset vector. Raises NotInstalled."""

    pointer = 4

    def __init__(self, board: Board, image: Path, symbols: Symbols | None = None) -> None:
        """Start QEMU. symbols: those of the image, if they were read before."""
        self.board = board
        self.symbols = symbols or Symbols(image)
        self.now = 0
        self._folder = Path(tempfile.mkdtemp(prefix="openswarm-qemu-"))
        address = str(self._folder / "gdb")
        self._uart = self._folder / "uart"
        listening = ["-chardev", f"socket,path={address},server=on,wait=off,id=gdb", "-gdb", "chardev:gdb", "-S"]
        self._process = subprocess.Popen(
            [*board.command(image, f"file:{self._uart}", "on"), *listening],
            stdin=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            self._socket = self._connect(address)
            self._ask("QStartNoAckMode")
            self._socket.sendall(b"+")
            self._ask("qXfer:features:read:target.xml:0,ffb")  # permits writes of single registers
            self._ask("Qqemu.sstep=5")  # takes interrupts while stepping, with the clock stopped
        except BaseException:
            self.close()
            raise

    def _connect(self, address: str) -> socket.socket:
        end = time.monotonic() + PATIENCE
        while True:
            made = socket.socket(socket.AF_UNIX)
            try:
                made.connect(address)
            except OSError:
                made.close()
                if time.monotonic() > end or self._process.poll() is not None:
                    raise Stopped("QEMU does not answer") from None
                time.sleep(0.02)
            else:
                made.settimeout(PATIENCE)
                return made

    def _ask(self, question: str) -> str:
        """Send one packet of the remote serial protocol and return its answer."""
        payload = question.encode()
        self._socket.sendall(b"$" + payload + b"#%02x" % (sum(payload) % 256))
        answer = b""
        try:
            while b"#" not in answer or len(answer) - answer.index(b"#") < 3:
                part = self._socket.recv(65536)
                if not part:
                    raise Stopped("QEMU has gone")
                answer += part
        except TimeoutError:
            raise Stopped(
                f"no answer to {question[:20]} after {PATIENCE:g} s: the firmware never comes there"
            ) from None
        begin = answer.index(b"$") + 1
        return answer[begin : answer.index(b"#", begin)].decode()

    def _register(self, number: int) -> int:
        return int.from_bytes(bytes.fromhex(self._ask("g")[8 * number : 8 * number + 8]), "little")

    @property
    def pc(self) -> int:
        return self._register(self.board.pc)

    def step(self) -> None:
        if not self._ask("s").startswith("T05"):
            raise Stopped("QEMU does not step")
        self.now += 1

    def store(self, address: int, value: int) -> None:
        """Write by a store of the CPU, because the stub cannot write to the registers of devices.

        The firmware has `inject_store`, whose first instruction stores its second argument at the first. It alone is
        executed, no interrupt is taken and no time passes; then the CPU is at its previous address, also inside an IT
        block."""
        board = self.board
        wanted = {board.argument: address, board.argument + 1: value, board.pc: self.symbols["inject_store"]}
        status = [] if board.status is None else [board.status]
        before = {number: self._ask(f"p{number:x}") for number in (*wanted, *status)}
        for number in status:
            wanted[number] = int.from_bytes(bytes.fromhex(before[number]), "little") & ~board.conditional
        for number, content in wanted.items():
            self._set(number, content.to_bytes(4, "little").hex())
        self._ask("Qqemu.sstep=7")
        self._ask("s")
        self._ask("Qqemu.sstep=5")
        for number, text in before.items():
            self._set(number, text)

    def _set(self, number: int, text: str) -> None:
        if self._ask(f"P{number:x}={text}") != "OK":
            raise Stopped(f"QEMU does not write to register {number}")

    def run_to(self, *places: str | int) -> int:
        addresses = [self.symbols[place] if isinstance(place, str) else place for place in places]
        if self.pc in addresses:
            self.step()
        for address in addresses:
            self._ask(f"Z0,{address:x},2")
        self._ask("c")
        for address in addresses:
            self._ask(f"z0,{address:x},2")
        return self.pc

    def run_to_end(self) -> int:
        """Run until the program ends QEMU and return its exit status. Raises Stopped."""
        self._socket.sendall(b"$c#63")
        try:
            return self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            raise Stopped(f"QEMU still runs after {PATIENCE:g} s") from None

    def peek_bytes(self, address: int, count: int) -> bytes:
        sizes = [min(MOST_BYTES, count - done) for done in range(0, count, MOST_BYTES)]
        places = range(address, address + count, MOST_BYTES)
        parts = (self._ask(f"m{place:x},{size:x}") for place, size in zip(places, sizes, strict=True))
        return bytes.fromhex("".join(parts))

    def poke_bytes(self, address: int, data: bytes) -> None:
        if self._ask(f"M{address:x},{len(data):x}:{data.hex()}") != "OK":
            raise Stopped(f"QEMU does not write to {address:#x}")

    def return_address(self) -> int:
        return self._register(self.board.link) & ~int(self.symbols.thumb)

    def uart(self) -> bytes:
        """Return all output of the UART so far."""
        return self._uart.read_bytes() if self._uart.exists() else b""

    def close(self) -> None:
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGKILL)
        self._process.wait()
        if hasattr(self, "_socket"):
            self._socket.close()
        shutil.rmtree(self._folder, ignore_errors=True)
