"""Damage to text files: numbers, tokens and values of JSON replaced, dropped or doubled."""

from __future__ import annotations

import json
import math
import random
import re
from typing import Any

NUMBERS = (
    "nan", "inf", "-inf", "1e308", "-1", "0", "1e-300", "99999999999999999999", "-0.0", "7", "0.5", "1000", "65536",
    "9" * 400,
)  # fmt: skip
ODD = (
    *NUMBERS, "true", '""', "[]", "{}", "null", "'", '"', "\\", "[[", "]]", "../../x", "\u0000", "\ud7ff", "é", "=",
    "#", "\n\n", "0x", "1s", "[" * 600, "{" * 600,
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 7, 65536, 10**20, 0.5, 1e308, math.nan, -math.inf, "", "x", "0", [], [[]], {}, {"": 0},
)  # fmt: skip
TOKEN = re.compile(r"[A-Za-z_][\w.]*|-?[\d.]+|\"[^\"]*\"|\s+|.", re.DOTALL)


def mutate_text(data: bytes, rng: random.Random) -> bytes:
    """Replace numbers by others, which keeps the syntax valid, or replace, drop or double tokens, which damages it."""
    tokens = TOKEN.findall(data.decode(errors="replace"))
    numbers = [at for at, token in enumerate(tokens) if token[-1].isdigit()]
    if numbers and rng.random() < 0.6:
        for _ in range(rng.choice((1, 1, 2, 3))):
            tokens[rng.choice(numbers)] = rng.choice(NUMBERS)
        return "".join(tokens).encode()
    for _ in range(rng.choice((1, 1, 2, 3))):
        if not tokens:
            break
        place, choice = rng.randrange(len(tokens)), rng.randrange(4)
        if choice == 0:
            tokens[place] = rng.choice(ODD)
        elif choice == 1:
            tokens[place] = rng.choice(tokens)
        elif choice == 2:
            del tokens[place : place + rng.randint(1, 4)]
        else:
            tokens[place:place] = tokens[place : place + rng.randint(1, 12)]
    return "".join(tokens).encode()


def mutate_json(data: bytes, rng: random.Random) -> bytes:
    """Replace, drop or double one value anywhere in a JSON text, or in one of several lines of JSON. The replacement
    is an unusual value or a neighbouring one."""
    lines = data.splitlines() if data.startswith(b"{") and data.count(b"\n{") else [data]
    line = rng.randrange(len(lines))
    whole = json.loads(lines[line])
    held: Any = [whole]
    key: Any = 0
    while isinstance(held[key], (dict, list)) and held[key] and rng.random() < 0.85:
        held = held[key]
        key = rng.choice(list(held)) if isinstance(held, dict) else rng.randrange(len(held))
    choice = rng.randrange(4)
    if choice == 0:
        held[key] = rng.choice(VALUES)
    elif choice == 1:
        held[key] = held[rng.choice(list(held))] if isinstance(held, dict) else rng.choice(held)
    elif isinstance(held, dict):
        del held[key]
    else:
        held[key : key + 1] = [held[key]] * (choice - 2) * 2
    lines[line] = json.dumps(whole).encode()
    return b"\n".join(lines) + b"\n" * (len(lines) > 1)
