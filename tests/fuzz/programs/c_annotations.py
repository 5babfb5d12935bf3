"""Random C with correct annotations of <bounds.h>. Loop counts are data, so that only the annotations bound the
program.

Each part of a program is a function that main calls. The lengths of its lists and the frequency of its rare calls
agree with the annotations, often exactly. Both files use the same names, also for static functions, but different
numbers.
"""

from __future__ import annotations

import random
from collections.abc import Callable

HEAD = """#include <bounds.h>
struct item { struct item *next; int key; };
extern volatile int seen, chance;
"""
VISIT = """__attribute__((noinline)) static void visit(struct item *p)
{{
    seen += p->key;
    __asm__ volatile("repeat #{}\\n nop");
}}
__attribute__((noinline)) static void repair(int n)
{{
    __asm__ volatile("repeat #{}\\n nop" :: "r"(n) : "memory");
    seen ^= n;
}}
"""


class Program:
    """Sources with annotations in `files`, by name. Equal seeds give equal programs."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed ^ 0x4E0735)
        self.files: dict[str, str] = {}
        calls: list[str] = []
        for name in ("a", "b"):
            self.name, self.lines, self.start = name, [], []
            rng = self.rng
            if rng.random() < 0.5:
                self.lines.append("LINKS_IN_RAM();")
            self.lines.append(VISIT.format(rng.randrange(5, 200), rng.randrange(50, 2000)))
            for number in range(rng.randrange(1, 4)):
                part = f"part_{name}{number}"
                times = rng.choice((1, 1, 2, 3))
                rng.choice(PARTS)(self, part, times)
                calls += [part] * times
            self.lines.append(f"void start_{name}(void)\n{{\n" + "\n".join(self.start) + "\n}")
            self.files[f"{name}.c"] = HEAD + "\n".join(self.lines) + "\n"
        self.rng.shuffle(calls)
        declared = "".join(f"void {part}(void);\n" for part in sorted(set(calls)))
        body = "\n".join(f"    {part}();" for part in calls)
        main = f"volatile int seen, chance;\nvoid start_a(void), start_b(void);\n{declared}"
        main += f"int main(void)\n{{\n    start_a();\n    start_b();\n{body}\n    return seen & 1;\n}}\n"
        self.files["main.c"] = main

    def add(self, text: str, **values: object) -> None:
        """Append lines to the file, with each @name@ replaced by its value."""
        for key, value in values.items():
            text = text.replace(f"@{key}@", str(value))
        self.lines.append(text)

    def list(self, name: str, length: int) -> None:
        """Define a list of a given length that the start-up code builds, so that compiler and bounds cannot know its
        length."""
        self.lines.append(f"struct item items_{name}[{max(1, length)}], *volatile {name};")
        if length:
            loop = f"for (int i = 1; i < {length}; i++) items_{name}[i - 1].next = &items_{name}[i], "
            self.start.append(f"    {loop}items_{name}[i].key = i;\n    {name} = items_{name};")

    def spare(self, count: int) -> int:
        """Return a correct limit: the count, or slightly more."""
        return count + self.rng.choice((0, 0, 0, 1, 3))


def walk(p: Program, part: str, times: int) -> None:
    """LOOP_BOUND of a loop over a list, with several back edges."""
    length = p.rng.randrange(12)
    p.list(f"list_{part}", length)
    form = p.rng.choice((
        "for (struct item *i = list_@part@; i; i = i->next) {\n@body@    }",
        "struct item *i, *n = list_@part@;\n@note@    while ((i = n) != 0) {\n        n = i->next;\n@body@    }",
    ))  # fmt: skip
    body = p.rng.choice((
        "        visit(i);\n",
        "        if (i->key & 1)\n            continue;\n        visit(i);\n",
        "        if (i->key & 1) {\n            visit(i);\n        } else {\n            repair(i->key);\n        }\n",
    ))  # fmt: skip
    note = f"    LOOP_BOUND({p.spare(length)}); ONE_LOOP();\n"
    form = form if "@note@" in form else "@note@    " + form
    p.add("void @part@(void)\n{\n    " + form.lstrip() + "\n}", body=body, note=note, part=part)


def table(p: Program, part: str, times: int) -> None:
    """LOOP_TOTAL: lists in buckets; the total of their lengths is limited."""
    lengths = [p.rng.randrange(6) for _ in range(p.rng.choice((2, 4, 5)))]
    for number, length in enumerate(lengths):
        p.list(f"list_{part}_{number}", length)
    buckets = ", ".join(f"&list_{part}_{number}" for number in range(len(lengths)))
    p.add("""void @part@(void)
{
    struct item *volatile *const buckets[] = {@buckets@};
    for (int b = 0; b < @count@; b++) {
        LOOP_BOUND(@most@); LOOP_TOTAL(@total@);
        for (struct item *i = *buckets[b]; i; i = i->next)
            visit(i);
    }
}""", part=part, buckets=buckets, count=len(lengths), most=p.spare(max(lengths)),
          total=p.spare(times * sum(lengths)))  # fmt: skip


def shared(p: Program, part: str, times: int) -> None:
    """LOOP_SHARE: each loop continues where the last one ended."""
    length, first = p.rng.randrange(1, 12), p.rng.randrange(9)
    p.list(f"list_{part}", length)
    p.add("""__attribute__((noinline)) static struct item *down_@part@(struct item *i, int most)
{
    LOOP_BOUND(@length@); LOOP_SHARE(@part@, @length@); ONE_LOOP();
    while (i && most--) {
        visit(i);
        i = i->next;
    }
    return i;
}
void @part@(void)
{
    down_@part@(down_@part@(list_@part@, chance + @first@), 99);
}""", part=part, length=p.spare(length), first=first)  # fmt: skip


def rare(p: Program, part: str, times: int) -> None:
    """CALL_SHARE and CALL_IF apply to one call; another call of the same function has no annotation."""
    rounds = p.rng.randrange(1, 12)
    wanted = [p.rng.random() < 0.3 for _ in range(rounds)]
    p.add("unsigned char wanted_@part@[@rounds@];", part=part, rounds=rounds)
    p.start += [f"    wanted_{part}[{i}] = 1;" for i, yes in enumerate(wanted) if yes]
    p.add("""void @part@(void)
{
    for (int i = 0; i < @rounds@; i++) {
        CALL_SHARE(repair, @part@, @count@);
        if (wanted_@part@[i]) repair(i);
        @other@
        CALL_IF(repair, @made@);
        if (chance) repair(3);
    }
}""", part=part, rounds=rounds, count=p.spare(sum(wanted)), made=p.rng.choice((0, 0, 1)),
          other=p.rng.choice(("repair(7);", "", "visit((struct item *)wanted_@part@);".replace("@part@", part)))
          if rounds > 3 else "")  # fmt: skip


def pointed(p: Program, part: str, times: int) -> None:
    """CALL_TARGETS of a call whose target depends on data; LOOPS_OF the target that has a loop."""
    length, chosen = p.rng.randrange(9), p.rng.choice(("few", "many"))
    p.list(f"list_{part}", length)
    p.add("""LOOPS_OF(many_@part@, @length@);
__attribute__((noinline)) static void few_@part@(struct item *i) { repair(i != 0); }
__attribute__((noinline)) static void many_@part@(struct item *i)
{
    for (; i; i = i->next)
        visit(i);
}
void (*volatile chosen_@part@)(struct item *) = few_@part@;
void @part@(void)
{
    CALL_TARGETS(few_@part@, many_@part@);
    chosen_@part@(list_@part@);
}""", part=part, length=p.spare(length))  # fmt: skip
    p.start.append(f"    chosen_{part} = many_{part}, chosen_{part} = {chosen}_{part};")


def known_value(p: Program, part: str, times: int) -> None:
    """KNOWN_VALUE of a variable that is never written."""
    value = p.rng.randrange(20)
    p.add("""volatile unsigned count_@part@ = @value@;
KNOWN_VALUE(count_@part@, @value@);
void @part@(void)
{
    for (unsigned i = count_@part@; i; i--)
        repair(i);
}""", part=part, value=value)  # fmt: skip


PARTS: tuple[Callable[[Program, str, int], None], ...] = (walk, table, shared, rare, pointed, known_value)
