"""Random programs of kernel calls."""

from __future__ import annotations

from random import Random
from typing import Any

from tests.firmware.model.program import COUNT, FIRST, Code, Kind, Operation, Program

MOST_CALLS = 60
BLOCKING = frozenset({Code.YIELD, Code.SLEEP, Code.WAIT_FOR_PERIOD, Code.WAIT_EVENT, Code.WAIT_CONDITION,
                      Code.WAIT_TIMEOUT, Code.LOCK, Code.LOCK_TIMEOUT, Code.JOIN, Code.JOIN_TIMEOUT,
                      Code.WAIT_NOTIFICATION, Code.WAIT_SEMAPHORE, Code.WAIT_SEMAPHORE_TIMEOUT,
                      Code.RUN_SYSTEM_THREAD})  # fmt: skip
INJECTED = (Code.TICK, Code.SLICE, Code.INTERRUPT)
FAMILIES: dict[str, tuple[int, ...]] = {
    "events": (Code.REGISTER, Code.UNREGISTER, Code.IS_REGISTERED, Code.SUBSCRIBE, Code.SUBSCRIBE, Code.SUBSCRIBE,
               Code.UNSUBSCRIBE, Code.UNSUBSCRIBE_HANDLER, Code.SEND, Code.SEND_INT, Code.SEND_INT, Code.READ),
    "waits": (Code.WAIT_EVENT, Code.WAIT_CONDITION, Code.WAIT_TIMEOUT, Code.WAIT_TIMEOUT, Code.SEND_INT, Code.SEND,
              Code.READ, Code.CLEAR, Code.SLEEP),
    "threads": (Code.START_PROCESS, Code.START_WITH, Code.KILL, Code.PROCESS_STATE, Code.UNUSED_STACK, Code.YIELD,
                Code.SLEEP, Code.START_SECTION, Code.END_SECTION),
    "schedulers": (Code.SET_SCHEDULER, Code.START_WITH, Code.WAIT_FOR_PERIOD, Code.WAIT_FOR_PERIOD, Code.YIELD,
                   Code.SLEEP),
    "mutex": (Code.LOCK, Code.LOCK_TIMEOUT, Code.UNLOCK, Code.UNLOCK, Code.START_WITH, Code.KILL, Code.YIELD),
    "notifications": (Code.NOTIFY, Code.NOTIFY, Code.NOTIFY_VALUE, Code.WAIT_NOTIFICATION, Code.WAIT_NOTIFICATION,
                      Code.KILL, Code.YIELD),
    "semaphores": (Code.SIGNAL, Code.SIGNAL, Code.WAIT_SEMAPHORE, Code.WAIT_SEMAPHORE_TIMEOUT, Code.KILL, Code.SLEEP),
    "timers": (Code.START_TIMER, Code.START_TIMER, Code.STOP_TIMER, Code.SUBSCRIBE, Code.WAIT_TIMEOUT, Code.SLEEP),
    "join": (Code.START_JOINABLE, Code.JOIN, Code.JOIN_TIMEOUT, Code.KILL, Code.PROCESS_STATE, Code.START_PROCESS),
    "cleanup": (Code.PUSH, Code.PUSH, Code.POP, Code.KILL, Code.KILL, Code.KILL, Code.START_PROCESS, Code.YIELD),
    "quota": (Code.LIMIT, Code.KEEP, Code.SEND_INT, Code.SEND, Code.SEND_INT, Code.SUBSCRIBE, Code.UNREGISTER,
              Code.REGISTER),
    "service": (Code.START_SERVICE, Code.FEED, Code.KILL, Code.SLEEP, Code.TICK),
    "motors": (Code.SEND_INT, Code.SEND, Code.MOTOR_SPEEDS, Code.UNSUBSCRIBE, Code.SUBSCRIBE),
    "memory": (Code.FAIL, Code.FAIL, Code.LOST, Code.STATISTICS, Code.START_PROCESS, Code.REGISTER, Code.SEND_INT),
}  # fmt: skip
"""Families of related calls. A program draws its calls from a few families."""
REMOTE = (Code.SHARE, Code.SHARE, Code.ARRIVE, Code.ARRIVE, Code.ARRIVE, Code.ARRIVE, Code.REMOTE_STATISTICS,
          Code.SEND_INT, Code.SEND, Code.UNREGISTER, Code.REGISTER, Code.SUBSCRIBE)  # fmt: skip
"""Calls of programs that share events, for an interpreter with the infra-red link."""
IN_ISR = (Code.SEND_INT, Code.SEND_INT, Code.SEND_INT, Code.SEND, Code.NOTIFY, Code.SIGNAL,
          Code.IS_REGISTERED, Code.SET_SCHEDULER, Code.LOST, Code.KILL, Code.SUBSCRIBE, Code.PROCESS_STATE,
          Code.UNLOCK, Code.PUSH, Code.SLEEP, Code.LIMIT, Code.START_TIMER, Code.START_SECTION,
          Code.END_SECTION, Code.END_SECTION)  # fmt: skip
