"""Robots of one trial in another process, in lock-step with this one.

A `Crew` is the other process with its robots; a `RemoteBrain` stands for each of them here. At the beginning of a
quantum the crew is told the poses and what infrared emitters did; while it thinks, the robots of this process do. A
robot knows nothing of where it runs, so the number of processes cannot show in a record.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import struct
from collections.abc import Callable, Sequence
from ctypes import c_uint64
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext
from typing import Any, Final

import numpy as np

from arena.infrared.channel import Ether, Switch
from arena.robots.controller import Brain, Lights, Line, Reading
from arena.world.physics import Poses

THINK, SAMPLE, TELL, SPOKEN, ANSWER, FAILED = b"t", b"s", b"m", b"w", b"a", b"f"
"""First byte of a message: a quantum begins; what is to be recorded is asked for; something for a robot, which is not
answered; what a robot has spoken is asked for; what a crew answers."""
_HEAD: Final = struct.Struct("<qqqq")
"""Tick, number of robots, of the numbers that say where everything is, and of switches."""
_SWITCH: Final = struct.Struct("<qqqq")
LOOKS: Final = 3_000
"""How often a reader looks for the next message before it sleeps until one comes: about 0.15 ms, in which the other
process has most often come round. To be woken takes as long as a robot needs for its quantum (bench/arena.py)."""
Make = Callable[[Sequence[int], Ether | None], list[Brain]]
"""make(robots, ether): brains of some robots that share an ether, made in the process in which they live."""


def packed(tick: int, poses: Poses, switches: Sequence[Switch]) -> bytes:
    """The message that begins a quantum."""
    head = _HEAD.pack(tick, poses.counts[0], len(poses.values), len(switches))
    return THINK + head + poses.values.tobytes() + _packed_switches(switches)


def unpacked(message: bytes) -> tuple[int, Poses, list[Switch]]:
    """The inverse of `packed`."""
    tick, robots, count, switches = _HEAD.unpack_from(message, 1)
    start = 1 + _HEAD.size
    values = np.frombuffer(message, np.float64, count, start)
    return tick, Poses.of(values, robots), _unpacked_switches(message, start + values.nbytes, switches)


def _packed_switches(switches: Sequence[Switch]) -> bytes:
    return b"".join(_SWITCH.pack(*switch) for switch in switches)


def _unpacked_switches(message: bytes, place: int, count: int) -> list[Switch]:
    return [Switch(*_SWITCH.unpack_from(message, place + i * _SWITCH.size)) for i in range(count)]


class Wire:
    """One end of a pipe between two processes, with counters of what was sent each way in memory they share.

    With `looks` a reader watches the counter that often before it sleeps; right where each process has a CPU.
    """

    def __init__(self, pipe: Connection, sent: Any, coming: Any, looks: int) -> None:
        self._pipe: Final = pipe
        self._sent: Final = sent
        self._coming: Final = coming
        self._looks: Final = looks
        self._heard = 0

    def send(self, message: bytes) -> None:
        """Raises OSError if the other end is closed."""
        self._pipe.send_bytes(message)
        self._sent.value += 1

    def receive(self) -> bytes:
        """The next message. Raises EOFError if the other end was closed."""
        self._heard += 1
        coming, heard = self._coming, self._heard
        for _ in range(self._looks):
            if coming.value >= heard:
                break
        return self._pipe.recv_bytes()

    def close(self) -> None:
        """What the other end reads is EOFError."""
        self._pipe.close()


def wire(context: SpawnContext, processes: int) -> tuple[Wire, Wire]:
    """Both ends of a new wire of a trial that is spread over `processes`."""
    one, other = context.Pipe()
    there, back = context.RawValue(c_uint64), context.RawValue(c_uint64)
    looks = LOOKS if processes <= (os.cpu_count() or 1) else 0
    return Wire(one, there, back, looks), Wire(other, back, there, looks)


class Crew:
    """`robots`, made by `make` in a process of their own; `ether` is that of this process, None for scripted brains.

    The trial is spread over `processes`. `make` is pickled: a function of a module, or a `partial` of one. Raises what
    it raises there.
    """

    def __init__(self, make: Make, robots: Sequence[int], ether: Ether | None, processes: int = 2) -> None:
        context = multiprocessing.get_context("spawn")
        self._wire, other = wire(context, processes)
        self._ether = ether
        self._process = context.Process(target=_serve, args=(other, make, list(robots), ether), daemon=True)
        self._process.start()
        other.close()
        self._wheels: list[tuple[float, float]] = []
        self._thinking = False
        self._sampled: list[tuple[Reading, list[Line], list[Lights]]] = []
        self.brains: Final[list[Brain]] = [RemoteBrain(self, place) for place in range(len(robots))]
        self._answer()  # it is there

    def begin(self, tick: int, poses: Poses, switches: Sequence[Switch]) -> None:
        """A quantum begins. `switches` are all that were made in the last one, by whomever."""
        self._thinking = True
        self._wire.send(packed(tick, poses, switches))

    def wheels(self, place: int) -> tuple[float, float]:
        """What a robot of the crew answers to the quantum that was begun."""
        if self._thinking:
            self._thinking = False
            answer = self._answer()
            (count,) = struct.unpack_from("<q", answer, 1)
            speeds = struct.unpack_from(f"<{2 * len(self.brains)}d", answer, 9)
            self._wheels = list(zip(speeds[::2], speeds[1::2], strict=True))
            if count and self._ether is not None:
                self._ether.hear(_unpacked_switches(answer, 9 + 8 * len(speeds), count))
        return self._wheels[place]

    def sample(self, place: int) -> tuple[Reading, list[Line], list[Lights]]:
        """What is to be recorded of a robot; asked for once for all of the crew, when its first robot is."""
        if place == 0:
            self._wire.send(SAMPLE)
            self._sampled = pickle.loads(self._answer()[1:])
        return self._sampled[place]

    def tell(self, place: int, data: bytes) -> None:
        """Something for a robot, before its next quantum."""
        self._wire.send(TELL + struct.pack("<q", place) + data)

    def spoken(self, place: int) -> bytes:
        """What a robot of the crew wrote to UART1."""
        self._wire.send(SPOKEN + struct.pack("<q", place))
        return self._answer()[1:]

    def _answer(self) -> bytes:
        try:
            message = self._wire.receive()
        except EOFError:
            raise RuntimeError("a process with robots of the trial has died") from None
        if message[:1] == FAILED:
            raise pickle.loads(message[1:])
        return message

    def close(self) -> None:
        """End the process."""
        self._wire.close()
        self._process.join(5)
        if self._process.is_alive():
            self._process.terminate()


class RemoteBrain:
    """`Brain` of a robot that lives in a crew."""

    def __init__(self, crew: Crew, place: int) -> None:
        self._crew: Final = crew
        self._place: Final = place
        self._sampled: tuple[Reading, list[Line], list[Lights]] = Reading(), [], []

    def think(self, tick: int, poses: Poses) -> tuple[float, float]:
        """As `Brain.think`."""
        return self._crew.wheels(self._place)

    def reading(self) -> Reading:
        """As `Brain.reading`."""
        self._sampled = self._crew.sample(self._place)
        return self._sampled[0]

    def lines(self) -> list[Line]:
        """As `Brain.lines`."""
        return self._sampled[1]

    def lights(self) -> list[Lights]:
        """As `Brain.lights`."""
        return self._sampled[2]

    def tell(self, data: bytes) -> None:
        """As `Brain.tell`."""
        self._crew.tell(self._place, data)

    def spoken(self) -> bytes:
        """As `Brain.spoken`."""
        return self._crew.spoken(self._place)

    def close(self) -> None:
        """The crew is closed as a whole."""


def _serve(wire: Wire, make: Make, robots: Sequence[int], ether: Ether | None) -> None:
    """The other process: answer until the wire is closed."""
    try:
        brains = make(robots, ether)
        wire.send(ANSWER)
        while True:
            message = wire.receive()
            if message[:1] == THINK:
                tick, poses, switches = unpacked(message)
                if ether is not None:
                    ether.hear(switch for switch in switches if switch.robot not in robots)
                    ether.take()
                speeds = [speed for brain in brains for speed in brain.think(tick, poses)]
                own = ether.take() if ether is not None else []
                body = struct.pack(f"<q{len(speeds)}d", len(own), *speeds) + _packed_switches(own)
                wire.send(ANSWER + body)
            elif message[:1] == TELL:
                (place,) = struct.unpack_from("<q", message, 1)
                brains[place].tell(message[9:])
            elif message[:1] == SPOKEN:
                (place,) = struct.unpack_from("<q", message, 1)
                wire.send(ANSWER + brains[place].spoken())
            else:
                parts = [(brain.reading(), brain.lines(), brain.lights()) for brain in brains]
                wire.send(ANSWER + pickle.dumps(parts))
    except (EOFError, KeyboardInterrupt, BrokenPipeError):
        return  # the trial is over, or given up
    except Exception as error:
        wire.send(FAILED + pickle.dumps(error))
