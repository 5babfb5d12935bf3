"""The examples in the Python reference run, and every class of it has one."""

from __future__ import annotations

import doctest
import inspect
import re
import shutil
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest
import python_reference

import arena.cli
from emu.api import build

ROOT = Path(__file__).resolve().parents[2]
RECORDS = "run clustering --brain scripted --trials 1 --minutes 0.05 --robots 2 --objects 3 --jobs 1 --out build/study"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the files that the examples use: a program, its image, and the records of a trial."""
    made = tmp_path_factory.mktemp("examples")
    shutil.copy(ROOT / "docs" / "examples" / "api.c", made / "main.c")
    build(made / "main.c", output=made / "firmware.elf")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(made)
        assert arena.cli.main(RECORDS.split()) == 0
    return made


@pytest.mark.slow
@pytest.mark.parametrize("name", python_reference.MODULES)
def test_the_examples_run(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every example gives the printed results; none is skipped."""
    module = import_module(name)
    monkeypatch.chdir(ROOT if "tests/emu" in (module.__doc__ or "") else folder)
    result = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert result.failed == 0
    assert "+SKIP" not in inspect.getsource(module)


@pytest.mark.parametrize("name", python_reference.MODULES)
def test_every_public_class_has_an_example(name: str) -> None:
    """A class has an example, or the example of its module or of another class of it uses it.

    Exceptions and tables of scenes (docs/scene-keys.md) need none of their own."""
    module = import_module(name)
    classes = [one for one in vars(module).values() if inspect.isclass(one) and one.__module__ == name
               and not one.__name__.startswith("_") and not issubclass(one, Exception)]  # fmt: skip
    examples = _examples(module)
    assert not classes or examples
    if name != "arena.scene.schema":
        words = set(re.findall(r"\w+", examples))
        assert [one.__name__ for one in classes if one.__name__ not in words and ">>>" not in (one.__doc__ or "")] == []
    for one in (module, *classes):
        text = inspect.getdoc(one)
        assert text
        assert not re.search("^>>>", text, re.MULTILINE), "indent the example: it is a block of code on the site"


def _examples(module: ModuleType) -> str:
    """Return the docstrings of a module and its classes that have an example."""
    texts = [module.__doc__ or "", *(one.__doc__ or "" for one in vars(module).values() if inspect.isclass(one))]
    return "\n".join(text for text in texts if ">>>" in text)
