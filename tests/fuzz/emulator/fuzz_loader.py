"""Mutated ELF and HEX files: the loader returns a valid image or refuses the file with a clear message.

`python tests/fuzz/emulator/fuzz_loader.py [--inputs N] [--seed S] [--seconds T]`; exits with 1 at the first input with
another outcome.
"""

from __future__ import annotations

import random
import sys
import traceback
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from emu.commands.info import describe  # noqa: E402
from emu.image.footprint import pieces  # noqa: E402
from emu.image.loader import parse_image  # noqa: E402
from emu.image.model import LoadError  # noqa: E402
from emu.instruments.disassembly import items  # noqa: E402
from tests.emu.loader.dwarf_samples import debug_sections  # noqa: E402
from tests.emu.loader.elf_samples import words, xc16_like  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

INTERESTING = (0, 1, 2, 3, 4, 7, 8, 0x7F, 0x80, 0xFF, 0x100, 0x7FFF, 0x8000, 0xFFFF, 0x17FFE, 0x18000, 0x7FF000)
WIDE = (*INTERESTING, 0xF80000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFE, 0xFFFFFFFF)


def samples() -> list[bytes]:
    """Return the valid files that are mutated: an ELF file with DWARF, and the same program as HEX."""
    sample = xc16_like()
    sample.parts += debug_sections()
    elf = sample.build()
    lines = []
    for address, word in parse_image(elf, "seed").words():
        for kind, place, data in (
            (4, 0, (2 * address >> 16).to_bytes(2, "big")),
            (0, 2 * address & 0xFFFF, words(word)),
        ):
            body = bytes((len(data), place >> 8, place & 0xFF, kind)) + data
            lines.append(b":" + (body + bytes((-sum(body) & 0xFF,))).hex().encode())
    return [elf, b"\n".join([*lines, b":00000001FF", b""])]


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Make one to four random changes: bits flipped, fields replaced by unusual numbers, parts cut, doubled or
    moved."""
    out = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        if not out:
            break
        place, choice = rng.randrange(len(out)), rng.randrange(7)
        if choice == 0:
            out[place] ^= 1 << rng.randrange(8)
        elif choice == 1:
            out[place] = rng.randrange(256)
        elif choice == 2:
            place &= ~1
            size = rng.choice((2, 4))
            out[place : place + size] = (rng.choice(WIDE) & (1 << 8 * size) - 1).to_bytes(size, "little")
        elif choice == 3:
            del out[place:]
        elif choice == 4:
            del out[place : place + rng.randint(1, 40)]
        elif choice == 5:
            out[place:place] = out[rng.randrange(len(out)) :][: rng.randint(1, 80)]
        else:
            out[place] = rng.choice(b"0123456789abcdef:\r\n \0\xff")
    return bytes(out)


def attempt(data: bytes) -> str:
    """Load an image and use it as the commands do. Return the kind of outcome."""
    try:
        image = parse_image(data, "fuzz")
    except LoadError:
        return "refused"
    assert len(image.flash()) == image.chip.program["flash"].size // 2
    for address, word in image.words():
        assert address % 2 == 0
        assert 0 <= word <= 0xFFFFFF
    image.symbols.variable_at(0x802)
    memory = describe(image)["memory"]
    assert sum(len(item.words) for item in items(image, 0, 1 << 24)) == memory["flash_words"]
    assert sum(piece.rom for piece in pieces(image)) == (memory["flash_bytes"] if image.kind == "elf" else 0)
    assert all(image.lines.files.values())
    return "loaded"


def campaign(seeds: Iterable[int]) -> Counter[str]:
    """Return the number of outcomes for a mutated file of every seed. Re-raises other exceptions with the input in a
    note."""
    starts = samples()
    outcomes: Counter[str] = Counter()
    for seed in seeds:
        data = mutate(starts[seed % len(starts)], random.Random(seed))
        try:
            outcomes[attempt(data)] += 1
        except Exception as error:
            error.add_note(f"input: {data.hex()}")
            raise
    return outcomes


def main() -> int:
    plan = Campaign(parser(__doc__), "inputs", 20_000, "files")
    plan.parse()
    try:
        outcomes = campaign(plan)
    except Exception:
        return plan.failed(traceback.format_exc())
    return plan.ended(str(dict(outcomes)))


if __name__ == "__main__":
    sys.exit(main())
