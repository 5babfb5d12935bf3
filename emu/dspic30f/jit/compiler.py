"""From IR text to callable code: disk cache, compile process, loading.

`request` never waits: cached objects are ready at once, others come back from the compile process and are collected
by `poll`. `now` compiles at once, in this process, for the few pieces the engine cannot start without.

A compile process that dies is replaced, and its piece tried once more. If that does not help, or the next one dies too,
what has no code yet stays interpreted, and a line on standard error says so.
"""

from __future__ import annotations

import atexit
import os
import selectors
import struct
import subprocess
import sys
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
    """What translation cost so far."""

    requested: int = 0
    compiled: int = 0
    from_disk: int = 0
    loaded: int = 0


PATIENCE: Final = 3
"""Compile processes in a row that may die without having compiled anything."""


@dataclass(slots=True, weakref_slot=True, eq=False)
class Loaded:
    """Native code in memory: it stays as long as somebody holds this."""

    address: int
    """Of the one function `entry`."""
    entries: Sequence[int]
    """Program addresses at which it can be entered."""
    library: Any
    """Its owner within LLVM."""


class Refused(RuntimeError):
    """LLVM did not accept generated IR: a defect of the translator."""


def packed(entries: Sequence[int], code: bytes) -> bytes:
    """An object and the program addresses at which it can be entered, as one blob."""
    return struct.pack(f"<I{len(entries)}I", len(entries), *entries) + code


def unpacked(blob: bytes) -> tuple[list[int], bytes]:
    """The two parts of `packed`."""
    (count,) = struct.unpack_from("<I", blob)
    return list(struct.unpack_from(f"<{count}I", blob, 4)), blob[4 + 4 * count :]


@cache
def _shared(_where: Path) -> Compiler:
    return Compiler()


def shared_compiler() -> Compiler:
    """The compiler all machines of this process use: one compile process, one cache."""
    return _shared(native_code())


class Compiler:
    """Objects by name. Every module exports one function, called `entry`. Threads may share one.

    What is in memory is there once, however many machines run it, and no longer than the last of them: Linux allows a
    process 65,530 mappings (vm.max_map_count), and each object takes two.
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
        """Who waits for a piece, by its name."""
        self._outbox: deque[tuple[int, int, bytes]] = deque()
        self._in_flight: tuple[int, int, bytes] | None = None
        """(ticket, level, text) the process is compiling."""
        self._retried = 0
        """The last ticket that was given to a second process."""
        self._deaths = 0
        """Processes that died since one compiled something."""
        self._warned = False
        self._tickets = 0
        self._loader: Any = None
        self._modules = 0
        self._ready: list[tuple[object, Loaded]] = []
        self._loaded: WeakValueDictionary[str, Loaded] = WeakValueDictionary()
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
        """Name of the object for a piece of code identified by what it is made from (not by its IR text)."""
        return self.cache.key(self._host_name(), bytes([level]), *identity)

    def kept(self, key: str) -> Loaded | None:
        """The code called `key`, if it is in memory or on disk."""
        loaded = self._loaded.get(key)
        if loaded is not None:
            return loaded
        blob = self.cache.get(key)
        if blob is None:
            return None
        self.statistics.from_disk += 1
        entries, code = unpacked(blob)
        return self.load(code, key, entries)

    def now(self, text: str, level: int, key: str, entries: Sequence[int] = ()) -> Loaded:
        """Compile `text` in this process."""
        if self._backend is None:
            self._backend = Backend()
        code = self._backend.compile(text, level)
        self.statistics.compiled += 1
        self.cache.put(key, packed(entries, code))
        return self.load(code, key, entries)

    def request(self, text: str, level: int, key: str, entries: Sequence[int], tag: object) -> None:
        """Have `text` compiled in the background, once for all who ask; `poll` will yield (tag, code)."""
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
        piece = (self._tickets, level, text.encode())
        if level:
            self._outbox.append(piece)
        else:  # quick to compile, and it ends the interpreter's share
            self._outbox.appendleft(piece)
        self._send()

    def _send(self) -> None:
        """Give the idle process its next piece. One at a time: two full pipes would wait for each other."""
        while self._outbox and self._in_flight is None:
            if self._deaths >= PATIENCE:
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
                self._lost(error)

    def _lost(self, why: object) -> None:
        """The compile process has died or could not be started: its piece goes first to the next one, but only once."""
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
            why = f"exit status {process.wait()}"
        self._received.clear()
        self._deaths += 1
        piece, self._in_flight = self._in_flight, None
        if piece is None:
            return
        if piece[0] != self._retried and self._deaths < PATIENCE:
            self._retried = piece[0]
            self._outbox.appendleft(piece)
            return
        lost = self._waiting.pop(piece[0], None)
        if lost is not None:
            del self._tags[lost[0]]
        if not self._warned:
            self._warned = True
            print(f"emu: warning: compile process died ({why}); code it has not made is interpreted", file=sys.stderr)

    def poll(self) -> list[tuple[object, Loaded]]:
        """Code that has arrived since the last call, loaded. Raises Refused on a translator defect."""
        if not self._waiting:
            return []
        with self._lock:
            return self._collect()

    def _collect(self) -> list[tuple[object, Loaded]]:
        self._send()
        while self._selector.select(0):
            assert self._process is not None
            assert self._process.stdout is not None
            data = os.read(self._process.stdout.fileno(), 1 << 20)
            if not data:
                self._lost("it closed its end")
                self._send()
                continue
            self._received += data
            if len(data) < 1 << 16:
                break
        while self._take():
            pass
        ready, self._ready = self._ready, []
        return ready

    @property
    def busy(self) -> int:
        """Number of pieces under way in the compile process."""
        return len(self._waiting)

    def load(self, code: bytes, key: str, entries: Sequence[int]) -> Loaded:
        """The object file `code` in memory, called `key` from now on."""
        import llvmlite.binding as llvm

        with self._lock:
            if self._loader is None:
                llvm.initialize_native_target()
                llvm.initialize_native_asmprinter()
                # LLVM's older linker maps sections one by one: 2 GB apart in a fragmented process, it aborts
                self._loader = llvm.create_lljit_compiler(use_jit_link=True)
            self._modules += 1
            library = (
                llvm.JITLibraryBuilder()
                .add_object_img(code)
                .export_symbol("entry")
                .link(self._loader, f"m{self._modules}")
            )
            self.statistics.loaded += 1
            loaded = self._loaded[key] = Loaded(int(library["entry"]), entries, library)
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

    def copied(self) -> None:
        """This process is a copy of another, to which alone the compile process answers: what is under way is asked
        for again from one's own."""
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
            process.returncode = 0  # it is the other's to wait for
        self._received.clear()
        piece, self._in_flight = self._in_flight, None
        if piece is not None:
            self._outbox.appendleft(piece)

    def _take(self) -> bool:
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
            raise Refused(bytes(received[REPLY.size + 4 : REPLY.size + 4 + size]).decode())
        end = REPLY.size + length
        if len(received) < end:
            return False
        code = bytes(received[REPLY.size : end])
        del received[:end]
        self._in_flight, self._deaths = None, 0
        self._send()
        key, entries = self._waiting.pop(ticket)
        self.statistics.compiled += 1
        self.cache.put(key, packed(entries, code))
        loaded = self.load(code, key, entries)
        self._ready += [(tag, loaded) for tag in self._tags.pop(key)]
        return True


_compilers: Final[WeakSet[Compiler]] = WeakSet()


def _copied() -> None:
    for one in _compilers:
        one.copied()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_copied)