PREFERRED = {Kind.CLEANUP: (Code.KILL, Code.KILL, Code.UNLOCK, Code.PUSH, Code.POP, Code.START_PROCESS),
             Kind.HANDLER: (Code.SEND_INT, Code.SEND_INT, Code.KILL, Code.READ, Code.UNREGISTER),
             Kind.CONDITION: (Code.KILL, Code.UNSUBSCRIBE_HANDLER, Code.SUBSCRIBE)}  # fmt: skip
"""Additional calls of scripts of a kind, because they change which code runs next."""
ELSEWHERE = tuple(Code[name] for name in ("STATISTICS", "MOTOR_SPEEDS", "UNUSED_KERNEL_STACK", "SYSTEM_TIME", "SLEEP"))


def shared_families(random: Random) -> list[str]:
    """Return the families of a program that shares events."""
    return ["remote", *random.sample(sorted(FAMILIES), random.choice((0, 1, 1, 2)))]


class Generator:
    """Generator of one random program."""

    def __init__(self, random: Random, families: list[str] | None = None, later: float = 0.3) -> None:
        """families: of FAMILIES, by default a few random ones. later: share of programs with an interrupt in a call."""
        self.random, self.later = random, later
        self.families = families or random.sample(sorted(FAMILIES), random.choice((1, 2, 2, 3, 3, 4)))
        self.calls = [code for family in self.families for code in FAMILIES.get(family, REMOTE)]
        self.main_event = "motors" in self.families and 5

    def program(self) -> Program:
        """Return a program of at most MOST_CALLS calls."""
        random, program = self.random, Program()
        left = random.randint(12, MOST_CALLS)
        before = self.prelude()
        after = self.script(Kind.MAIN, random.randint(2, 14))
        if random.random() < 0.04:
            after.append((Code.RUN_SYSTEM_THREAD, 0, 0, 0))
        program.scripts[0].operations = [*before, (Code.START_KERNEL, 0, 0, 0), *after]
        left -= len(program.scripts[0].operations)
        for kind, most in ((Kind.THREAD, 9), (Kind.HANDLER, 4), (Kind.CLEANUP, 4), (Kind.CONDITION, 2), (Kind.ISR, 3)):
            for number in range(COUNT[kind]):
                length = min(left, random.randint(0, most))
                script = program.scripts[FIRST[kind] + number]
                script.operations = self.script(kind, length)
                script.answer = random.choice((0, 1, 1, 1, 1, 2))
                left -= length
        if random.random() < self.later:
            script = program.scripts[random.choice((0, 0, 1, 2, 3))]
            started = script.operations.index((Code.START_KERNEL, 0, 0, 0)) + 1 if script is program.scripts[0] else 0
            at = random.randint(started, len(script.operations))
            script.operations.insert(
                at, (Code.LATER, random.choice((1, 2, 3, 5, 8, 13, 21)) + random.randint(0, 3), 0, 0)
            )
        return program

    def prelude(self) -> list[Operation]:
        """Return what main does before the kernel starts."""
        random = self.random
        calls: list[Operation] = [(Code.REGISTER, event, 0, 0) for event in (0, 1, 2) if random.random() < 0.85]
        calls += [(Code.START_WITH, slot, slot, random.randint(0, 3)) for slot in range(3) if random.random() < 0.6]
        calls += [(Code.SUBSCRIBE, random.randint(0, 1), 4, random.randint(0, 3))] * random.randint(0, 1)
        if random.random() < 0.5:
            calls.append((Code.SET_SCHEDULER, random.randint(1, 5), 0, 0))
        calls += self.script(Kind.MAIN, random.randint(0, 3), started=False)
        return calls

    def script(self, kind: Kind, length: int, started: bool = True) -> list[Operation]:
        random = self.random
        operations: list[Operation] = []
        if kind is Kind.THREAD and length > 1 and "cleanup" in self.families and random.random() < 0.6:
            operations = [(Code.PUSH, *self.operands(Code.PUSH)), (Code.SLEEP, random.randint(0, 2), 0, 0)]
        while len(operations) < length:
            if kind is Kind.ISR:
                code = random.choice(IN_ISR)
            elif started and random.random() < 0.12:
                code = random.choice(INJECTED)
            elif random.random() < 0.05:
                code = random.choice(ELSEWHERE)
            elif random.random() < 0.25 and (kind in PREFERRED):
                code = random.choice(PREFERRED[kind])
            else:
                code = random.choice(self.calls)
            if code in BLOCKING and kind not in (Kind.MAIN, Kind.THREAD) and random.random() < 0.8:
                continue  # it would be refused
            if code is Code.TICK and not started:
                continue
            operands = self.operands(code)
            if code is Code.KILL and "cleanup" in self.families and random.random() < 0.7:
                operands = (random.randint(0, 2), 0, 0)  # one of the threads that main starts
            operations.append((code, *operands))
        return operations

    def event(self) -> int:
        if self.main_event and self.random.random() < 0.5:
            return 5
        return self.random.choice((0, 0, 0, 0, 1, 1, 1, 2, 2, 3, 4, 5, 6, 7))

    def process(self) -> int:
        return self.random.choice((0, 0, 0, 1, 1, 1, 2, 2, 3, 4, 5, 5, 7, 8, 9))

    def operands(self, code: Any) -> tuple[int, int, int]:
        """Return the operands a, b and c of an operation (operations.h)."""
        r = self.random
        name = code.name
        if name in ("START_PROCESS", "START_WITH", "START_JOINABLE"):
            periodic = "schedulers" in self.families and r.random() < 0.6
            kind = r.randint(1, 3) if periodic else r.choice((0, 0, 0, 0, 0, 0, 4, 5, 6, 7, 8))
            return r.randint(0, 3), r.randint(0, 3), kind * 4 + r.randint(0, 3)
        if name in ("KILL", "PROCESS_STATE", "UNUSED_STACK", "JOIN", "JOIN_TIMEOUT"):
            return r.choice((6, *[self.process()] * 15)), r.choice((0, 1, 2, 5)), 0
        if name in ("NOTIFY", "NOTIFY_VALUE", "WAIT_NOTIFICATION"):
            return r.choice((0, 0, 0, 1)), r.choice((1, 1, 1, 2, 3, 0)), r.choice((0, 0, 1, 2, 3, 5))
        if name in ("SIGNAL", "WAIT_SEMAPHORE", "WAIT_SEMAPHORE_TIMEOUT"):
            return r.choice((0, 0, 0, 0, 1)), r.choice((0, 1, 2, 3, 5)), 0
        if name in ("START_TIMER", "STOP_TIMER"):
            return r.randint(0, 1), self.event(), r.choice((0, 1, 1, 2, 3, 4)) + 16 * r.choice((0, 0, 1, 2, 3))
        if name == "SLEEP":
            return r.choice((0, 1, 1, 2, 3, 5, 8)), 0, 0
        if name == "SET_SCHEDULER":
            return r.randint(0, 7), 0, 0
        if name == "SUBSCRIBE":
            handler = r.choice((0, 0, 1, 1, 2, 3, 4)) if r.random() < 0.2 else r.randint(0, 3)
            owner = r.choice((4, 4, 5, self.process(), r.choice((4, 6))))
            return self.event(), owner, handler + 8 * r.choice((0, 0, 0, 1, 2, 3))
        if name == "UNSUBSCRIBE":
            return self.event(), r.choice((4, 4, 6, *[self.process()] * 3)), 0
        if name == "UNSUBSCRIBE_HANDLER":
            return self.event(), r.choice((4, 4, 6, *[self.process()] * 3)), r.randint(0, 3)
        if name == "SEND":
            return self.event(), r.randint(0, 9), r.randint(0, 3)
        if name in ("SEND_INT", "WAIT_CONDITION"):
            return self.event(), r.randint(0, 3), 0
        if name == "WAIT_TIMEOUT":
            return self.event(), r.choice((0, 0, 1, 2, 3)), r.choice((0, 1, 2, 3, 5, 9))
        if name in ("REGISTER", "UNREGISTER", "IS_REGISTERED", "WAIT_EVENT", "LOST"):
            return self.event(), 0, 0
        if name == "STATISTICS":
            return r.randint(0, 3), 0, 0
        if name in ("LOCK", "UNLOCK", "LOCK_TIMEOUT"):
            return r.randint(0, 2), r.choice((0, 1, 2, 4)), 0
        if name == "PUSH":
            return r.choice((0, 1, 2, 3, 3, 4)), r.choice((0, 1, 2, 2, 3)), 0
        if name in ("POP", "INTERRUPT"):
            return r.randint(0, 1), 0, 0
        if name in ("LIMIT", "KEEP"):
            return r.randint(0, 1), self.event(), r.choice((1, 1, 2, 2, 3, 0))
        if name == "START_SERVICE":
            return r.randint(0, 2), 0, 0
        if name == "SHARE":
            return self.event(), r.choice((1, 1, 2, 7, 8, 0)), 0
        if name == "ARRIVE":
            sequence = r.choice((0, 0, 1, 1, 2, 3, 15))
            return self.event(), r.choice((0, 0, 1, 1, 2, 3, 4)), r.randint(0, 1) + 16 * sequence
        if name == "REMOTE_STATISTICS":
            return r.randint(0, 5), 0, 0
        if name == "FAIL":
            return r.choice((0, 0, 0, 1, 2)), r.choice((1, 1, 2, 8)), 0
        return 0, 0, 0
