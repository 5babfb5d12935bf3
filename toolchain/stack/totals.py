"""Worst-case stack of every function from its own frame and its calls, callees first.

Mutually recursive functions form a component.  In it, every activation is counted at its deepest call.  The number of
activations is that of the annotation, or one.  This bounds recursion without enumerating the order of calls.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

from toolchain.stack.annotations import Annotations
from toolchain.stack.effects import CALL_BYTES
from toolchain.stack.walk import CallSite, FunctionStack


@dataclass(slots=True)
class Usage:
    """Stack of one function: its frame, worst-case total in bytes, the path that reaches it, and unknown parts."""

    name: str
    entry: int
    frame: int
    total: int = 0
    switch: int | None = None  # bytes on the interrupted stack at a switch to another stack
    path: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)


class CallGraph(Protocol):
    """Interface of the call graph."""

    functions: dict[int, FunctionStack]
    annotations: Annotations

    def targets(self, call: CallSite) -> list[int]: ...
    def name(self, address: int) -> str: ...
    def annotation(self, table: dict[str, int], entry: int) -> int | None: ...


def totals(program: CallGraph) -> dict[int, Usage]:
    """Return the usage of every function."""
    graph = {
        entry: []
        if program.annotation(program.annotations.depth, entry) is not None
        else sorted({t for call in function.calls for t in program.targets(call) if t in program.functions})
        for entry, function in program.functions.items()
    }
    done: dict[int, Usage] = {}
    for component in components(graph):
        members = set(component)
        circular = len(component) > 1 or component[0] in graph[component[0]]
        for entry in component:
            done[entry] = _outside(program, entry, members, done)
        if circular:
            _close(program, component, members, done)
    return done


def _outside(program: CallGraph, entry: int, members: set[int], done: dict[int, Usage]) -> Usage:
    """Return the worst case of one function over calls to functions outside its component."""
    function, name = program.functions[entry], program.name(entry)
    result = Usage(name, entry, function.frame, function.frame, function.switch, [name])
    bound = program.annotation(program.annotations.depth, entry)
    if bound is not None:
        result.total = bound
        return result
    result.unknown = [f"{name}: {reason}" for reason in function.unknown]
    for call in function.calls:
        base = call.depth + (0 if call.tail else CALL_BYTES)
        targets = program.targets(call)
        if not targets or not members.issuperset(targets):
            result.total = max(result.total, base)
        if not targets and call.target is None:
            result.unknown.append(f"{name}: call through a pointer at {call.address:#x}")
        for target in targets:
            callee = None if target in members else done.get(target)
            if callee is None:
                if target not in program.functions:
                    result.unknown.append(f"{name}: call to {target:#x}, where no code is, at {call.address:#x}")
                continue
            result.unknown += [reason for reason in callee.unknown if reason not in result.unknown]
            if base + callee.total > result.total or (base + callee.total == result.total and len(result.path) == 1):
                result.total, result.path = base + callee.total, [name, *callee.path]
    return result


def _close(program: CallGraph, component: list[int], members: set[int], done: dict[int, Usage]) -> None:
    """Add the stack of the recursion: each activation except the last is at its deepest call within the component."""
    steps: dict[int, int] = {}
    reasons: list[str] = []
    activations = 0
    for entry in component:
        inner = [c for c in program.functions[entry].calls if not members.isdisjoint(program.targets(c))]
        steps[entry] = max((c.depth + (0 if c.tail else CALL_BYTES) for c in inner), default=0)
        count = program.annotation(program.annotations.recursion, entry)
        activations += steps[entry] * (count or 1)
        if count is None:
            for call in inner:
                circle = ", ".join(program.name(t) for t in program.targets(call) if t in members)
                reasons.append(f"{program.name(entry)}: recursion to {circle} at {call.address:#x}")
    deepest = max((done[entry] for entry in component), key=lambda usage: usage.total)
    unknown = list(dict.fromkeys(reason for entry in component for reason in done[entry].unknown))
    extra = activations - min(steps.values())
    for entry in component:
        usage = done[entry]
        usage.total = extra + deepest.total
        usage.path = [usage.name] if usage is deepest else [usage.name, "..."]
        usage.path += deepest.path[1:] if usage is deepest else deepest.path
        usage.unknown = unknown + reasons


def components(graph: dict[int, list[int]]) -> list[list[int]]:
    """Strongly connected components, callees before callers (Tarjan 1972, without Python recursion)."""
    index: dict[int, int] = {}
    low: dict[int, int] = {}
    stack: list[int] = []
    on_stack: set[int] = set()
    result: list[list[int]] = []
    for root in graph:
        work = [(root, 0)] if root not in index else []
        while work:
            node, position = work.pop()
            if position == 0:
                index[node] = low[node] = len(index)
                stack.append(node)
                on_stack.add(node)
            following = graph[node][position:]
            for offset, child in enumerate(following):
                if child not in index:
                    work += [(node, position + offset + 1), (child, 0)]
                    break
                if child in on_stack:
                    low[node] = min(low[node], index[child])
            else:
                if low[node] == index[node]:
                    cut = stack.index(node)
                    result.append(stack[cut:])
                    on_stack -= set(stack[cut:])
                    del stack[cut:]
                if work:
                    parent = work[-1][0]
                    low[parent] = min(low[parent], low[node])
    return result
