"""Places at which functions were inlined."""

from __future__ import annotations

from emu.debug.dwarf.units import DebugInfo, Scope
from emu.debug.inlining import inlined_entries, missing_function


def test_copies_without_code_have_no_address() -> None:
    """Copies within copies and in several functions have addresses; a copy that was optimised away has none."""
    debug = DebugInfo({})
    inner = Scope("inlined", "add", [(0x240, 0x244)])
    outer = Scope("inlined", "twice", [(0x23C, 0x250)], inner=[inner])
    debug.functions += [
        Scope("function", "main", [(0x230, 0x260)], inner=[outer, Scope("inlined", "add", [])]),
        Scope("function", "other", [(0x200, 0x220)], inner=[Scope("inlined", "add", [(0x210, 0x214), (0x204, 0x206)])]),
    ]
    assert inlined_entries(debug, "add") == (0x210, 0x240)
    assert inlined_entries(debug, "main") == ()
    assert missing_function(debug, "add").startswith("inlined into main, other; ")
