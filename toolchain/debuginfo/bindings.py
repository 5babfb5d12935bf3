"""Which debug record holds for each source variable at each instruction: forward data flow over a function's records.

Needs: IR as read. Ensures: the `line` of every instruction that has one is a `Position`, which passes hand on as they
hand on lines. Where two ways into a block disagree, nothing is known of the variable.
"""

from __future__ import annotations

from toolchain.debuginfo.metadata import DebugInfo
from toolchain.ir.cfg import predecessors
from toolchain.ir.model import Arg, Block, ConstInt, DbgRecord, Function, Instr, Type, size_of

Known = dict[str, int]
"""Variable (with the place it was inlined at) -> index of its record."""

MOST_ROUNDS = 50  # of the data flow; a function that needs more has no locations


class Position(str):
    """A !dbg reference that knows the records holding where it stands."""

    records: tuple[int, ...] = ()


def bind(f: Function, info: DebugInfo) -> None:
    """Give every line of `f` its records. Assignments become values, or memory where that holds the value."""
    for k, home in in_memory(f, info).items():
        f.dbg_records[k].kind, f.dbg_records[k].value = "memory", home
    for record in f.dbg_records:
        if record.kind == "dbg_declare" and isinstance(record.value, Arg):  # a struct, perhaps in registers
            record.kind = "parameter"
        if record.kind == "dbg_assign":
            record.kind = "dbg_value"
            if isinstance(record.address, Instr):  # on its way to memory, which others may change from then on
                record.value = None
        record.variable = name_of(record, info)
    if not any(record.kind != "dbg_declare" for record in f.dbg_records):
        return
    records = _Records(f)
    preds = predecessors(f)
    after: dict[str, Known] = {}
    for _ in range(MOST_ROUNDS):
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


class _Records:
    """The records of a function by block, and what each does to what is known."""

    def __init__(self, f: Function) -> None:
        self.records = f.dbg_records
        self.of: dict[str, list[int]] = {}
        for k, record in enumerate(f.dbg_records):
            if record.kind != "dbg_declare":
                self.of.setdefault(record.block, []).append(k)
        self.sunk = self._sunk()

    def _sunk(self) -> dict[int, set[int]]:
        """Record -> those that it continues, of values that the middle end has moved down.

        It takes the record along, also past a later assignment to the same variable, and leaves one in the old place
        that computes the value from its operands. Only where that one still holds does the moved one hold.
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

    def apply(self, k: int, known: Known) -> None:
        """What is known behind record `k`."""
        name = self.records[k].variable
        if k in self.sunk and known.get(name) not in {k, *self.sunk[k]}:
            known.pop(name, None)
        else:
            known[name] = k

    def mark(self, b: Block, known: Known) -> None:
        """Give the lines of a block their records."""
        at = 0
        mine = self.of.get(b.name, [])
        made: dict[tuple[str, tuple[int, ...]], Position] = {}
        for n, i in enumerate(b.instrs):
            while at < len(mine) and self.records[mine[at]].index <= n:
                self.apply(mine[at], known)
                at += 1
            if i.line is not None:
                key = (str(i.line), tuple(sorted(known.values())))
                if key not in made:
                    made[key] = Position(i.line)
                    made[key].records = key[1]
                i.line = made[key]


def name_of(record: DbgRecord, info: DebugInfo) -> str:
    """Reference of the variable, and behind it that of the call where its function was inlined."""
    call = info.node(record.location).get("inlinedAt", "") if record.location else ""
    return f"{record.variable}{call}"


def _meet(ways: list[Known]) -> Known:
    if not ways:
        return {}
    first = ways[0]
    return {name: k for name, k in first.items() if all(way.get(name) == k for way in ways[1:])}


def in_memory(f: Function, info: DebugInfo) -> dict[int, Instr]:
    """Indices of assignments behind which the variable lies whole in memory -> its alloca.

    The store that the record is linked to stands before it, or the object has not been written yet. A variable of which
    some part has gone into registers lies nowhere whole.
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
        if done and plain and home is not None and home.op == "alloca" and _holds(home, record, info):
            found[k] = home
        elif record.expression:
            split.add(name_of(record, info))
    return {k: home for k, home in found.items() if name_of(f.dbg_records[k], info) not in split}


def _holds(home: Instr, record: DbgRecord, info: DebugInfo) -> bool:
    """Whether the object is as large as the variable: a part of one that was taken apart is not."""
    t = home.extra.get("type")
    return isinstance(t, Type) and 8 * size_of(t) == info.bits(info.node(record.variable).get("type", ""))


def constants(f: Function) -> dict[str, bytes]:
    """Variables (`name_of`) that are one number wherever they are anything."""
    found: dict[str, set[bytes | None]] = {}
    for record in f.dbg_records:
        v = record.value
        known = record.kind == "dbg_value" and isinstance(v, ConstInt) and not record.expression
        found.setdefault(record.variable, set()).add(bytes_of(v) if known and isinstance(v, ConstInt) else None)
    return {name: value for name, values in found.items() if len(values) == 1 and (value := next(iter(values)))}


def bytes_of(v: ConstInt) -> bytes:
    """The number as memory holds it."""
    return v.value.to_bytes((v.type.bits + 7) // 8, "little")


def root(address: Instr) -> Instr:
    """The object an address lies in, as far as it is computed from one."""
    while address.op == "getelementptr" and isinstance(address.args[0], Instr):
        address = address.args[0]
    return address
