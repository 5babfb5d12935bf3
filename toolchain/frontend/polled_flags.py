"""Warning about polled flags: non-volatile variables that a loop polls and an interrupt function writes.

The optimiser may read such a variable only once. The input is unoptimised IR text of the whole program. A loop polls
variables if they alone decide one of its exits, and it neither writes them, nor calls functions, nor writes through
pointers.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from toolchain.abi.isr_names import VECTOR_FUNCTIONS
from toolchain.ir.cfg import natural_loops

FUNCTION = re.compile(r'^define [^@\n]*@("[^"]+"|[\w$.]+)\([^\n]*\{\n(.*?)^\}', re.MULTILINE | re.DOTALL)
CALL = re.compile(r"\bcall [^\n]*?@([\w$.]+)\(")
STORE = re.compile(r"^\s*store (?!volatile |atomic )[^\n]*, ptr (@[\w$.]+|%[\w$.]+)", re.MULTILINE)
LOAD = re.compile(r"= load (?!volatile |atomic )[^,\n]+, ptr (@[\w$.]+|%[\w$.]+)")
LABEL = re.compile(r"^([\w$.]+):")
TARGET = re.compile(r"label %([\w$.]+)")
DEFINED = re.compile(r"^\s*(%[\w$.]+) = ")
OPERAND = re.compile(r"%[\w$.]+")
OPAQUE = re.compile(
    r"\b(?:volatile|atomic|fence|atomicrmw|cmpxchg)\b|\bcall\b(?![^\n]*@llvm\.(?:dbg|lifetime))|\binvoke\b"
)
LINE_REFERENCE = re.compile(r"!dbg !(\d+)")


@dataclass
class _FunctionText:
    """One function: lines and successors of blocks, definitions of values."""

    blocks: dict[str, list[str]] = field(default_factory=dict)
    succs: dict[str, list[str]] = field(default_factory=dict)
    made: dict[str, str] = field(default_factory=dict)


def findings(text: str, locate: Callable[[str], str]) -> list[str]:
    """Warnings to print, in the order of the source; `locate` returns "file:line" of a !dbg reference."""
    bodies = {name.strip('"'): body for name, body in FUNCTION.findall(text)}
    interrupts = _closure({name for name in bodies if name in VECTOR_FUNCTIONS}, bodies)
    written = {place for name in interrupts for place in STORE.findall(bodies[name]) if place.startswith("@")}
    if not written:
        return []
    out = []
    for name, body in bodies.items():
        if name in interrupts or not any(place in body for place in written):
            continue
        out += [
            f"{where}warning: '{flag[1:]}' is written by an interrupt function and waited for in a loop of '{name}', "
            "which may read it only once: declare it volatile"
            for flag, where in _polled(_parse(body), written, locate)
        ]
    return out


def _closure(names: set[str], bodies: dict[str, str]) -> set[str]:
    """The functions and all functions that they call, directly or indirectly."""
    work, seen = list(names), set(names)
    while work:
        for callee in CALL.findall(bodies[work.pop()]):
            if callee in bodies and callee not in seen:
                seen.add(callee)
                work.append(callee)
    return seen


def _parse(body: str) -> _FunctionText:
    """Split the body of a function into blocks."""
    code = _FunctionText()
    name = ""
    for line in body.split("\n"):
        label = LABEL.match(line)
        if label is not None or not name:
            name = label[1] if label is not None else "entry block"
            code.blocks[name], code.succs[name] = [], []
            if label is not None:
                continue
        code.blocks[name].append(line)
        code.succs[name] += TARGET.findall(line) if re.match(r"\s*(br|switch|indirectbr) ", line) else []
        found = DEFINED.match(line)
        if found is not None:
            code.made[found[1]] = line
    return code


def _polled(code: _FunctionText, written: set[str], locate: Callable[[str], str]) -> list[tuple[str, str]]:
    """(variable, "file:line: " or "") of every loop that polls a variable."""
    out = []
    for body in natural_loops(code.succs, next(iter(code.blocks))).values():
        lines = [line for name in body for line in code.blocks[name]]
        stored = [place for line in lines for place in STORE.findall(line)]
        if any(OPAQUE.search(line) for line in lines) or any(
            p[0] == "%" and "alloca" not in code.made.get(p, "") for p in stored
        ):
            continue
        ends = [line for name in body for line in code.blocks[name]
                if re.match(r"\s*br i1 ", line) and any(t not in body for t in TARGET.findall(line))]  # fmt: skip
        for end in ends:
            leaves = _read_by(end, code)
            if not leaves & written or leaves & set(stored):
                continue
            reference = LINE_REFERENCE.search(end)
            where = f"{locate('!' + reference[1])}: " if reference is not None else ""
            out += [(place, where) for place in sorted(leaves & written)]
    return list(dict.fromkeys(out))


def _read_by(line: str, code: _FunctionText) -> set[str]:
    """Variables on whose loads a branch depends."""
    found: set[str] = set()
    work, seen = OPERAND.findall(line.partition(",")[0]), set[str]()
    while work:
        value = work.pop()
        definition = code.made.get(value, "")
        if value in seen or not definition:
            continue
        seen.add(value)
        load = LOAD.search(definition)
        if load is not None:
            found.add(load[1])
        elif "alloca" not in definition:
            work += OPERAND.findall(definition.partition("=")[2])
    return found
