"""Static libraries in `ar` format with a GNU symbol index, as Microchip's tools read and write them."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

from toolchain.elf.model import Bind, Home
from toolchain.elf.read import is_object, read_object
from toolchain.errors import ToolError

MAGIC = b"!<arch>\n"
_HEADER = 60
_LONG_NAME = 15  # maximum length of a name in a member header; longer names are in the `//` member


@dataclass(slots=True)
class ArchiveMember:
    """One file of an archive."""

    name: str
    data: bytes
    offset: int = 0


@dataclass(slots=True)
class Archive:
    """An archive being linked: its members, and the member that defines each global symbol."""

    name: str
    members: list[ArchiveMember]
    index: dict[str, ArchiveMember] = field(default_factory=dict)


def read_members(data: bytes, name: str) -> list[ArchiveMember]:
    """Return the members of an archive in order; raise `ToolError` if the archive is damaged."""
    if data[: len(MAGIC)] != MAGIC:
        raise ToolError(f"{name}: not an archive (bad magic at offset 0)")
    members: list[ArchiveMember] = []
    long_names = b""
    offset = len(MAGIC)
    while offset < len(data):
        header = data[offset : offset + _HEADER]
        if len(header) < _HEADER or header[58:60] != b"`\n" or not header[48:58].strip().isdigit():
            raise ToolError(f"{name}: bad member header at offset {offset:#x}")
        size = int(header[48:58])
        body = data[offset + _HEADER : offset + _HEADER + size]
        if len(body) < size:
            raise ToolError(f"{name}: member at offset {offset:#x} is truncated")
        raw = header[:16].rstrip().decode("latin-1")
        if raw == "//":
            long_names = body
        elif raw not in ("/", "/SYM64/"):
            members.append(ArchiveMember(_member_name(raw, long_names, name), body, offset))
        offset += _HEADER + size + (size & 1)
    return members


def _member_name(raw: str, long_names: bytes, archive: str) -> str:
    if raw[:1] == "/" and raw[1:].isdigit():
        start = int(raw[1:])
        end = long_names.find(b"\n", start)
        if end < 0:
            raise ToolError(f"{archive}: member name {raw} points outside the name table")
        return long_names[start:end].decode("utf-8", "replace").rstrip("/")
    return raw.rstrip("/")


def open_archive(data: bytes, name: str) -> Archive:
    """Return an archive with its symbol index: that of the `/` member, or one built from the symbols of the members."""
    archive = Archive(name, read_members(data, name))
    by_offset = {m.offset: m for m in archive.members}
    if data[8:10] == b"/ ":
        for symbol, offset in _read_index(data, name):
            if offset in by_offset:
                archive.index.setdefault(symbol, by_offset[offset])
    else:
        for member in archive.members:
            for symbol in _defined(member, name):
                archive.index.setdefault(symbol, member)
    return archive


def _read_index(data: bytes, name: str) -> list[tuple[str, int]]:
    size = int(data[8 + 48 : 8 + 58])
    body = data[8 + _HEADER : 8 + _HEADER + size]
    if len(body) < 4 or len(body) < 4 + 4 * int.from_bytes(body[:4], "big"):
        raise ToolError(f"{name}: damaged symbol index")
    count = int.from_bytes(body[:4], "big")
    offsets = struct.unpack_from(f">{count}I", body, 4)
    names = body[4 + 4 * count :].split(b"\0")
    return [(n.decode("utf-8", "replace"), o) for n, o in zip(names, offsets, strict=False)]


def _defined(member: ArchiveMember, archive: str) -> list[str]:
    if not is_object(member.data):
        return []
    obj = read_object(member.data, f"{archive}({member.name})")
    return [s.name for s in obj.symbols if s.bind is not Bind.LOCAL and s.home is not Home.UNDEFINED]


def archive_bytes(members: list[ArchiveMember]) -> bytes:
    """Return the content of an archive with a symbol index; fixed times, owners and modes make it reproducible."""
    long_names = bytearray()
    labels: list[str] = []
    for member in members:
        if len(member.name) > _LONG_NAME:
            labels.append(f"/{len(long_names)}")
            long_names += member.name.encode() + b"/\n"
        else:
            labels.append(member.name + "/")
    symbols = [(name, i) for i, m in enumerate(members) for name in _defined(m, "archive")]
    index_size = 4 + 4 * len(symbols) + sum(len(n.encode()) + 1 for n, _ in symbols)
    names_part = _member("//", bytes(long_names)) if long_names else b""
    offset = len(MAGIC) + _HEADER + index_size + (index_size & 1) + len(names_part)
    bodies, starts = [], []
    for label, member in zip(labels, members, strict=True):
        starts.append(offset)
        bodies.append(_member(label, member.data))
        offset += len(bodies[-1])
    index = struct.pack(f">{len(symbols) + 1}I", len(symbols), *(starts[i] for _, i in symbols))
    index += b"".join(n.encode() + b"\0" for n, _ in symbols)
    return MAGIC + _member("/", index) + names_part + b"".join(bodies)


def _member(label: str, data: bytes) -> bytes:
    header = f"{label:<16}{0:<12}{0:<6}{0:<6}{'644':<8}{len(data):<10}`\n".encode()
    return header + data + b"\n" * (len(data) & 1)
