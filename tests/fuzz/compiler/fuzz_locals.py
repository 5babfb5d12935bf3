"""Locals and parameters in a debugger: `python tests/fuzz/compiler/fuzz_locals.py [--files N] [--seed N]`.

Each file has ten random functions and a model of the value of every variable before every line. At -O0 the debugger
must show the right value of each variable that has been set, at the beginning of every line. At -Os lines are
reordered, so a shown value is counted as right if the variable has it anywhere in the model's run. Other values are
counted and are no failure: where only some bits of a variable are used, the optimiser's debug information describes
only those bits.
"""

from __future__ import annotations

import random
import sys
import tempfile
from collections import Counter
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

import emu  # noqa: E402
from emu.debug.dwarf.location import Unavailable  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

FUNCTIONS = 10
OPERATORS = ("+", "-", "^", "&", "|", "*")
State = dict[str, int]
Run = list[tuple[int, State]]
"""Executed lines in order, each with the values of the variables before it."""


class Function:
    """A random function that begins at line `first`: its text, and its execution by the model."""

    def __init__(self, name: str, rng: random.Random, first: int) -> None:
        self.name, self.rng = name, rng
        self.parameters = [f"p{n}" for n in range(rng.randrange(1, 5))]
        self.fixed = self.parameters[: rng.randrange(len(self.parameters) + 1)]
        self.locals = [f"v{n}" for n in range(rng.randrange(2, 7))]
        self.arguments = [rng.randrange(1 << 16) for _ in self.parameters]
        head = ", ".join(f"unsigned {one}" for one in self.parameters)
        self.lines = [f"unsigned __attribute__((noinline, used)) {name}({head})", "{"]
        self.first = first
        self.run: Run = []
        self._state: State = dict(zip(self.parameters, self.arguments, strict=True))
        for one in self.locals:
            self._assign(one, "unsigned ", self._term(), 1)
        for _ in range(rng.randrange(3, 9)):
            self._statement()
        self._line(f"return {' ^ '.join(self.locals)};")
        self.lines.append("}")

    def _line(self, text: str) -> None:
        """Append a line that is executed."""
        self.run.append((self.first + len(self.lines), dict(self._state)))
        self.lines.append(f"    {text}")

    def _term(self) -> str:
        known = sorted(self._state)
        left, right = self.rng.choice(known), self.rng.choice([*known, str(self.rng.randrange(1, 99)), "volatile_one"])
        return f"{left} {self.rng.choice(OPERATORS)} {right}"

    def _value(self, term: str) -> int:
        return int(eval(term, {"volatile_one": 1}, dict(self._state))) & 0xFFFF

    def _assign(self, name: str, kind: str, term: str, times: int) -> None:
        """Append an assignment, which the model executes unless `times` is 0."""
        text = f"{kind}{name} = {term};"
        if not times:
            self.lines.append(f"    {text}")
            return
        self._line(text)
        self._state[name] = self._value(term)

    def _changed(self) -> str:
        return self.rng.choice([*self.locals, *(one for one in self.parameters if one not in self.fixed)])

    def _statement(self) -> None:
        kind = self.rng.random()
        if kind < 0.6:
            self._assign(self._changed(), "", self._term(), 1)
            return
        condition = f"({self._term()}) & {self.rng.choice((1, 2, 4))}"
        taken = bool(self._value(condition))
        self._line(f"if ({condition}) {{")
        for _ in range(self.rng.randrange(1, 3)):
            self._assign(self._changed(), "", self._term(), int(taken))
        self.lines.append("    } else {")
        for _ in range(self.rng.randrange(1, 3)):
            self._assign(self._changed(), "", self._term(), int(not taken))
        self.lines.append("    }")


def program(seed: int) -> tuple[str, list[Function]]:
    """Return the text of a C file and its functions."""
    rng = random.Random(seed)
    lines, functions = ["volatile unsigned result, volatile_one = 1;"], []
    for number in range(FUNCTIONS):
        functions.append(Function(f"f{number}", rng, len(lines) + 1))
        lines += functions[-1].lines
    calls = " ".join(f"result = {one.name}({', '.join(map(str, one.arguments))});" for one in functions)
    return "\n".join([*lines, f"int main(void) {{ {calls} return 0; }}"]) + "\n", functions


