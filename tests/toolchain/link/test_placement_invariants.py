"""Sections of random programs never overlap and keep the rules of their kinds (abi-elf.md §3.3)."""

import random
from itertools import pairwise

import pytest

from emu.image.elf_facts import SectionFlag
from toolchain.asm.assemble import assemble
from toolchain.errors import ToolError
from toolchain.link.link import link
from toolchain.link.options import LinkOptions
from toolchain.link.place import even, is_const, space_of

KINDS = (
    ("code", 0x900), ("code,align(16)", 0x300), ("psv,page", 0x1200), ("bss,near", 0x200), ("data,near", 0x100),
    ("bss", 0x300),
    ("data", 0x80), ("bss,xmemory", 0x80), ("bss,ymemory", 0x80), ("data,ymemory,align(32)", 0x40),
    ("bss,reverse(64)", 0x60),
    ("persist", 0x40), ("eedata", 0x80), ("bss,near,align(128)", 0x90), ("data,noload", 0x20),
)  # fmt: skip


def program(rng):
    lines = [" .global __reset\n__reset: nop"]
    for number in range(rng.randint(5, 40)):
        kind, limit = rng.choice(KINDS)
        name = ".const" if kind.startswith("psv") and rng.random() < 0.5 else f"s{number}"
        if (
            rng.random() < 0.1
            and "align" not in kind
            and "reverse" not in kind
            and kind != "eedata"
            and name != ".const"
        ):
            base = 0x200 if kind.startswith(("code", "psv")) else 0x1800 if "ymemory" in kind else 0x800
            kind += f",address({base + 2 * rng.randrange(0x700)})"
        lines.append(f" .section {name},{kind}\n .space {rng.randrange(limit)}")
    return "\n".join(lines) + "\n"


def linked_or_refused(obj):
    try:
        return link([obj], [], LinkOptions()), ""
    except ToolError as error:
        return None, str(error)


@pytest.mark.parametrize("seed", range(40))
def test_random_sections_keep_their_rules(seed):
    """Random sections keep alignment, near, X, Y, window and fixed addresses without overlap.

    .dinit covers all RAM that needs initialisation.
    """
    obj = assemble(program(random.Random(seed)), "r.s")[0]
    linked, refused = linked_or_refused(obj)
    if linked is None:
        assert any(reason in refused for reason in ("overlaps", "does not fit", "no room", "crosses"))
        return
    placed = linked.layout.placed
    for space in ("program", "data", "eeprom"):
        spans = sorted((p.load, p.load + p.size) for s, p in placed.items() if space_of(s) == space and p.size)
        assert all(end <= start for (_, end), (start, _) in pairwise(spans)), space
    for section, place in placed.items():
        check_rules(section, place)
    const = [p for s, p in placed.items() if s.is_psv and is_const(s) and p.size]
    assert len({p.load >> 15 for p in const}) <= 1
    covered = sum(record.size for record in linked.records)
    wanted = [s for s in placed if s.is_ram and not s.flags & (SectionFlag.PERSIST | SectionFlag.NOLOAD)]
    assert covered == sum(even(s.units) for s in wanted)


def check_rules(section, place):
    end = place.address + place.size
    if section.flags & SectionFlag.ABSOLUTE:
        assert place.load == section.load
    elif section.flags & SectionFlag.REVERSE:
        assert end % section.align == 0
    elif section.flags & SectionFlag.ALLOC:
        assert place.load % section.align == 0
    if section.is_psv and place.size:
        assert place.address == 0x8000 | place.load & 0x7FFF
        assert place.load >> 15 == place.load + place.size - 1 >> 15
    if section.is_ram and not section.flags & SectionFlag.ABSOLUTE:
        low = 0x1800 if section.flags & SectionFlag.YMEM else 0x800
        high = 0x1800 if section.flags & SectionFlag.XMEM else 0x2000 if section.flags & SectionFlag.NEAR else 0x2800
        assert low <= place.address
        assert end <= (0x2800 if section.flags & SectionFlag.YMEM else high)


def test_most_random_programs_link():
    """Most random programs link: proof that the test above examines placements."""
    results = [linked_or_refused(assemble(program(random.Random(seed)), "r.s")[0])[0] for seed in range(40)]
    assert sum(result is not None for result in results) >= 20
