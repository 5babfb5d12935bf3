"""Compiler from IR text to callable code, with disk cache, compile process and loader.

`request` returns immediately. `lookup` loads cached objects. Other objects come from the compile process, and `poll`
collects them. `compile_now` compiles in this process, for the few objects that the engine needs at its start.

If the compile process dies, it is replaced, and its request is sent again once. If processes die repeatedly, code that
is not yet compiled stays interpreted, and a message on standard error says so.
"""

from __future__ import annotations

import atexit
import os
import selectors
import struct
import subprocess
import sys
import zlib
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from threading import RLock
from typing import Any, Final
from weakref import WeakSet, WeakValueDictionary

from emu.dspic30f.jit.cache import ObjectCache
from emu.dspic30f.jit.worker import REFUSED, REPLY, REQUEST, Backend
from emu.host.paths import native_code


@dataclass(slots=True)
class Statistics:
    """Object counts: requested, compiled, loaded."""

    requested: int = 0
    compiled: int = 0
    loaded: int = 0


MAX_DEATHS: Final = 3
"""Maximum number of compile processes in succession that may die before one has compiled an object."""


@dataclass(slots=True, weakref_slot=True, eq=False)
class LoadedCode:
    """Native code in memory. It is unloaded together with this object."""

    address: int
    """Address of the function `entry`."""
    entries: Sequence[int]
    """Program addresses at which the function can be entered."""
    library: Any
    """LLVM library that owns the code."""


class CompileError(RuntimeError):
    """LLVM rejected generated IR, which is a defect of the translator."""


def pack_object(entries: Sequence[int], code: bytes) -> bytes:
    """Return one byte string that contains an object file and the program addresses at which it can be entered.

    The object file is compressed to about a third, which takes 0.13 ms; unpacking takes 0.03 ms.
    """
    return struct.pack(f"<I{len(entries)}I", len(entries), *entries) + zlib.compress(code, 1)


def unpack_object(blob: bytes) -> tuple[list[int], bytes]:
    """Return the entry addresses and the object file that `pack_object` has packed."""
    (count,) = struct.unpack_from("<I", blob)
    return list(struct.unpack_from(f"<{count}I", blob, 4)), zlib.decompress(memoryview(blob)[4 + 4 * count :])


@cache
def _shared(_where: Path) -> Compiler:
    return Compiler()


def shared_compiler() -> Compiler:
    """Return the compiler that all machines of this process share. It has one compile process and one cache."""
    return _shared(native_code())


