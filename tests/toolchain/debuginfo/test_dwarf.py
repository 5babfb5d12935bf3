"""DWARF of a small program, read by pyelftools; -g does not change the code."""

from __future__ import annotations

from itertools import pairwise

import pytest
from elftools.dwarf.dwarfinfo import DWARFInfo

from tests.toolchain.c_programs import build
from tests.toolchain.compiled import assembly
from tests.toolchain.debuginfo.dwarf_reader import dwarf_of

SOURCE = """\
struct point { int x; unsigned low:3; unsigned high:5; long y; };
enum colour { RED, BLUE = 5 };
typedef unsigned char octet;
struct point origin = {1, 2, 3, 4}, *volatile where = &origin;
static octet table[5];
volatile int count = 3;
__attribute__((noinline)) long weigh(int a, const struct point *p)
{
    long sum = 0;
    for (int i = 0; i < a; i++)
        sum += p->x * i + count;
    table[a] = sum;
    return sum;
}
int main(void)
{
    enum colour e = count > 2 ? BLUE : RED;
    return weigh(count, where) + e + table[count];
}
"""


@pytest.fixture(scope="module", params=["-O0", "-Os"])
def dwarf(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> DWARFInfo:
    """Return the DWARF information of SOURCE at one of two optimisation levels."""
    folder = tmp_path_factory.mktemp("debug")
    (folder / "unit.c").write_text(SOURCE)
    built = build([folder / "unit.c"], folder / "unit.elf", request.param, "-g")
    assert built.status == 0, built.messages
    return dwarf_of(folder / "unit.elf")


def entries(dwarf: DWARFInfo, tag: str) -> dict[str, dict[str, object]]:
    """Return the DWARF entries with a tag by name: attribute values."""
    found = {}
    for unit in dwarf.iter_CUs():
        for die in unit.iter_DIEs():
            if die.tag == f"DW_TAG_{tag}" and "DW_AT_name" in die.attributes:
                values = {k.removeprefix("DW_AT_"): v.value for k, v in die.attributes.items()}
                found[values["name"].decode()] = values
    return found


def test_functions_variables_and_types_are_described(dwarf: DWARFInfo) -> None:
    """DWARF describes functions, variables and types: names, sizes, members, bit-fields (DWARF 2 §3.3, §4.1, §5)."""
    functions = entries(dwarf, "subprogram")
    assert set(functions) == {"weigh", "main"}
    assert functions["weigh"]["decl_line"] == 7
    assert functions["weigh"]["low_pc"] < functions["weigh"]["high_pc"]  # type: ignore[operator]
    assert entries(dwarf, "structure_type")["point"]["byte_size"] == 8
    members = entries(dwarf, "member")
    assert [members[n]["data_member_location"] for n in ("x", "low", "high", "y")] == [
        [35, 0],
        [35, 2],
        [35, 2],
        [35, 4],
    ]
    assert (members["high"]["bit_size"], members["high"]["bit_offset"]) == (5, 8)
    variables = entries(dwarf, "variable")
    assert {"origin", "table", "count"} <= set(variables)
    assert variables["origin"]["location"][0] == 3  # type: ignore[index]


def test_parameters_and_locals_have_locations(dwarf: DWARFInfo) -> None:
    """Parameters and locals have frame locations at -O0, and location lists with registers when optimised."""
    assert "location" in entries(dwarf, "formal_parameter")["a"]
    assert "location" in entries(dwarf, "formal_parameter")["p"]
    assert "location" in entries(dwarf, "variable")["sum"]


def test_the_line_table_covers_every_statement_in_address_order(dwarf: DWARFInfo) -> None:
    """The line table covers every statement; addresses do not decrease, and every sequence ends (DWARF 2 §6.2)."""
    rows = []
    for unit in dwarf.iter_CUs():
        rows += [e.state for e in dwarf.line_program_for_CU(unit).get_entries() if e.state is not None]
    assert {8, 11, 12, 13, 16, 18} <= {r.line for r in rows}
    for first, second in pairwise(rows):
        assert first.end_sequence or first.address <= second.address
    assert rows[-1].end_sequence


@pytest.mark.parametrize("level", ["0", "1", "s", "2"])
def test_debug_information_does_not_change_the_code(level: str) -> None:
    """Code compiled with -g equals the code without it."""

    def code(text: str) -> list[str]:
        text = text.split("\t.section .debug_info", 1)[0]
        return [line for line in text.split("\n") if not line.startswith((".Lrow", ".Lvar", ".Lend", ".Lcfi", "# "))]

    assert code(assembly(SOURCE, level, debug=True)) == code(assembly(SOURCE, level))
