"""All members of the dsPIC30F family by the processor id in the flags of ELF files (abi-elf.md §6.1).

Source: the device resource of the vendor's compiler (c30_DVSdevices.res of 2014), published with its source. Observed
images agree for 0x05, 0x08, 0x0D, 0x0E, 0x18 and 0x1F.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

MEMBERS: Final[Mapping[int, str]] = MappingProxyType({
    0x01: "dsPIC30F2010", 0x02: "dsPIC30F3010", 0x03: "dsPIC30F4012", 0x04: "dsPIC30F3011", 0x05: "dsPIC30F4011",
    0x06: "dsPIC30F5015", 0x08: "dsPIC30F6010", 0x09: "dsPIC30F2011", 0x0A: "dsPIC30F3012", 0x0B: "dsPIC30F2012",
    0x0C: "dsPIC30F3013", 0x0D: "dsPIC30F3014", 0x0E: "dsPIC30F4013", 0x10: "dsPIC30F5011", 0x12: "dsPIC30F6011",
    0x13: "dsPIC30F6012", 0x15: "dsPIC30F5013", 0x17: "dsPIC30F6013", 0x18: "dsPIC30F6014", 0x19: "dsPIC30F5016",
    0x1A: "dsPIC30F6015", 0x1B: "dsPIC30F6010A", 0x1C: "dsPIC30F6011A", 0x1D: "dsPIC30F6012A", 0x1E: "dsPIC30F6013A",
    0x1F: "dsPIC30F6014A", 0x23: "dsPIC30F2020", 0x26: "dsPIC30F2023", 0x29: "dsPIC30F1010",
})  # fmt: skip

_MOTOR: Final = "dsPIC30F4011"
_NEAREST: Final[Mapping[str, str]] = MappingProxyType({
    "dsPIC30F2010": _MOTOR, "dsPIC30F3010": _MOTOR, "dsPIC30F3011": _MOTOR, "dsPIC30F4012": _MOTOR,
    "dsPIC30F5015": _MOTOR, "dsPIC30F5016": _MOTOR, "dsPIC30F6010": _MOTOR, "dsPIC30F6010A": _MOTOR,
    "dsPIC30F6015": _MOTOR, "dsPIC30F1010": _MOTOR, "dsPIC30F2020": _MOTOR, "dsPIC30F2023": _MOTOR,
    "dsPIC30F2011": "dsPIC30F3014", "dsPIC30F2012": "dsPIC30F3014", "dsPIC30F3012": "dsPIC30F3014",
    "dsPIC30F3013": "dsPIC30F3014", "dsPIC30F5011": "dsPIC30F4013", "dsPIC30F5013": "dsPIC30F4013",
    "dsPIC30F6011": "dsPIC30F6014", "dsPIC30F6012": "dsPIC30F6014", "dsPIC30F6013": "dsPIC30F6014",
    "dsPIC30F6011A": "dsPIC30F6012A", "dsPIC30F6013A": "dsPIC30F6014A",
})  # fmt: skip


def nearest(member: str) -> str:
    """Return the supported chip that is most like a member without tables. Raises KeyError for any other name."""
    return _NEAREST[member]
