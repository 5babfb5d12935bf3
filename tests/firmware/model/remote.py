"""Model of events shared between neighbours."""

from __future__ import annotations

from dataclasses import dataclass

from tests.firmware.model.calls import SATURATED, call
from tests.firmware.model.state import Code, Error, Event, Sizes
from tests.firmware.model.waits import Waits

LAST_EVENT, MOST_HOPS, MOST_BYTES = 8191, 7, 8
QUEUE = 4
"""Maximum number of waiting frames; the link sends none during a program."""
SEQUENCES, WINDOW = 32, 16
"""Number of sequence numbers of a robot, and of those before its newest one that are recorded."""
OWN = 5
"""This robot's number in programs."""


@dataclass(slots=True)
class Slot:
    """A place for a shared event. It is free if the slot's gate is no longer in front of the event of that number."""

    number: int = 0
    hops: int = 0


@dataclass(slots=True)
class Heard:
    """Received sequence numbers of a robot: the newest one, and those up to WINDOW before it."""

    newest: int
    older: set[int]


class Remote(Waits):
    """Shared events: an event sent here is sent to the neighbours, too; a neighbour's is sent here once."""

    def __init__(self, sizes: Sizes, code: Code) -> None:
        super().__init__(sizes, code)
        self.slots_of_shared = [Slot() for _ in range(sizes.remote_events)]
        self.share_gates: dict[int, Event] = {}
        """By event number: the event for which a gate was created, which takes memory."""
        self.heard: dict[int, Heard] = {}
        self.arriving = False
        self.frames = 0
        self.remote = dict.fromkeys(("shared", "arrived", "duplicates", "passed_on", "refused", "too_long"), 0)

    def count(self, counter: str) -> None:
        self.remote[counter] = min(self.remote[counter] + 1, SATURATED)

    @call("Sys_Get_RemoteStatistics", "MTHI")
    def remote_statistics(self) -> list[int]:
        return list(self.remote.values())

    def is_shared(self, slot: Slot) -> bool:
        event = self.events.get(slot.number)
        return slot.hops > 0 and event is not None and self.share_gates.get(slot.number) is event

    def slot_of(self, number: int) -> Slot | None:
        return next((slot for slot in self.slots_of_shared if slot.number == number and self.is_shared(slot)), None)

    @call("Sys_Share_Event", "MTH")
    def share(self, number: int, hops: int) -> bool:
        """Share an event over some hops, or change their number."""
        if number > LAST_EVENT or not 0 < hops <= MOST_HOPS:
            return self.fail(Error.ARGUMENT)
        event = self.events.get(number)
        if event is None:
            return self.fail(Error.EVENT)
        slot = self.slot_of(number)
        if slot is None:
            slot = next((one for one in self.slots_of_shared if not self.is_shared(one)), None)
            if slot is None:
                return self.fail(Error.BUSY)
            if not self.allocate(self.sizes.event):
                return self.fail(Error.MEMORY)
            for former in (slot.number if slot.hops else None, number):
                if former is not None and self.share_gates.pop(former, None) is not None:
                    self.free(self.sizes.event)
            self.share_gates[number] = event
            slot.number = number
        slot.hops = hops
        return True

    def transmit(self) -> bool:
        """Whether the queue of frames has room for one more."""
        self.frames += self.frames < QUEUE + 1
        return self.frames <= QUEUE

    def queue_message(self, number: int, payload: bytes) -> Error:
        """Transmit a shared event that this robot sends, then queue it here."""
        if not self.arriving and self.slot_of(number) is not None:
            if len(payload) > MOST_BYTES:
                self.count("too_long")
            elif self.transmit():
                self.count("shared")
        return super().queue_message(number, payload)

    def arrive(self, number: int, hops: int, robot: int, sequence: int, payload: bytes) -> None:
        """Interrupt: receive a frame with an event of another robot, from that robot or from one that forwards it."""
        if robot == OWN:
            self.count("duplicates")
        elif robot not in self.heard and len(self.heard) == self.sizes.remote_memory:
            self.count("refused")
        elif not self.is_new(robot, sequence):
            self.count("duplicates")
        else:
            self.count("arrived")
            if hops > 1 and self.transmit():
                self.count("passed_on")
            if self.slot_of(number) is not None:
                self.arriving = True
                self.send_event(number, payload, len(payload))
                self.arriving = False

    def is_new(self, robot: int, sequence: int) -> bool:
        """Record a sequence number of a robot; False: it was recorded before."""
        if robot not in self.heard:
            self.heard[robot] = Heard(sequence, set())
            return True
        heard = self.heard[robot]
        if sequence == heard.newest or sequence in heard.older:
            return False
        if (sequence - heard.newest) % SEQUENCES < WINDOW:
            heard.older.add(heard.newest)
            heard.newest = sequence
            heard.older = {one for one in heard.older if (sequence - one) % SEQUENCES <= WINDOW}
        else:
            heard.older.add(sequence)
        return True
