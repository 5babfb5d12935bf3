"""Overhead controller: the lamp above the table that repeats a command to all robots at once (kilobot.md §2).

A frame is announced LEAD_TICKS before its first pulse. So each robot gets each pulse at its tick, whatever instruction
the robot executes then.
"""

from __future__ import annotations

from emu.avr.machine import HZ
from emu.boards.kilobot.messages import DATA_SIZE, OHC_GAP, TYPES, Message, frame, pulses_of
from emu.boards.kilobot.swarm import LEAD_TICKS, KilobotSwarm


def broadcast(swarm: KilobotSwarm, command: str | Message, seconds: float) -> None:
    """Repeat a message for a time while the swarm runs, every 10.4 ms and without carrier sense.

    `command`: a key of TYPES, or any other message. All robots receive it with full strength. Raises ValueError,
    KilobotFaultError.
    """
    message = command if isinstance(command, Message) else Message(bytes(DATA_SIZE), TYPES[command])
    octets = frame(message)
    end, start = swarm.now + int(seconds * HZ), swarm.now + LEAD_TICKS
    while swarm.now < end:
        start = send_frame(swarm, octets, start)
        swarm.run_until(min(start - LEAD_TICKS, end))


def send_frame(swarm: KilobotSwarm, octets: bytes, start: int) -> int:
    """Let all robots receive the pulses of a frame that begins after tick `start`.

    `start` is at least LEAD_TICKS after the end of the last run. Return the tick of the next frame.
    """
    pulses = list(pulses_of(octets, start + 1))
    for robot in range(len(swarm.robots)):
        for tick in pulses:
            swarm.light(robot, tick)
    return pulses[-1] + OHC_GAP
