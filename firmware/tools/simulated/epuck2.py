"""An e-puck2's Cortex-M4 in QEMU, driven through the gdb stub; `now` counts instructions that were stepped.

The machine is netduinoplus2 (STM32F405), the nearest that Debian's QEMU has: the same core and UART. Its clock is fixed
by `-icount shift=2`: an instruction takes 4 ns, and the same run comes out the same. A run for its text has
`sleep=off`, so that sleeping takes no time of the host; under the gdb stub that would let the clock run on while the
CPU is looked at.
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
from pathlib import Path

from firmware.tools.simulated.machine import NotInstalled, Stopped, Symbols

QEMU = "qemu-system-arm"
PATIENCE = 60.0
"""Host time limit of one run in seconds."""
_PC, _LR, _XPSR = 15, 14, 25
_IT_STATE = 0x0600FC00


def command(image: Path, serial: str, sleep: str = "off") -> list[str]:
    """Return QEMU's command line; `serial` receives the e-puck2's UART. Raises NotInstalled."""
    if shutil.which(QEMU) is None:
        raise NotInstalled(f"{QEMU} is not installed; Debian package: qemu-system-arm")
    machine = [QEMU, "-M", "netduinoplus2", "-kernel", str(image), "-display", "none", "-monitor", "none"]
    lines = ["-serial", "null", "-serial", "null", "-serial", serial]  # the third is USART3
    return [*machine, *lines, "-icount", f"shift=2,sleep={sleep}"]


def run_until(image: Path, text: bytes, seconds: float = 5 * PATIENCE) -> bytes:
    """Return the UART's output up to a match of the regular expression `text`.

    Raises Stopped with what came instead, NotInstalled.
    """
    process = subprocess.Popen(
        command(image, "stdio"), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert process.stdout is not None
    os.set_blocking(process.stdout.fileno(), False)
    heard = b""
    end = time.monotonic() + seconds
    try:
        while not re.search(text, heard):
            heard += process.stdout.read() or b""
            if time.monotonic() > end or process.poll() is not None:
                raise Stopped(f"no {text!r} after {heard!r}")
            time.sleep(0.01)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    return heard


class Epuck2:
    """A CPU at its reset vector. Raises NotInstalled."""

    pointer = 4

    def __init__(self, image: Path) -> None:
        self.symbols = Symbols(image)
        self.now = 0
        self._folder = Path(tempfile.mkdtemp(prefix="openswarm-qemu-"))
        address = str(self._folder / "gdb")
        self._uart = self._folder / "uart"
        listening = ["-chardev", f"socket,path={address},server=on,wait=off,id=gdb", "-gdb", "chardev:gdb", "-S"]
        self._process = subprocess.Popen(
            [*command(image, f"file:{self._uart}", "on"), *listening],
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
        return self._register(_PC)

    def step(self) -> None:
        if not self._ask("s").startswith("T05"):
            raise Stopped("QEMU does not step")
        self.now += 1

    def store(self, address: int, value: int) -> None:
        """Write by a store of the CPU, because the stub cannot write to the registers of NVIC and SCB.

        The firmware has `inject_store`, whose first instruction stores r1 at r0. It alone is executed, no interrupt
        is taken and no time passes; then the CPU is at its previous address, also inside an IT block."""
        before = {number: self._ask(f"p{number:x}") for number in (0, 1, _PC, _XPSR)}
        flags = int.from_bytes(bytes.fromhex(before[_XPSR]), "little") & ~_IT_STATE
        wanted = {0: address, 1: value, _PC: self.symbols["inject_store"], _XPSR: flags}
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

    def peek_bytes(self, address: int, count: int) -> bytes:
        return bytes.fromhex(self._ask(f"m{address:x},{count:x}"))

    def poke_bytes(self, address: int, data: bytes) -> None:
        if self._ask(f"M{address:x},{len(data):x}:{data.hex()}") != "OK":
            raise Stopped(f"QEMU does not write to {address:#x}")

    def return_address(self) -> int:
        return self._register(_LR) & ~1

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
