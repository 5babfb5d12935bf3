"""Each output of --json fits its schema, and each error is a JSON object on standard output."""

from __future__ import annotations

import json
from argparse import ArgumentParser
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import arena.cli
import emu.cli
import openswarm.cli
import toolchain.cli
from arena.commands import COMMANDS as ARENA
from emu.commands import COMMANDS as EMU
from tests.firmware.conftest import built_once
from tests.json_schemas import ERROR, ROOT, path_of, problems, validated

MAINS: dict[str, Callable[[list[str]], int]] = {
    "emu": emu.cli.main, "toolchain": toolchain.cli.main, "arena": arena.cli.main, "openswarm": openswarm.cli.main,
}  # fmt: skip
PARTS = ("emu/fault", "emu/check")
"""Schemas that others refer to."""
ELSEWHERE = {
    "emu/run-kilobot": "tests/emu/avr/test_run_kilobot.py",
    "emu/cycles-suite": "tests/firmware/measurements/test_measuring.py",
    "emu/inject-only": "tests/emu/inject/test_inject.py",
    "emu/inject": "tests/emu/inject/test_inject.py",
    "toolchain/prove": "tests/toolchain/proofs/test_prove.py",
    "arena/reaction": "tests/arena/robots/test_firmware_controller.py",
    "arena/verify": "tests/arena/campaign/test_bundle.py",
    "openswarm/flash": "tests/firmware/update/test_boot_on_target.py",
    "openswarm/program": "tests/firmware/update/test_programs_on_target.py",
}
"""Tests that validate outputs whose inputs are expensive."""
HELLO = """#include <stdio.h>
int main(void) { printf("hello"); return 0; }
"""
FAULT = "int main(void) { return *(volatile int *)0x801; }\n"


def parsers() -> Iterator[tuple[str, str, ArgumentParser]]:
    """Yield program, command and option parser of every command."""
    for name in EMU:
        yield "emu", name, import_module(f"emu.commands.{name}").parser()
    for name, (module, _) in toolchain.cli.COMMANDS.items():
        options_of = getattr(import_module(module), "options_of", None)
        if options_of is not None:
            yield "toolchain", name, options_of()
    for name in ARENA:
        yield "arena", name, arena.cli.command(name)[0]
    for name in openswarm.cli.COMMANDS:
        yield "openswarm", name, openswarm.cli.command(name).parser()


def with_json() -> list[tuple[str, str]]:
    """Return program and command of every command with --json."""
    return [(program, name) for program, name, one in parsers()
            if any("--json" in action.option_strings for action in one._actions)]  # fmt: skip


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the paths of two small images, and of an application with the kernel."""
    folder, found = tmp_path_factory.mktemp("images"), {"kernel": str(built_once(tmp_path_factory, "hello"))}
    for name, text in (("hello", HELLO), ("fault", FAULT)):
        (folder / f"{name}.c").write_text(text)
        found[name] = str(folder / f"{name}.elf")
        assert toolchain.cli.main(["cc", "-Os", "-g", str(folder / f"{name}.c"), "-o", found[name]]) == 0
    return found


@pytest.fixture
def run(images: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """Return a function that runs a command with --json, and returns the validated output.

    `{hello}`, `{fault}`, `{kernel}` and `{folder}` in its words are paths."""

    def call(program: str, words: str, output: str = "", status: int = 0) -> Any:
        filled = [word.format(folder=tmp_path, **images) for word in words.split()]
        assert MAINS[program]([*filled, "--json"]) == status
        return validated(program, output or filled[0], capsys.readouterr().out)

    return call


def test_schemas_are_valid() -> None:
    """Every file is a schema of draft 2020-12, and every key of an object has a description."""
    from jsonschema import Draft202012Validator  # slow to import

    files = sorted([*ROOT.glob("*/commands/schemas/*.json"), ERROR])
    assert len(files) > 25
    for path in files:
        schema = json.loads(path.read_text("utf-8"))
        Draft202012Validator.check_schema(schema)
        assert schema["$schema"] == Draft202012Validator.META_SCHEMA["$id"]
        assert [*_undescribed(schema)] == [], path


def _undescribed(schema: Any) -> Iterator[str]:
    """Yield the keys of objects without a description."""
    if isinstance(schema, dict):
        for key, one in schema.get("properties", {}).items():
            if not one.get("description"):
                yield key
        for one in schema.values():
            yield from _undescribed(one)
    elif isinstance(schema, list):
        for one in schema:
            yield from _undescribed(one)


def test_a_wrong_output_is_found() -> None:
    """A missing key, an additional key and a wrong type in a part of an output are problems."""
    right = {"error": {"message": "no", "status": 2}}
    assert problems(ERROR, right) == []
    for wrong in ({}, right | {"more": 1}, {"error": {"message": "no", "status": "2"}}):
        assert len(problems(ERROR, wrong)) == 1
    shot = {"output": "a.png", "width": 1, "height": 1, "cycles": 1, "reason": "fault", "fault": {"cause": "none"}}
    assert any("'pc' is a required property" in one for one in problems(path_of("emu", "screenshot"), shot))


def test_every_command_with_json_has_a_schema_and_a_test() -> None:
    """Each command with --json has a schema; each schema is validated here or in the test that is named here."""
    commands = {f"{program}/{name}" for program, name in with_json()}
    assert len(commands) > 20
    schemas = {f"{path.parts[-4]}/{path.stem}" for path in ROOT.glob("*/commands/schemas/*.json")}
    assert commands - schemas == set()
    text = Path(__file__).read_text("utf-8")
    for name in schemas - {*PARTS}:
        program, _, output = name.partition("/")
        file = ROOT / ELSEWHERE[name] if name in ELSEWHERE else None
        source = text if file is None else file.read_text("utf-8")
        calls = [f'{call}("{program}", {quote}"{output}{end}' for call in ("validated", "run", "path_of")
                 for quote in ("", "f") for end in ('"', " ")]  # fmt: skip
        assert any(one in source for one in calls), name


@pytest.mark.parametrize(("program", "name"), with_json())
def test_errors_are_json_on_standard_output(program: str, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A usage error is printed on standard error, and as a JSON object on standard output."""
    with pytest.raises(SystemExit) as ended:
        raise SystemExit(MAINS[program]([name, "--json", "--no-such-option"]))
    assert ended.value.code == 2
    said = capsys.readouterr()
    value = json.loads(said.out)
    assert problems(ERROR, value) == []
    assert value["error"]["status"] == 2
    assert value["error"]["message"].partition(": ")[2].partition(" (see ")[0] in said.err


