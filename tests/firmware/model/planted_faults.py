"""Faults planted in a copy of the kernel, to measure how many random programs it takes to find each."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.firmware.model.compare import HERE, Kernels, build, random_programs
from tests.firmware.model.program import Program, named_texts

SOURCES = HERE.parents[2] / "firmware" / "openswarm"
BATCH = 100


@dataclass(frozen=True)
class Fault:
    """Edits of kernel sources: (file, text, replacement). The text occurs once in the file."""

    name: str
    edits: tuple[tuple[str, str, str], ...]
    remote: bool = False
    """Whether only programs that share events can find it."""


RELEASES = """    if (os_release_mutexes != NULL) {
        os_release_mutexes(p);
    }
    if (os_release_joins != NULL) {
        os_release_joins(p);
    }
"""
FREE = """    uint16 pid = p->pid;
    if (os_free_joinable"""
PROCESS, EVENT, CLOCK, SCHEDULER = (f"kernel/{name}.c" for name in ("process", "event", "clock", "scheduler"))
CLEANUP, MUTEX, JOIN, QUOTA, SERVICE, NOTIFICATION, SEMAPHORE, TIMER = (
    f"option/{name}.c"
    for name in ("cleanup", "mutex", "join", "quota", "service", "notification", "semaphore", "timer")
)


def _one(name: str, file: str, text: str, replacement: str) -> Fault:
    return Fault(name, ((file, text, replacement),))


FAULTS = (
    Fault(
        "cleanups run while the thread owns mutexes and joins",
        ((PROCESS, RELEASES, ""), (PROCESS, FREE, FREE.replace("    if", RELEASES + "    if", 1))),
    ),
    _one("a cleanup acts as the killer", CLEANUP, "            HAL_STORE(os_running, p);\n", ""),
    _one("a cleanup pops the killer's", CLEANUP, "    os_in_kernel = true;\n", ""),
    _one(
        "a cleanup ends the thread on whose stack it runs", PROCESS, "if (p == os_cleanup_host) {", "if (p == NULL) {",
    ),
    _one("drivers subscribe as PID 0", "kernel/kernel.h", "OS_DRIVERS = 0xFFFF", "OS_DRIVERS = 0"),
    _one("a section across the start never ends", PROCESS, "    critical_before = HAL_THREAD_LEVEL;\n    if", "    if"),
    _one(
        "the watchdog needs heap", SERVICE, "    uint16 now = clock_now();\n",
        "    uint16 now = clock_now();\n    if (HAL_ALLOCATION_FAILS()) {\n        return;\n    }\n",
    ),
    _one("a quota counts one of two queues", QUOTA, "    count(HAL_LOAD(delivery_batch), e, &waiting, &newest);\n", ""),
    _one(
        "a wrong configuration counts as memory", SERVICE, "        error = (sys_error)Sys_Get_LastError();\n",
        "        error = SYS_ERROR_MEMORY;\n",
    ),
    _one("a NULL cleanup is accepted", CLEANUP, "c == NULL || run == NULL", "c == NULL"),
    _one("threads join each other", JOIN, "if (next == os_running) {", "if (next == os_running && next == p) {"),
    Fault(
        "an event of the next robot arrives twice",
        ((
            "io/infrared/remote_events.c", "        os_count(&statistics.refused);\n        return;\n",
            "        r = origins;\n        r->newest = 0;\n",
        ),),
        remote=True,
    ),
    _one(
        "a notification before the wait is lost", NOTIFICATION, "    n->bits |= bits;\n",
        "    n->bits |= bits & n->awaited;\n",
    ),
    _one("an end overwrites main's time-out", PROCESS, "    event_announce(SYS", "    (void)Sys_Send_IntEvent(SYS"),
    _one(
        "an application subscribes as the drivers", EVENT, ": process_find(pid) == NULL ?",
        ": pid != OS_DRIVERS && process_find(pid) == NULL ?",
    ),
    _one("a failing send of a timer is an error", TIMER, "event_announce(t->", "(void)Sys_Send_IntEvent(t->"),
    _one(
        "an ISR ends a section", PROCESS,
        "    if (!hal_in_isr()) {\n        section_close", "    {\n        section_close",
    ),
    _one(
        "an ISR gets the wrong error", QUOTA, "return os_enter() == SYS_OK && os_leave(most != 0",
        "return most == 0 ? os_fail(SYS_ERROR_ARGUMENT) : os_enter() == SYS_OK && os_leave(most != 0",
    ),
    _one("a woken thread runs next", PROCESS, "    os_ring = p;\n    os_preempt();", "    os_preempt();"),
    _one(
        "the last waiter is woken first", PROCESS, "    self->next = NULL;\n    sys_pcb **end = link_to(NULL);",
        "    self->next = os_blocked;\n    sys_pcb **end = &os_blocked;",
    ),
    _one("an end keeps the wait result", PROCESS, "    event_release_result(p);\n", ""),
    _one(
        "a shared result is freed twice", EVENT, "        if (holds_result(p, m)) {",
        "        if (p == NULL && holds_result(p, m)) {",
    ),
    _one("a time-out is late", CLOCK, "+ elapsed) <= elapsed", "+ elapsed) < elapsed"),
    _one("messages of an ended event are delivered", EVENT, "    detach_messages(delivery_batch, e);\n", ""),
    _one(
        "a new handler gets the current message", EVENT, "while (*link != NULL && link != delivery_cursor) {",
        "while (*link != NULL) {",
    ),
    _one("an unsubscribed handler stops the delivery", EVENT, "        delivery_cursor = link;\n", "        ;\n"),
    _one(
        "a woken thread waits for a tick", SCHEDULER, "(!os_in_kernel || hal_in_isr())",
        "!os_in_kernel && !hal_in_isr()",
    ),
    _one("a missed deadline is reported twice", SCHEDULER, "    p->status |= OS_MISSED;\n", ""),
    _one("a mutex passes to the last of equals", MUTEX, "w->thread->priority > best", "w->thread->priority >= best"),
    _one("an owner keeps the ceiling", MUTEX, "    thread->priority = m->base;\n", ""),
    _one("an ended thread still waits for a mutex", MUTEX, "        remove_waiter(m, thread);\n", "        ;\n"),
    _one("a joined thread stays a zombie", JOIN, "                gone->status &= (uint8)~OS_JOINABLE;\n", ""),
    _one("a unit passes to the newest waiter", SEMAPHORE, "!process_awaits(object) && takes", "takes"),
    _one("a timer drifts", TIMER, "(uint16)(t->due + t->period);\n", "(uint16)(clock_now() + t->period);\n"),
    _one("a service restarts for ever", SERVICE, "                s->restarts--;\n", "                ;\n"),
)  # fmt: skip
"""The faults up to "an ISR gets the wrong error" are former faults of the kernel."""


FOUND_BY = named_texts("found_by.txt")
"""Text of a small program that differs while a fault is planted, by the name of the fault."""


def plant(fault: Fault, built: Path, folder: Path) -> Path:
    """Build the interpreter with a fault in `folder`, from the objects of `built`, and return it.

    `built` has the objects for programs that share events in a subfolder `remote`.
    """
    sources, out = folder / "openswarm", folder / "out"
    shutil.copytree(SOURCES, sources)
    shutil.copytree(built / "remote" if fault.remote else built, out)
    (out / "interpreter").unlink()
    for file, text, replacement in fault.edits:
        path = sources / file
        source = path.read_text()
        if source.count(text) != 1:
            raise ValueError(f"{fault.name}: {file} has the text {source.count(text)} times: {text}")
        path.write_text(source.replace(text, replacement))
    return build(out, f"OS={sources}", f"REMOTE={'1' * fault.remote}")


def programs_until_found(interpreter: Path, seed: int, most: int, remote: bool = False) -> tuple[int, Program] | None:
    """Return the number of the first program that differs, counted from 1, and the program; None if `most` agree."""
    kernels = Kernels(interpreter)
    for tried in range(0, most, BATCH):
        programs = random_programs(seed + tried, BATCH, remote)
        for number, difference in enumerate(kernels.check(programs), tried + 1):
            if difference is not None:
                return number, programs[number - tried - 1]
    return None


def find_all(built: Path, folder: Path, seed: int, most: int) -> Iterator[tuple[Fault, int | None, Program | None]]:
    """Plant each fault and yield it with what `programs_until_found` returns."""
    for number, fault in enumerate(FAULTS):
        found = programs_until_found(plant(fault, built, folder / str(number)), seed, most, fault.remote)
        yield fault, *(found or (None, None))
