"""Authentication of programs for robots with `DEVICES := update update_auth`: the swarm's key, tags, the robot's slot.

The robot's counterpart is firmware/openswarm/io/update_auth/update_auth.c.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import Final

from emu.image.model import ERASED, Image
from openswarm.flashing.ascon import BYTES, tag
from openswarm.flashing.loaders import ROW_BYTES, ROW_WORDS
from openswarm.flashing.program import ROWS, Program
from openswarm.flashing.rows import Row

KEY_SYMBOL: Final = "__update_key"
"""Symbol, in firmware that authenticates programs, of the row with the key: eight words with two bytes each."""
_LONGEST: Final = 64
"""Maximum number of bytes of a key file: the digits, space and an end of line."""
_ADVICE: Final = f"`openssl rand -hex {BYTES}` makes one"


def read_key(path: Path) -> bytes:
    """Return the key in a file of 32 hexadecimal digits.

    Raises OSError, or ValueError for a file that other users can read or that holds no key. Messages never contain any
    byte of the file.
    """
    opened = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    try:
        state = os.fstat(opened)
        if not stat.S_ISREG(state.st_mode):
            raise ValueError(f"{path}: expected a regular file with the key of the swarm")
        if state.st_mode & 0o077 or state.st_uid not in (os.geteuid(), 0):
            raise ValueError(f"{path}: other users can read this key or own it: make it yours alone with `chmod 600`")
        text = os.read(opened, _LONGEST + 1)
    finally:
        os.close(opened)
    try:
        key = bytes.fromhex(text.decode("ascii")) if len(text) <= _LONGEST else b""
    except ValueError:
        key = b""
    if len(key) != BYTES:
        raise ValueError(f"{path}: expected a key of {2 * BYTES} hexadecimal digits: {_ADVICE}")
    if len(set(key)) == 1:  # 0xFF: erased flash
        raise ValueError(f"{path}: a key of equal bytes is no secret: {_ADVICE}")
    return key


def authenticated(program: Program, key: bytes) -> Program:
    """Return the program with its tag as the last bytes of its last row.

    A row is added if fewer bytes of the last row are unused. Raises ValueError if there is no room for it.
    """
    rows = list(program.rows)
    if program.unused < BYTES:
        if len(rows) == ROWS:
            raise ValueError(f"the program leaves {program.unused} bytes of its {ROWS} rows; its tag needs {BYTES}")
        rows.append(b"\xff" * ROW_BYTES)
    message = b"".join(rows)[:-BYTES]
    nonce = program.version.to_bytes(2, "little") + bytes([len(rows)]) + bytes(BYTES - 3)
    rows[-1] = rows[-1][:-BYTES] + tag(key, nonce, message)
    return Program(program.version, tuple(rows))


def key_row(image: Image, key: bytes) -> Row:
    """Return the row of flash with the key. Raises ValueError for firmware that has no place for it."""
    slot = image.symbols.find(KEY_SYMBOL)
    if slot is None:
        raise ValueError(
            f"{image.path}: keeps no key: expected the ELF file of firmware with DEVICES := update update_auth"
        )
    words = [int.from_bytes(key[at : at + 2], "little") for at in range(0, BYTES, 2)]
    return slot.address, words + [ERASED] * (ROW_WORDS - len(words))
