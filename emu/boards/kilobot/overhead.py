"""Overhead controller: the lamp above the table that repeats a command to all robots at once (kilobot.md §2)."""

from __future__ import annotations

from emu.avr.machine import HZ
from emu.boards.kilobot.messages import DATA_SIZE, OHC_GAP, TYPES, Message, frame, pulses_of
from emu.boards.kilobot.swarm import KilobotSwarm


def broadcast(swarm: KilobotSwarm, command: str | Message, seconds: float) -> None:
    """Repeat a message for a time while the swarm runs, every 10.4 ms and without carrier sense.

    `command`: a key of TYPES, or any other message. All robots receive it with full strength. Raises ValueError,
    KilobotFaultError.
    """
    message = command if isinstance(command, Message) else Message(bytes(DATA_SIZE), TYPES[command])
    octets = frame(message)
    end = swarm.now + int(seconds * HZ)
    while swarm.now < end:
        swarm.run_until(min(send_frame(swarm, octets), end))


def send_frame(swarm: KilobotSwarm, octets: bytes) -> int:
    """Let all robots receive the pulses of a frame that begins now. Return the tick at which the next one may begin."""
    pulses = list(pulses_of(octets, swarm.now + 1))
    for robot in range(len(swarm.robots)):
        for tick in pulses:
            swarm.light(robot, tick)
    return pulses[-1] + OHC_GAP
