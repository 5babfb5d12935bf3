"""Message authentication by Ascon-AEAD128 (NIST SP 800-232) with an empty plaintext.

The message is the associated data. The robot's counterpart is firmware/openswarm/io/update_auth/ascon.c; both are
compared with the test vectors of the algorithm's reference implementation.
"""

from __future__ import annotations

from typing import Final

BYTES: Final = 16
"""Number of bytes of a key, a nonce, a block and a tag."""
_MASK: Final = (1 << 64) - 1
_INITIAL_VALUE: Final = 0x00001000808C0001
"""Rate, lengths of key and tag, and numbers of rounds of Ascon-AEAD128."""
_ROTATIONS: Final = ((19, 28), (61, 39), (1, 6), (10, 17), (7, 41))


def _rotated(word: int, by: int) -> int:
    return (word >> by | word << (64 - by)) & _MASK


def _permuted(state: list[int], rounds: int) -> list[int]:
    """Return the state after a permutation: the last `rounds` of the twelve rounds."""
    x0, x1, x2, x3, x4 = state
    for number in range(12 - rounds, 12):
        x2 ^= (0xF - number) << 4 | number
        x0, x2, x4 = x0 ^ x4, x2 ^ x1, x4 ^ x3
        x0, x1, x2, x3, x4 = (
            x0 ^ ~x1 & x2, x1 ^ ~x2 & x3, x2 ^ ~x3 & x4, x3 ^ ~x4 & x0, x4 ^ ~x0 & x1)  # fmt: skip
        words = (x0 ^ x4, x1 ^ x0, ~x2 & _MASK, x3 ^ x2, x4)
        x0, x1, x2, x3, x4 = (
            word ^ _rotated(word, one) ^ _rotated(word, other)
            for word, (one, other) in zip(words, _ROTATIONS, strict=True)
        )
    return [x0, x1, x2, x3, x4]


def _words(data: bytes) -> tuple[int, int]:
    return int.from_bytes(data[:8], "little"), int.from_bytes(data[8:], "little")


def _added(state: list[int], first: int, data: bytes) -> list[int]:
    """Return the state with 16 bytes added from word `first` on."""
    out = list(state)
    for place, word in enumerate(_words(data), start=first):
        out[place] ^= word
    return out


def tag(key: bytes, nonce: bytes, message: bytes) -> bytes:
    """Return the tag of a message of one byte or more.

    One key must not be used for two messages with the same nonce. Raises ValueError for other lengths of key and nonce.
    """
    if len(key) != BYTES or len(nonce) != BYTES or not message:
        raise ValueError(f"expected a key and a nonce of {BYTES} bytes and a message")
    state = _permuted([_INITIAL_VALUE, *_words(key), *_words(nonce)], 12)
    state = _added(state, 3, key)
    padded = message + b"\1" + bytes(-(len(message) + 1) % BYTES)
    for at in range(0, len(padded), BYTES):
        state = _permuted(_added(state, 0, padded[at : at + BYTES]), 8)
    state[4] ^= 1 << 63  # the end of the associated data
    state[0] ^= 1  # the padding of the empty plaintext
    state = _added(_permuted(_added(state, 2, key), 12), 3, key)
    return b"".join(word.to_bytes(8, "little") for word in state[3:])