class Compiler:
    """Compiler with a cache of objects by key. Each object exports one function, `entry`. It is thread-safe.

    All machines share a loaded object, and the last one unloads it: Linux limits a process to 65,530 mappings
    (vm.max_map_count), and each object takes two.
    """

    def __init__(self, cache: ObjectCache | None = None) -> None:
        self.cache: Final = cache if cache is not None else ObjectCache()
        self.statistics: Final = Statistics()
        self._lock = RLock()
        self._process: subprocess.Popen[bytes] | None = None
        self._selector = selectors.DefaultSelector()
        self._received = bytearray()
        self._waiting: dict[int, tuple[str, Sequence[int]]] = {}
        self._tags: dict[str, list[object]] = {}
        """Tags of the requests that are waiting for an object, by key."""
        self._outbox: deque[tuple[int, int, bytes]] = deque()
        self._in_flight: tuple[int, int, bytes] | None = None
        """(ticket, level, text) of the object that the process is compiling; None if it is idle."""
        self._retried = 0
        """Ticket of the last request that was sent again, to a second process."""
        self._deaths = 0
        """Number of processes that have died since the last compiled object."""
        self._warned = False
        self._tickets = 0
        self._loader: Any = None
        self._modules = 0
        self._ready: list[tuple[object, LoadedCode]] = []
        self._loaded: WeakValueDictionary[str, LoadedCode] = WeakValueDictionary()
        self._backend: Backend | None = None
        self._host = b""
        _compilers.add(self)

    def _host_name(self) -> bytes:
        if not self._host:
            import llvmlite
            import llvmlite.binding as llvm

            name = f"{llvmlite.__version__} {llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
            self._host = name.encode()
        return self._host

    def key(self, level: int, *identity: bytes) -> str:
        """Return the key of an object that is translated from these inputs, compiled at `level`, for this host."""
        return self.cache.key(self._host_name(), bytes([level]), *identity)

    def lookup(self, key: str) -> LoadedCode | None:
        """Return the code with this key if it is in memory or on disk, else None."""
        loaded = self._loaded.get(key)
        if loaded is not None:
            return loaded
        blob = self.cache.get(key)
        if blob is None:
            return None
        try:
            entries, code = unpack_object(blob)
        except (struct.error, zlib.error):  # written by a process whose sources were changed while it ran
            return None
        return self.load(code, key, entries)

    def compile_now(self, text: str, level: int, key: str, entries: Sequence[int] = ()) -> LoadedCode:
        """Compile `text` in this process and load it."""
        if self._backend is None:
            self._backend = Backend()
        code = self._backend.compile(text, level)
        self.statistics.compiled += 1
        self.cache.put(key, pack_object(entries, code))
        return self.load(code, key, entries)

    def request(self, text: str, level: int, key: str, entries: Sequence[int], tag: object) -> None:
        """Compile `text` in the background, once for all requests with this key.

        `poll` will return (tag, code) for each.
        """
        with self._lock:
            if key in self._tags:
                self._tags[key].append(tag)
            else:
                self._tags[key] = [tag]
                self._post(text, level, key, entries)

    def _post(self, text: str, level: int, key: str, entries: Sequence[int]) -> None:
        self.statistics.requested += 1
        self._tickets += 1
        self._waiting[self._tickets] = (key, entries)
        request = (self._tickets, level, text.encode())
        if level:
            self._outbox.append(request)
        else:  # exact code goes first: it compiles quickly and replaces interpretation
            self._outbox.appendleft(request)
        self._send()

    def _send(self) -> None:
        """Send the next request to the idle process. Only one is in flight, because two full pipes would deadlock."""
        while self._outbox and self._in_flight is None:
            if self._deaths >= MAX_DEATHS:
                self._outbox.clear()
                self._waiting.clear()
                self._tags.clear()
                return
            self._in_flight = ticket, level, data = self._outbox.popleft()
            try:
                process = self._start()
                assert process.stdin is not None
                process.stdin.write(REQUEST.pack(ticket, level, len(data)) + data)
                process.stdin.flush()
            except OSError as error:
                self._replace_process(error)

    def _replace_process(self, reason: object) -> None:
        """Replace a compile process that died or did not start, and send its request again, but only once."""
        process, self._process = self._process, None
        if process is not None:
            assert process.stdin is not None
            assert process.stdout is not None
            self._selector.unregister(process.stdout)
            process.kill()
            atexit.unregister(process.kill)
            with suppress(OSError):
                process.stdin.close()
            process.stdout.close()
            reason = f"exit status {process.wait()}"
        self._received.clear()
        self._deaths += 1
        request, self._in_flight = self._in_flight, None
        if request is None:
            return
        if request[0] != self._retried and self._deaths < MAX_DEATHS:
            self._retried = request[0]
            self._outbox.appendleft(request)
            return
        dropped = self._waiting.pop(request[0], None)
        if dropped is not None:
            del self._tags[dropped[0]]
        if not self._warned:
            self._warned = True
            message = f"emu: warning: compile process died ({reason}); code that is not compiled yet is interpreted"
            print(message, file=sys.stderr)

    def poll(self) -> list[tuple[object, LoadedCode]]:
        """Load the code that has arrived since the last call. Raises CompileError for a defect of the translator."""
        if not self._waiting:
            return []
        with self._lock:
            return self._collect()

    def _collect(self) -> list[tuple[object, LoadedCode]]:
        self._send()
        while self._selector.select(0):
            assert self._process is not None
            assert self._process.stdout is not None
            data = os.read(self._process.stdout.fileno(), 1 << 20)
            if not data:
                self._replace_process("it closed its output")
                self._send()
                continue
            self._received += data
            if len(data) < 1 << 16:
                break
        while self._receive():
            pass
        ready, self._ready = self._ready, []
        return ready

    @property
    def busy(self) -> int:
        """Return the number of unfinished requests."""
        return len(self._waiting)

    def load(self, code: bytes, key: str, entries: Sequence[int]) -> LoadedCode:
        """Load the object file `code` into memory under `key`."""
        import llvmlite.binding as llvm

        with self._lock:
            if self._loader is None:
                llvm.initialize_native_target()
                llvm.initialize_native_asmprinter()
                # LLVM's older linker maps sections separately and aborts if two are 2 GB apart in a fragmented process
                self._loader = llvm.create_lljit_compiler(use_jit_link=True)
            self._modules += 1
            library = (
                llvm.JITLibraryBuilder()
                .add_object_img(code)
                .export_symbol("entry")
                .link(self._loader, f"m{self._modules}")
            )
            self.statistics.loaded += 1
            loaded = self._loaded[key] = LoadedCode(int(library["entry"]), entries, library)
            return loaded

    def _start(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "emu.dspic30f.jit.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,
            )
            atexit.register(self._process.kill)
            assert self._process.stdout is not None
            self._selector.register(self._process.stdout, selectors.EVENT_READ)
        return self._process

    def after_fork(self) -> None:
        """Reset the state in a forked process.

        The compile process answers only the parent, so this process sends the requests again to its own one.
        """
        self._lock = RLock()
        self._selector.close()
        self._selector = selectors.DefaultSelector()
        process, self._process = self._process, None
        if process is not None:
            assert process.stdin is not None
            assert process.stdout is not None
            atexit.unregister(process.kill)
            process.stdin.close()
            process.stdout.close()
            process.returncode = 0  # only the parent process may wait for this child
        self._received.clear()
        request, self._in_flight = self._in_flight, None
        if request is not None:
            self._outbox.appendleft(request)

    def _receive(self) -> bool:
        received = self._received
        if len(received) < REPLY.size:
            return False
        ticket, length = REPLY.unpack_from(received)
        if length == REFUSED:
            if len(received) < REPLY.size + 4:
                return False
            (size,) = struct.unpack_from("<I", received, REPLY.size)
            if len(received) < REPLY.size + 4 + size:
                return False
            raise CompileError(bytes(received[REPLY.size + 4 : REPLY.size + 4 + size]).decode())
        end = REPLY.size + length
        if len(received) < end:
            return False
        code = bytes(received[REPLY.size : end])
        del received[:end]
        self._in_flight, self._deaths = None, 0
        self._send()
        key, entries = self._waiting.pop(ticket)
        self.statistics.compiled += 1
        self.cache.put(key, pack_object(entries, code))
        loaded = self.load(code, key, entries)
        self._ready += [(tag, loaded) for tag in self._tags.pop(key)]
        return True


_compilers: Final[WeakSet[Compiler]] = WeakSet()


def _after_fork() -> None:
    for one in _compilers:
        one.after_fork()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
