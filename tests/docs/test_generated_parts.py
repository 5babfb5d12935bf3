"""Parts of pages that scripts of docs/tools make are up to date."""

from __future__ import annotations

import avr_table
import json_outputs
import port_files
import pytest
import unverified
from generated_part import GeneratedPart


@pytest.mark.parametrize("script", [avr_table, json_outputs, port_files, unverified], ids=lambda one: one.__name__)
def test_the_page_is_what_the_script_makes(script) -> None:
    """Each page has the part that its script makes from the tree."""
    assert script.PART.is_current(), f"run: python docs/tools/{script.__name__}.py --write"


def test_only_the_part_is_replaced(tmp_path) -> None:
    """The text around the part stays; a page without the part's beginning is refused."""
    page = tmp_path / "page.md"
    page.write_text("first\n<!-- a -->\nold\n<!-- b -->\nlast\n")
    part = GeneratedPart(page, "<!-- a -->\n", lambda: "new\n", "<!-- b -->")
    assert not part.is_current()
    assert part.current() == "first\n<!-- a -->\nnew\n<!-- b -->\nlast\n"
    assert GeneratedPart(page, "first\n", lambda: "new\n").current() == "first\nnew\n"
    with pytest.raises(ValueError, match=r"page\.md: has no '<!-- c -->'"):
        GeneratedPart(page, "<!-- c -->\n", str).current()


def test_the_list_of_a_port_has_what_a_build_needs() -> None:
    """The list names the files without which the newest port is not built or not tested."""
    needed = {"firmware/Makefile", "firmware/port.mk", "tests/firmware/ports/targets.py"}
    assert needed <= set(port_files.naming_files())
