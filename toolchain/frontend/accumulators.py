"""XC16's accumulator variables, such as `register int a asm("A")`, and its DSP builtins of one instruction each.

Clang has no 40-bit registers. `rewrite` therefore removes the variables from preprocessed C, and replaces each
`a = __builtin_mac(...)` by an asm statement on the accumulator. Operands are in W4 and W5, X pointers in W8, Y pointers
in W10, the write-back of the other accumulator in W13 (abi-elf.md §2.9). The input is preprocessed C with line markers.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from toolchain.errors import ToolError

REFUSED = re.compile(rb"unknown register name '[ABab]' in asm")
"""Pattern of clang's error message for a source that needs `rewrite`."""

_TOKEN = re.compile(
    r'(?P<marker>^#[^\n]*)|(?P<text>"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\')|(?P<name>[A-Za-z_]\w*)'
    r"|(?P<number>\.?\d[\w.]*)|(?P<sign>==|.)",
    re.MULTILINE | re.DOTALL,
)
_PLACE = re.compile(r'^# (\d+) "((?:[^"\\]|\\.)*)".*$', re.MULTILINE)
_ASM = {"asm", "__asm", "__asm__"}
_NULL = re.compile(r"[\s()]*(?:0|\(?\s*void\s*\*\s*\)?[\s(]*0)[\s()]*")


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    at: int


@dataclass
class _Prefetch:
    """Prefetch of MAC: pointer variable, variable for the element, step in bytes."""

    pointer: str
    value: str
    step: int


def rewrite(text: str) -> str:
    """`text` without accumulator variables. Raises ToolError that names the line of an unsupported use."""
    return _Rewriter(text).run()


