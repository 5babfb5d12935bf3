"""Data flow of debug records: the record that is valid for each source variable at each instruction.

Needs: IR as parsed. Ensures: every `line` of an instruction is a `BoundLine`, which passes copy like any other line. If
two paths into a block have different records of a variable, no record of it is valid there.
"""

from __future__ import annotations

from toolchain.debuginfo.metadata import DebugMetadata
from toolchain.ir.cfg import predecessors
from toolchain.ir.model import Arg, Block, ConstInt, DbgRecord, Function, Instr, Type, size_of

ValidRecords = dict[str, int]
"""Index of the valid record of each variable, by `name_of`."""

MAX_ROUNDS = 50  # maximum number of rounds of the data flow; a function that needs more gets no locations


class BoundLine(str):
    """A !dbg reference with the debug records that are valid at its instruction."""

    records: tuple[int, ...] = ()


def bind(f: Function, info: DebugMetadata) -> None:
    """Bind the lines of `f` to records. Assignment records become memory locations if memory has the value."""
    for k, home in in_memory(f, info).items():
        f.dbg_records[k].kind, f.dbg_records[k].value = "memory", home
    for record in f.dbg_records:
        if record.kind == "dbg_declare" and isinstance(record.value, Arg):
            # a struct parameter, possibly in registers, or a local that the function returns: it is the caller's object
            record.kind = "returned" if "sret" in record.value.attrs else "parameter"
        if record.kind == "dbg_assign":
            record.kind = "dbg_value"
            if isinstance(record.address, Instr):  # the value is in memory, which other code may change
                record.value = None
        record.variable = name_of(record, info)
    if not any(record.kind != "dbg_declare" for record in f.dbg_records):
        return
    records = _RecordFlow(f)
    preds = predecessors(f)
    after: dict[str, ValidRecords] = {}
    for _ in range(MAX_ROUNDS):
        changed = False
        for b in f.blocks:
            known = _meet([after[p] for p in preds[b.name] if p in after]) if b is not f.blocks[0] else {}
            for k in records.of.get(b.name, ()):
                records.apply(k, known)
            if after.get(b.name) != known:
                after[b.name] = known
                changed = True
        if not changed:
            break
    else:
        return
    for b in f.blocks:
        records.mark(b, _meet([after[p] for p in preds[b.name]]) if b is not f.blocks[0] else {})


class _RecordFlow:
    """Records of a function by block, and the effect of each record on the set of valid records."""

    def __init__(self, f: Function) -> None:
        self.records = f.dbg_records
        self.of: dict[str, list[int]] = {}
        for k, record in enumerate(f.dbg_records):
            if record.kind != "dbg_declare":
                self.of.setdefault(record.block, []).append(k)
        self.replaced = self._replaced_records()

    def _replaced_records(self) -> dict[int, set[int]]:
        """Map each record of a moved value to the records that it replaces.

        The middle end moves a record with its value, even past a later assignment to the variable. At the old place it
        leaves a record that computes the value from operands. The moved record is valid only where the record
        left behind is valid.
        """
        by_variable: dict[str, list[int]] = {}
        for k, record in enumerate(self.records):
            by_variable.setdefault(record.variable, []).append(k)
        found: dict[int, set[int]] = {}
        for same in by_variable.values():
            for k in same:
                value = self.records[k].value
                sources = {id(a) for a in value.args} if isinstance(value, Instr) else set()
                computed = [o for o in same if o != k and self.records[o].expression]
                origins = {o for o in computed if id(self.records[o].value) in sources}
                if origins:
                    found[k] = origins
        return found

    def apply(self, k: int, known: ValidRecords) -> None:
        """Update the valid records by record `k`."""
        name = self.records[k].variable
        if k in self.replaced and known.get(name) not in {k, *self.replaced[k]}:
            known.pop(name, None)
        else:
            known[name] = k

    def mark(self, b: Block, known: ValidRecords) -> None:
        """Bind the lines of a block to their records."""
        at = 0
        mine = self.of.get(b.name, [])
        made: dict[tuple[str, tuple[int, ...]], BoundLine] = {}
        for n, i in enumerate(b.instrs):
            while at < len(mine) and self.records[mine[at]].index <= n:
                self.apply(mine[at], known)
                at += 1
            if i.line is not None:
                key = (str(i.line), tuple(sorted(known.values())))
                if key not in made:
                    made[key] = BoundLine(i.line)
                    made[key].records = key[1]
                i.line = made[key]


def name_of(record: DbgRecord, info: DebugMetadata) -> str:
    """Key of a variable: its metadata reference, followed by that of the call at which its function was inlined."""
    call = info.node(record.location).get("inlinedAt", "") if record.location else ""
    return f"{record.variable}{call}"


def _meet(incoming: list[ValidRecords]) -> ValidRecords:
    """Records that are valid on all incoming paths."""
    if not incoming:
        return {}
    first = incoming[0]
    return {name: k for name, k in first.items() if all(other.get(name) == k for other in incoming[1:])}


def in_memory(f: Function, info: DebugMetadata) -> dict[int, Instr]:
    """Alloca of the variable, by index of each assignment record after which the whole variable is in memory.

    The store linked to the record precedes it, or the object has not been written yet. Variables that are partly in
    registers are excluded.
    """
    found: dict[int, Instr] = {}
    split: set[str] = set()
    stores: dict[object, list[tuple[str, int, Instr]]] = {}
    for b in f.blocks:
        for n, i in enumerate(b.instrs):
            if "assign" in i.extra:
                stores.setdefault(i.extra["assign"], []).append((b.name, n, i))
    for k, record in enumerate(f.dbg_records):
        done = any(
            i.op == "alloca" or (block == record.block and n < record.index)
            for block, n, i in stores.get(record.link, ())
        )
        home = root(record.address) if isinstance(record.address, Instr) else None
        plain = not record.expression or "LLVM_fragment" in record.expression
        if done and plain and home is not None and home.op == "alloca" and _is_whole(home, record, info):
            found[k] = home
        elif record.expression:
            split.add(name_of(record, info))
    return {k: home for k, home in found.items() if name_of(f.dbg_records[k], info) not in split}


def _is_whole(home: Instr, record: DbgRecord, info: DebugMetadata) -> bool:
    """Whether an object has the size of the variable, so that it is not one part of a split variable."""
    t = home.extra.get("type")
    return isinstance(t, Type) and 8 * size_of(t) == info.bits(info.node(record.variable).get("type", ""))


def constants(f: Function) -> dict[str, bytes]:
    """Constant value of each variable (`name_of`) whose records all have that value."""
    found: dict[str, set[bytes | None]] = {}
    for record in f.dbg_records:
        v = record.value
        known = record.kind == "dbg_value" and isinstance(v, ConstInt) and not record.expression
        found.setdefault(record.variable, set()).add(bytes_of(v) if known and isinstance(v, ConstInt) else None)
    return {name: value for name, values in found.items() if len(values) == 1 and (value := next(iter(values)))}


def bytes_of(v: ConstInt) -> bytes:
    """Bytes of a constant as they are in memory."""
    return v.value.to_bytes((v.type.bits + 7) // 8, "little")


def root(address: Instr) -> Instr:
    """The instruction at the start of the getelementptr chain that computes an address."""
    while address.op == "getelementptr" and isinstance(address.args[0], Instr):
        address = address.args[0]
    return address