def check_functions(image: Path, functions: list[Function], exact: bool, tally: Counter[str]) -> None:
    """Step through every function and compare its variables. Raises AssertionError."""
    machine = emu.load(image, board=None)
    starts = {row.start: row.line for row in machine.inspector.image.lines.rows}
    called = called_functions(image, functions)
    for function in functions:
        # the compiler may have replaced calls without effects by their results, and the linker dropped the function
        if not exact and function.name not in called:
            tally["gone"] += 1
            continue
        assert machine.run(until=function.name).reason == "until"
        everything: dict[str, set[int]] = {}
        for _, state in function.run:
            for name, value in state.items():
                everything.setdefault(name, set()).add(value)
        lines, visits, last = {line for line, _ in function.run}, list(function.run), 0
        entry = machine.w[15]
        while machine.w[15] >= entry - 4:
            line = starts.get(machine.pc)
            if line in lines and line != last and machine.inspector.function_name(machine.pc) == function.name:
                last = line
                if exact:
                    expected_line, state = visits.pop(0)
                    assert line == expected_line, f"{function.name}: line {line} instead of {expected_line}"
                    compare(machine, {name: {value} for name, value in state.items()}, False, tally)
                else:
                    compare(machine, everything, True, tally)
            machine.step()
            if machine.w[15] < entry:
                break
        assert not (exact and visits), f"{function.name}: lines never reached: {visits[0][0]}"
        tally["functions"] += 1


def called_functions(image: Path, functions: list[Function]) -> set[str]:
    """Return the names of the functions that a run of the image calls."""
    machine = emu.load(image, board=None)
    called: set[str] = set()
    for one in functions:
        if machine.inspector.image.symbols.find(one.name) is not None:
            machine.hook_pc(one.name, partial(called.add, one.name))
    machine.run()
    return called


def compare(machine: emu.Machine, expected: dict[str, set[int]], may_lack: bool, tally: Counter[str]) -> None:
    """Compare the variables of the innermost frame with their expected values. `may_lack`: a value may be absent or
    different."""
    frame = machine.backtrace()[0]
    for name, values in expected.items():
        variable = machine.inspector.variable(name, frame)
        assert variable is not None, f"{name} is not known at {machine.inspector.where(machine.pc)}"
        try:
            value = machine.inspector.value(variable, frame).get()
        except Unavailable as why:
            if not may_lack:
                raise AssertionError(f"{name} at {machine.inspector.where(machine.pc)}: {why}") from None
            tally["without value"] += 1
            continue
        where = machine.inspector.where(machine.pc)
        assert may_lack or value in values, f"{name} is shown as {value} at {where}, not {sorted(values)}"
        tally["values" if value in values else "others"] += 1


def check_file(seed: int, folder: Path, tally: dict[str, Counter[str]]) -> None:
    """Test one file at both levels."""
    text, functions = program(seed)
    source = folder / "random.c"
    source.write_text(text)
    for level in ("-O0", "-Os"):
        image = emu.build(source, flags=(level, "-g"), output=folder / "random.elf")
        check_functions(image, functions, level == "-O0", tally[level])


def main() -> int:
    campaign = Campaign(parser(__doc__), "files", 20, "files of ten functions")
    campaign.parse()
    tally: dict[str, Counter[str]] = {"-O0": Counter(), "-Os": Counter()}
    with tempfile.TemporaryDirectory() as folder:
        for seed in campaign:
            try:
                check_file(seed, Path(folder), tally)
            except AssertionError as error:
                return campaign.failed(error)
    summary = "; ".join(
        f"{level}: {one['values']:,} values right, {one['others']:,} others, {one['without value']:,} optimised out"
        for level, one in tally.items()
    )
    return campaign.ended(f"{tally['-O0']['functions']} functions, {summary}")


if __name__ == "__main__":
    sys.exit(main())