class _Rewriter:
    """State of one rewrite: tokens, scopes with the accumulator of each variable, output so far."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.tokens = [
            _Token(m.lastgroup or "", m[0], m.start()) for m in _TOKEN.finditer(text) if m[0].strip() or m["marker"]
        ]
        self.scopes: list[dict[str, str]] = [{}]
        self.out: list[str] = []
        self.copied = 0

    def run(self) -> str:
        i = 0
        while i < len(self.tokens):
            i = self.step(i)
        return "".join([*self.out, self.text[self.copied :]])

    def step(self, i: int) -> int:
        """Process the token at `i`; return the index of the next one."""
        token = self.tokens[i]
        if token.text == "{":
            self.scopes.append({})
        elif token.text == "}" and len(self.scopes) > 1:
            self.scopes.pop()
        elif token.text == "register" and self.declares(i):
            return self.declaration(i)
        elif token.kind == "name" and self.accumulator(token.text) and not self.is_member(i):
            return self.assignment(i)
        elif token.text.removeprefix("__builtin_") in ("sac", "sacr", "movsac") and token.text.startswith("__builtin_"):
            return self.call(i, "", i)
        return i + 1

    def accumulator(self, name: str) -> str | None:
        return next((scope[name] for scope in reversed(self.scopes) if name in scope), None)

    def is_member(self, i: int) -> bool:
        before = "".join(t.text for t in self.tokens[max(0, i - 2) : i])
        return before.endswith((".", "->"))

    def end_of(self, i: int, closers: str) -> int:
        """Index of the first token from `i` on that is in `closers` and outside of parentheses."""
        depth = 0
        while i < len(self.tokens):
            text = self.tokens[i].text
            if depth == 0 and text in closers:
                return i
            depth += (text in "([{") - (text in ")]}") if len(text) == 1 else 0
            i += 1
        raise self.error(len(self.tokens) - 1, "the source ends inside a statement")

    def declares(self, i: int) -> bool:
        """Whether the declaration with `register` at `i` declares an accumulator variable."""
        words = [t.text for t in self.tokens[i : self.end_of(i, ";)")]]
        return any(a in _ASM and t.lower() in ('"a"', '"b"') for a, t in zip(words, words[2:], strict=False))

    def declaration(self, i: int) -> int:
        """Remove the declaration; initialisers become assignments."""
        end = self.end_of(i, ";")
        start = i
        while start and self.tokens[start - 1].text in ("volatile", "extern", "static", "int", "short", "const"):
            start -= 1
        self.copy_to(self.tokens[start].at)
        while i < end:
            stop = self.end_of(i, ",;")
            words = self.tokens[i:stop]
            at = next((k for k, t in enumerate(words) if t.text in _ASM), 0)
            if not at or words[at + 2].text.lower() not in ('"a"', '"b"'):
                raise self.error(i, "an accumulator and another variable in one declaration")
            self.scopes[-1][words[at - 1].text] = words[at + 2].text[1].upper()
            if len(words) > at + 4:
                self.copied = words[at - 1].at
                self.assignment(i + at - 1, skip=3 + 1)
                self.out.append(";")
            i = stop + 1
        self.copied = self.tokens[end].at  # the semicolon remains as an empty statement
        return end

    def copy_to(self, at: int) -> None:
        self.out.append(self.text[self.copied : at])
        self.copied = at

    def assignment(self, i: int, skip: int = 0) -> int:
        """Rewrite `a = __builtin_...(...)`; all other uses of accumulators are arguments."""
        target = self.accumulator(self.tokens[i].text)
        follows = i + 1 + skip
        if self.tokens[follows].text != "=":
            raise self.error(i, f"accumulator '{self.tokens[i].text}' can only be an argument of a DSP builtin")
        at = follows + 1
        while self.tokens[at].text in ("(", ")", "int", "short"):  # skip a cast
            at += 1
        if target is None or not self.tokens[at].text.startswith("__builtin_"):
            raise self.error(i, f"accumulator '{self.tokens[i].text}' takes the result of a DSP builtin only")
        return self.call(at, target, i)

    def call(self, at: int, target: str, start: int) -> int:
        """Replace the tokens from `start` to the end of the builtin call at `at`."""
        name = self.tokens[at].text.removeprefix("__builtin_")
        end = self.end_of(at + 2, ")")
        arguments: list[str] = []
        i = at + 2
        while i < end or (i == end and arguments):
            stop = min(self.end_of(i, ",)"), end)
            last = self.tokens[stop].at
            arguments.append(self.text[self.tokens[i].at : last].strip())
            i = stop + 1
        wanted = COUNTS.get(name)
        if wanted is None:
            raise self.error(at, f"there is no DSP builtin '{self.tokens[at].text}'")
        if len(arguments) != wanted:
            raise self.error(at, f"{self.tokens[at].text} takes {wanted} arguments, {len(arguments)} found")
        builtin = _Builtin(name, target, arguments, lambda what: self.error(at, what), self.accumulator)
        self.copy_to(self.tokens[start].at)
        self.out.append(builtin.text())
        self.copied = self.tokens[end].at + 1
        return end + 1

    def error(self, i: int, what: str) -> ToolError:
        at = self.tokens[i].at
        markers = list(_PLACE.finditer(self.text, 0, at))
        if not markers:
            return ToolError(f"<source>:{self.text.count(chr(10), 0, at) + 1}: error: {what}")
        marker = markers[-1]
        line = int(marker[1]) + self.text.count("\n", marker.end() + 1, at)
        return ToolError(f"{marker[2]}:{line}: error: {what}")


COUNTS = {"add": 3, "addab": 2, "subab": 2, "clr": 0, "clr_prefetch": 8, "ed": 6, "edac": 7, "lac": 2, "mac": 11,
          "msc": 11, "mpy": 8, "mpyn": 8, "movsac": 8, "sac": 2, "sacr": 2, "sftac": 2}  # fmt: skip
"""Number of arguments of each builtin."""


@dataclass
class _Builtin:
    """One builtin call; `target` is the accumulator that it changes, or "" for builtins that return a value."""

    name: str
    target: str
    arguments: list[str]
    error: Callable[[str], ToolError]
    accumulator: Callable[[str], str | None]

    def text(self) -> str:
        """The statement expression that replaces the call."""
        a, name = self.arguments, self.name
        if name in ("sac", "sacr"):
            instruction = f"{name.replace('sacr', 'sac.r')} {self.own(a[0])},#{self.literal(a[1], -8, 7)},%0"
            return f'(__extension__({{ int __v; __asm__ volatile("{instruction}" : "=r"(__v)); __v; }}))'
        if name == "movsac":
            return self.engine("movsac A", [], a[0:6], a[6:8])
        if not self.target:
            raise self.error(f"the result of __builtin_{name} goes to an accumulator variable")
        if name == "clr":
            return f'__asm__ volatile("clr {self.target}")'
        if name in ("addab", "subab"):
            if {self.own(a[0]), self.own(a[1])} != {"A", "B"}:
                raise self.error(f"__builtin_{name} works on both accumulators")
            return f'__asm__ volatile("{name[:3]} {self.target}")'
        if name == "sftac":
            self.same(a[0])
            return f'__asm__ volatile("sftac {self.target},#{self.literal(a[1], -16, 16)}")'
        if name == "lac":
            return f'__asm__ volatile("lac %0,#{self.literal(a[1], -8, 7)},{self.target}" :: "r"((int)({a[0]})))'
        if name == "add":
            self.same(a[0])
            return f'__asm__ volatile("add %0,#{self.literal(a[2], -8, 7)},{self.target}" :: "r"((int)({a[1]})))'
        if name in ("mac", "msc", "edac"):
            self.same(a[0])
            a = a[1:]
        if name in ("ed", "edac"):
            return self.distance(a)
        if name == "clr_prefetch":
            return self.engine(f"clr {self.target}", [], a[0:6], a[6:8])
        return self.engine(f"{name.replace('mpyn', 'mpy.n')} w4*w5,{self.target}", a[0:2], a[2:8], a[8:10])

    def own(self, argument: str) -> str:
        """The accumulator that an argument names. Raise ToolError if it is no accumulator variable."""
        found = self.accumulator(argument.strip("() "))
        if found is None:
            raise self.error(f"'{argument}' is not an accumulator variable")
        return found

    def same(self, argument: str) -> None:
        if self.own(argument) != self.target:
            raise self.error(f"__builtin_{self.name} works on one accumulator; its argument is another than its result")

    def literal(self, argument: str, low: int, high: int) -> int:
        try:
            value = int(argument.strip("() ").replace(" ", ""), 0)
        except ValueError:
            raise self.error(f"'{argument}' must be a number from {low} to {high}") from None
        if not low <= value <= high:
            raise self.error(f"{value} is out of range ({low} to {high})")
        return value

    def prefetch(self, pointer: str, value: str, step: str) -> _Prefetch | None:
        if _NULL.fullmatch(pointer):
            return None
        number = self.literal(step, -6, 6)
        if number % 2:
            raise self.error("a prefetch moves its pointer by an even number of bytes")
        return _Prefetch(pointer, value, number)

    def engine(self, instruction: str, factors: list[str], moved: list[str], back: list[str]) -> str:
        """Statement for a MAC-class instruction: two factors, prefetches from X and Y, accumulator write-back."""
        before, outputs, inputs, after = [], [], [], []
        for number, factor in enumerate(factors):
            before.append(f'register int __f{number} __asm__("r{4 + number}") = ({factor});')
            inputs.append(f'"r"(__f{number})')
        for number, k in enumerate((0, 3)):
            found = self.prefetch(moved[k], moved[k + 1], moved[k + 2])
            if found is None:
                continue
            pointer, value = 8 + 2 * number, 4 + number
            before.append(f'register int *__p{number} __asm__("r{pointer}") = *({found.pointer});')
            before.append(f'register int __v{number} __asm__("r{value}");')
            outputs += [f'"+r"(__p{number})', f'"=r"(__v{number})']
            after += [f"*({found.pointer}) = __p{number};", f"*({found.value}) = __v{number};"]
            instruction += f",[w{pointer}]{_moving(found.step)},w{value}"
        if back and not _NULL.fullmatch(back[0]):
            if self.target == self.own(back[1]):
                raise self.error("the accumulator that is written back is the other one")
            if self.name == "movsac":
                instruction = instruction.replace("movsac A", "movsac " + ("B" if self.own(back[1]) == "A" else "A"))
            before.append('register int __w __asm__("r13");')
            outputs.append('"=r"(__w)')
            after.append(f"*({back[0]}) = __w;")
            instruction += ",w13"
        return _statement(before, instruction, outputs, inputs, after)

    def distance(self, a: list[str]) -> str:
        """Statement for ED and EDAC: square W4, and load the difference of two elements for the next instruction."""
        x, y = self.prefetch(a[1], a[5], a[2]), self.prefetch(a[3], a[5], a[4])
        if x is None or y is None:
            raise self.error(f"__builtin_{self.name} needs both pointers")
        before = [f'register int __f0 __asm__("r4") = ({a[0]});', 'register int __v0 __asm__("r4");']
        before += [f'register int *__p0 __asm__("r8") = *({x.pointer});']
        before += [f'register int *__p1 __asm__("r10") = *({y.pointer});']
        instruction = f"{self.name} w4*w4,{self.target},[w8]{_moving(x.step)},[w10]{_moving(y.step)},w4"
        after = [f"*({x.pointer}) = __p0;", f"*({y.pointer}) = __p1;", f"*({x.value}) = __v0;"]
        return _statement(before, instruction, ['"+r"(__p0)', '"+r"(__p1)', '"=r"(__v0)'], ['"r"(__f0)'], after)


def _moving(step: int) -> str:
    return f"{'-' if step < 0 else '+'}={abs(step)}" if step else ""


def _statement(before: list[str], instruction: str, outputs: list[str], inputs: list[str], after: list[str]) -> str:
    operands = f'{", ".join(outputs)} : {", ".join(inputs)} : "memory"'
    body = f'{" ".join(before)} __asm__ volatile("{instruction}" : {operands}); {" ".join(after)}'
    return f"(__extension__({{ {body} }}))"
