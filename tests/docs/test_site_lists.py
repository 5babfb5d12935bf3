"""Code blocks of the site on narrow screens: lists of files break with a hanging indent, tables of numbers do not."""

from __future__ import annotations

import html
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

TOOLS = Path(__file__).resolve().parents[2] / "docs" / "tools"
BLOCK = '<div class="columns highlight"><pre><span></span><code>{}</code></pre></div>'
FILES = """elf/
  model.py        ObjectFile, Executable, Section
  archive.py      static libraries with a symbol index
                  and their members
                  fields.py     relocated fields
"""


@pytest.fixture(scope="module")
def site_tool() -> ModuleType:
    """Return the generator of the site. Its name is that of a standard module, so it is loaded by its path."""
    from importlib.util import module_from_spec, spec_from_file_location

    sys.path.insert(0, str(TOOLS))
    try:
        spec = spec_from_file_location("site_generator", TOOLS / "site.py")
        assert spec is not None
        assert spec.loader is not None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(TOOLS))
    return module


def text_of(page: str) -> str:
    """Return the text of a page of HTML, as a reader copies it."""
    return html.unescape(re.sub("<[^>]+>", "", page))


def test_a_list_of_files_has_rows_names_and_gaps(site_tool: ModuleType) -> None:
    """Each line is a row; its text is unchanged, so that copies and wide screens keep the columns."""
    page = site_tool.with_rows(BLOCK.format(FILES))
    assert 'class="columns highlight listing"' in page
    assert page.count('class="row"') == 5
    assert re.findall(r'class="name">(.*?)<', page) == ["  model.py", "  archive.py", "fields.py"]
    assert [len(gap) for gap in re.findall(r'class="gap">( +)<', page)] == [7, 5, 18, 18, 4]
    assert text_of(page) == FILES


def test_tables_and_commands_keep_their_lines(site_tool: ModuleType) -> None:
    """A table of numbers and commands joined by `&&` are unchanged."""
    for block in ("code   12   3\ndata   44   1\nbss    7    9\n", "make APP=a   &amp;&amp; run a\n" * 3):
        page = BLOCK.format(block)
        assert site_tool.with_rows(page) == page


def test_a_session_breaks_lines_without_columns(site_tool: ModuleType) -> None:
    """Commands and messages may break; output in columns does not."""
    session = "$ size a.elf  b.elf\n    code    data\n    7317       2\nlimit at 0x38a after 3 s\n"
    page = site_tool.with_rows(BLOCK.format(session))
    assert re.findall(r'class="sentence">(.*?)<', page) == ["$ size a.elf  b.elf", "limit at 0x38a after 3 s"]
    assert text_of(page) == session


def test_a_comment_beside_code_has_a_gap(site_tool: ModuleType) -> None:
    """The gap before a comment disappears on narrow screens, so that code and comment stay together."""
    code = 'name = "a"<span class="w">     </span><span class="c1"># a comment</span>\nrun x    # another  one\n'
    page = site_tool.with_rows(BLOCK.replace("columns ", "").format(code))
    assert [len(gap) for gap in re.findall(r'class="gap">( +)<', page)] == [4, 3]
    assert text_of(page) == text_of(code)