@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("emu", "info missing.elf"),
        ("emu", "missing"),
        ("toolchain", "size missing.elf"),
        ("arena", "compare missing missing"),
        ("openswarm", "flash missing.elf --port missing"),
    ],
)
def test_bad_input_is_json(program: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    """An error after the options were parsed is a JSON object, too; without --json standard output stays empty."""
    assert MAINS[program](words.split()) == 2
    plain = capsys.readouterr()
    assert plain.out == ""
    assert MAINS[program]([*words.split(), "--json"]) == 2
    said = capsys.readouterr()
    assert (said.err, problems(ERROR, json.loads(said.out))) == (plain.err, [])
    assert json.loads(said.out)["error"]["message"] == said.err.strip()


@pytest.mark.slow
def test_errors_in_sources_are_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Where the compiler reports errors, `prove` and `program` print an error object."""
    source = tmp_path / "bad.c"
    source.write_text("int f(void) { return missing; }\n")
    for program, words in (("toolchain", ["prove"]), ("openswarm", ["program", "--version", "1"])):
        assert MAINS[program]([*words, str(source), "--json"]) == 1
        assert problems(ERROR, json.loads(capsys.readouterr().out)) == []


@pytest.mark.slow
def test_emu_outputs(run: Callable[..., Any], images: dict[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    """Outputs of `emu` for images without the kernel."""
    assert run("emu", "run {hello} --stats --seconds 1")["uart1"] == "hello"
    fault = run("emu", "run {fault} --seconds 1", status=1)["fault"]
    assert fault["symbol"].startswith("_main")
    assert fault["cause"].endswith("no handler")
    run("emu", "info {hello}")
    run("emu", "coverage {hello} --seconds 0.001")
    assert run("emu", "coverage {fault} --seconds 0.001", status=1)["fault"]["pc"] > 0
    run("emu", "profile {hello} --seconds 0.001 --group all=*")
    assert run("emu", "profile {fault} --seconds 0.001", status=1)["fault"]["pc"] > 0
    run("emu", "screenshot {fault} --seconds 0.001 --buffer 0x800 --size 2x2 -o {folder}/shot.png", status=1)
    run("emu", "footprint {hello}")
    assert emu.cli.main(["disasm", images["hello"], "--from", "main", "--json"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [validated("emu", "disasm", line)["text"] for line in lines][-1].startswith("ret")
    assert emu.cli.main(["run", images["hello"], "--dump-native", "main", "--json"]) == 2
    assert "--dump-native" in json.loads(capsys.readouterr().out)["error"]["message"]


@pytest.mark.slow
def test_emu_outputs_with_the_kernel(run: Callable[..., Any]) -> None:
    """Footprint and cycles of an application, and their comparison with a baseline."""
    run("emu", "footprint {kernel} --seconds 0.02 --update {folder}/footprint.json")
    run("emu", "cycles {kernel} --seconds 0.02 --update {folder}/cycles.json")
    for name in ("footprint", "cycles"):
        checked = run("emu", f"{name} {{kernel}} --seconds 0.02 --check {{folder}}/{name}.json")
        assert checked["check"]["verdict"] == "pass"
        assert all(row["difference"] == 0 for row in checked["check"]["rows"])


@pytest.mark.slow
def test_toolchain_outputs(run: Callable[..., Any]) -> None:
    """JSON output of size, nm and bounds; the JSON object lists an exceeded limit."""
    run("toolchain", "size {hello}")
    run("toolchain", "nm {hello}")
    bounds = run("toolchain", "bounds {fault} --limit main=1 --stack-limit main=100", status=1)
    assert [(one["name"], one["unit"], one["limit"]) for one in bounds["exceeded"]] == [("main", "cycles", 1)]


@pytest.mark.slow
def test_arena_outputs(run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Keys, the channel, and runs of scripted robots."""
    monkeypatch.chdir(tmp_path)
    run("arena", "keys")
    run("arena", "channel")
    short = "clustering --trials 2 --minutes 0.02 --jobs 1 --out {folder}/"
    scripted = "--brain scripted --robots 2 --objects 3"
    assert run("arena", f"run {short}one {scripted}")["new"] == 2
    run("arena", f"sweep {short}two {scripted} --vary camera.range_cm=100")
    run("arena", f"sensitivity {short}three --only registered --controllers A")
    run("arena", "compare {folder}/one {folder}/one --at 1")


@pytest.mark.slow
def test_openswarm_outputs(run: Callable[..., Any]) -> None:
    """The state of the installation, and the size of the cache."""
    run("openswarm", "doctor")
    run("openswarm", "clean --dry-run")
