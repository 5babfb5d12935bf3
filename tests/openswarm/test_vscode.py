"""The extension for Visual Studio Code: its declarations match the debugger, new projects and the packaging tool."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from PIL import Image

from arena.commands import debug as arena_debug
from openswarm.cli import main
from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "editors" / "vscode"
EXTENSION: dict[str, Any] = json.loads((FOLDER / "package.json").read_text(encoding="utf-8"))
DEBUGGER: dict[str, Any] = EXTENSION["contributes"]["debuggers"][0]
EVERYWHERE = ("type", "request", "name", "preLaunchTask", "presentation")
"""Keys of a launch configuration that VS Code defines for every debugger."""
VSCE = "@vscode/vsce@3"


def validate(configuration: dict[str, Any]) -> None:
    """Validate a launch configuration against the extension's schema. Raises jsonschema.ValidationError."""
    import jsonschema  # slow to import

    assert configuration["type"] == DEBUGGER["type"]
    schema = DEBUGGER["configurationAttributes"][configuration["request"]]
    own = {name: value for name, value in configuration.items() if name not in EVERYWHERE}
    jsonschema.validate(own, {"type": "object", "additionalProperties": False, **schema})


def plain(body: Any) -> Any:
    """Return the body of a snippet as VS Code inserts it."""
    text = re.sub(r"\$\{\d:([^}]*)\}", r"\1", json.dumps(body))
    return json.loads(re.sub(r'"\^\\"(.*?)\\""', r'"\1"', text).replace("\\\\$", "$"))


def test_snippets_and_first_configurations_fit_the_schema() -> None:
    from jsonschema import ValidationError  # slow to import

    for configuration in DEBUGGER["initialConfigurations"]:
        validate(configuration)
    for snippet in DEBUGGER["configurationSnippets"]:
        validate(plain(snippet["body"]))
    with pytest.raises(ValidationError, match="selektor"):
        validate({"type": "openswarm", "request": "launch", "selektor": 3})


def test_an_attach_configuration_names_a_port_or_a_socket() -> None:
    """VS Code marks a configuration that names both or neither."""
    from jsonschema import ValidationError  # slow to import

    attach = {"type": "openswarm", "request": "attach"}
    validate(attach | {"port": 4711})
    validate(attach | {"socket": "/run/debug"})
    for wrong in ({}, {"port": 4711, "socket": "/run/debug"}):
        with pytest.raises(ValidationError, match="oneOf"):
            validate(attach | wrong)


def test_a_new_project_fits_the_extension(tmp_path: Path) -> None:
    """The launch configurations of a new project match the extension.

    The problem matchers in its tasks work without the extension too.
    """
    assert main(["new", str(tmp_path / "robot"), "--no-baselines"]) == 0
    launch = json.loads((tmp_path / "robot" / ".vscode" / "launch.json").read_text())
    for configuration in launch["configurations"]:
        validate(configuration)
    tasks = json.loads((tmp_path / "robot" / ".vscode" / "tasks.json").read_text())["tasks"]
    patterns = {one["name"]: one for one in EXTENSION["contributes"]["problemPatterns"]}
    for task in tasks[:2]:
        matcher = task["problemMatcher"]
        assert patterns[matcher["owner"]]["regexp"] == matcher["pattern"]["regexp"]
    assert {one["pattern"] for one in EXTENSION["contributes"]["problemMatchers"]} == {f"${name}" for name in patterns}
    assert launch["configurations"][0]["preLaunchTask"] in {task["label"] for task in tasks}


def test_it_is_of_this_version_and_licence() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert (EXTENSION["version"], EXTENSION["license"]) == (project["version"], project["license"])
    assert (FOLDER / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()
    assert f"openswarm-{EXTENSION['version']}.vsix" in (FOLDER / "README.md").read_text(encoding="utf-8")


def test_the_icon_is_a_square_picture() -> None:
    """The icon is a PNG of at least 128 x 128 pixels, which the Marketplace requires."""
    with Image.open(FOLDER / EXTENSION["icon"]) as icon:
        assert icon.format == "PNG"
        assert icon.width == icon.height >= 128


def test_the_walkthrough_matches_the_extension() -> None:
    """Every page of the walkthrough exists and is used; its commands, settings and launch configuration are valid."""
    steps = EXTENSION["contributes"]["walkthroughs"][0]["steps"]
    pages = [FOLDER / step["media"]["markdown"] for step in steps]
    assert sorted(pages) == sorted(FOLDER.glob("walkthrough/*.md"))
    text = json.dumps(steps)
    own = {one["command"] for one in EXTENSION["contributes"]["commands"]}
    assert set(re.findall(r"(?:command|onCommand):(openswarm\.\w+)", text)) <= own
    settings = {*EXTENSION["contributes"]["configuration"]["properties"]}
    assert set(re.findall(r"onSettingChanged:([\w.]+)", text)) <= settings
    titles = {f"*OpenSwarm: {one['title']}*" for one in EXTENSION["contributes"]["commands"]}
    named = set(re.findall(r"\*OpenSwarm: [^*]+\*", "".join(page.read_text(encoding="utf-8") for page in pages)))
    assert named
    assert named <= titles
    (block,) = re.findall(r"```json\n(\{.*?)```", (FOLDER / "walkthrough/swarm.md").read_text(encoding="utf-8"), re.S)
    validate(json.loads(block))


@pytest.mark.skipif(shutil.which("node") is None, reason="no node here (Debian package nodejs)")
def test_the_command_lines_it_starts_are_understood() -> None:
    """The debugger accepts the command lines that extension.js starts, which runs here with a simulated editor API."""
    script = """
        require('module')._load = ((load) => (name, ...rest) => name === 'vscode' ? {} : load(name, ...rest))
            (require('module')._load);
        const { wordsOf } = require('./extension.js');
        console.log(JSON.stringify([wordsOf({ program: 'a.elf' }),
            wordsOf({ scene: 'clustering', robot: 2, program: 'a.elf', arenaOptions: ['--seed', '3'] })]));
    """
    done = subprocess.run(["node", "-e", script], cwd=FOLDER, capture_output=True, text=True, timeout=HANG, check=True)
    alone, swarm = json.loads(done.stdout)
    assert alone == ["-m", "emu", "debug"]
    assert swarm[:3] == ["-m", "arena", "debug"]
    options = arena_debug.parser().parse_args(swarm[3:])
    assert (options.scene, options.robot, options.brain, options.seed) == ("clustering", 2, "a.elf", 3)


@pytest.mark.skipif(shutil.which("node") is None, reason="no node here (Debian package nodejs)")
def test_the_status_bar_follows_stops_and_the_present() -> None:
    """The status bar requests the time after a stop, and when the present reaches the robot's time.

    Only a stop makes displayed register values outdated.
    """
    script = """
        const seen = { trackers: [], clock: {}, trees: 0 }, nothing = () => ({});
        class EventEmitter { constructor() { this.event = nothing; } fire() { seen.trees += 1; } }
        const vscode = {
            EventEmitter, StatusBarAlignment: {}, commands: { registerCommand: nothing },
            window: { createStatusBarItem: () => Object.assign(seen.clock, { show: nothing, hide: nothing }),
                registerTreeDataProvider: nothing },
            debug: { registerDebugAdapterDescriptorFactory: nothing, registerDebugConfigurationProvider: nothing,
                registerDebugAdapterTrackerFactory: (_type, one) => seen.trackers.push(one) },
        };
        require('module')._load = ((load) => (name, ...rest) => name === 'vscode' ? vscode : load(name, ...rest))
            (require('module')._load);
        require('./extension.js').activate({ subscriptions: [] });
        let time = 'cycle 5, 3 before the present';
        const session = { customRequest: async () => ({ result: time }) };
        const tracker = seen.trackers[0].createDebugAdapterTracker(session), shown = [];
        const told = async (message) => {
            tracker.onDidSendMessage(message);
            await new Promise((done) => setTimeout(done));
            shown.push([seen.clock.text, seen.trees]);
        };
        (async () => {
            await told({ type: 'event', event: 'stopped' });
            time = 'cycle 5';
            await told({ type: 'event', event: 'output' });
            await told({ type: 'event', event: 'invalidated' });
            console.log(JSON.stringify(shown));
        })();
    """
    done = subprocess.run(["node", "-e", script], cwd=FOLDER, capture_output=True, text=True, timeout=HANG, check=True)
    past = "$(watch) cycle 5, 3 before the present"
    assert json.loads(done.stdout) == [[past, 1], [past, 1], ["$(watch) cycle 5", 1]]


@pytest.mark.skipif(shutil.which("node") is None, reason="no node here (Debian package nodejs)")
def test_a_python_without_the_debugger_is_reported(tmp_path: Path) -> None:
    """A Python without the debugger is reported, because VS Code shows no error if an adapter ends at once."""
    script = """
        require('module')._load = ((load) => (name, ...rest) => name === 'vscode' ? {} : load(name, ...rest))
            (require('module')._load);
        const { started } = require('./extension.js');
        const said = (python, module) => started(python, ['-m', module, 'debug'], process.argv[1])
            .then(() => 'starts', (error) => error.message);
        (async () => console.log(JSON.stringify([
            await said(process.argv[2], 'emu'), await said(process.argv[2], 'emus'),
            await said('no-such-python', 'emu')])))();
    """
    command = ["node", "-e", script, str(tmp_path), sys.executable]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        command, cwd=FOLDER, env=environment, capture_output=True, text=True, timeout=HANG, check=True
    )
    good, other, none = json.loads(done.stdout)
    assert good == "starts"
    assert "does not start the debugger" in other
    assert "No module named emus. Set openswarm.python" in other
    assert "no-such-python does not start the debugger: there is no such program." in none


@pytest.mark.skipif(shutil.which("node") is None, reason="no node here (Debian package nodejs)")
def test_odd_values_of_a_configuration_are_refused_in_words() -> None:
    script = """
        require('module')._load = ((load) => (name, ...rest) => name === 'vscode' ? {} : load(name, ...rest))
            (require('module')._load);
        const { addressOf, wordsOf } = require('./extension.js');
        const said = (work) => { try { return work().slice(-2).map(String); } catch (error) { return error.message; } };
        const swarm = (values) => said(() => wordsOf({ scene: 'clustering', ...values }));
        const attach = (values) => said(() => addressOf(values));
        console.log(JSON.stringify([
            ...['--seed 3', [{}], ['--seed', 3]].map((arenaOptions) => swarm({ arenaOptions })),
            ...['two', -1, 1.5, '', '2'].map((robot) => swarm({ robot })),
            attach({}), ...['x', 0, 70000, '4711'].map((port) => attach({ port }))]));
    """
    done = subprocess.run(["node", "-e", script], cwd=FOLDER, capture_output=True, text=True, timeout=HANG, check=True)
    words = 'arenaOptions must be a list of words, for example ["--seed", "3"]'
    robot, port = "robot must be a whole number from 0, not ", "port must be a whole number from 1, not "
    assert json.loads(done.stdout) == [
        words, words, ["--seed", "3"], f'{robot}"two"', f"{robot}-1", f"{robot}1.5", f'{robot}""', ["--robot", "2"],
        "attach needs `port` or `socket`, as given to `emu debug` or `arena debug`",
        f'{port}"x"', f"{port}0", f"{port}70000", ["4711", "127.0.0.1"],
    ]  # fmt: skip


@pytest.mark.skipif(shutil.which("node") is None, reason="no node here (Debian package nodejs)")
def test_it_attaches_to_a_port_or_a_unix_socket() -> None:
    script = """
        const made = [];
        const vscode = {
            DebugAdapterNamedPipeServer: function (...words) { made.push(['socket', ...words]); },
            DebugAdapterServer: function (...words) { made.push(['port', ...words]); },
            EventEmitter: class { },
            StatusBarAlignment: {},
            commands: { registerCommand: () => 0 },
            debug: { registerDebugAdapterDescriptorFactory: (_type, one) => { adapters = one; },
                     registerDebugConfigurationProvider: () => 0, registerDebugAdapterTrackerFactory: () => 0 },
            window: { createStatusBarItem: () => ({}), registerTreeDataProvider: () => 0 },
        };
        let adapters;
        require('module')._load = ((load) => (name, ...rest) => name === 'vscode' ? vscode : load(name, ...rest))
            (require('module')._load);
        require('./extension.js').activate({ subscriptions: [] });
        const attach = (values) => adapters.createDebugAdapterDescriptor(
            { configuration: { request: 'attach', ...values } });
        (async () => {
            await attach({ port: 4711 });
            await attach({ socket: '/run/debug' });
            console.log(JSON.stringify(made));
        })();
    """
    done = subprocess.run(["node", "-e", script], cwd=FOLDER, capture_output=True, text=True, timeout=HANG, check=True)
    assert json.loads(done.stdout) == [["port", 4711, "127.0.0.1"], ["socket", "/run/debug"]]


@pytest.mark.slow
def test_it_is_packaged(tmp_path: Path) -> None:
    """VS Code's tool packages the extension, its licence and its README, and no other file."""
    npx = shutil.which("npx")
    if npx is None:
        pytest.skip("there is no npm (Debian packages nodejs, npm)")
    given = os.environ.get("VSCE_NODE_MODULES")
    tool = [str(Path(given) / ".bin" / "vsce")] if given else [npx, "--yes", "--fetch-retries=0", VSCE]
    copy = shutil.copytree(FOLDER, tmp_path / "vscode", ignore=shutil.ignore_patterns("*.vsix"))
    out = tmp_path / "openswarm.vsix"
    words = [*tool, "package", "--allow-missing-repository", "--out", str(out)]
    done = subprocess.run(words, cwd=copy, capture_output=True, text=True, timeout=HANG, check=False)
    if done.returncode and "npm error" in done.stderr:
        pytest.skip(f"npm cannot get {VSCE}: {done.stderr.strip().splitlines()[-1]}")
    assert done.returncode == 0, done.stdout + done.stderr
    with zipfile.ZipFile(out) as package:
        names = set(package.namelist())
        manifest = ElementTree.fromstring(package.read("extension.vsixmanifest"))
        inner = json.loads(package.read("extension/package.json"))
    wanted = {"package.json", "extension.js", "readme.md", "LICENSE.txt", "icon.png"}
    wanted |= {f"walkthrough/{page.name}" for page in FOLDER.glob("walkthrough/*.md")}
    assert names == {"extension.vsixmanifest", "[Content_Types].xml", *(f"extension/{name}" for name in wanted)}
    identity = manifest.find(".//{*}Identity")
    assert identity is not None
    assert (identity.get("Id"), identity.get("Version")) == ("openswarm", EXTENSION["version"])
    assert inner["contributes"] == EXTENSION["contributes"]
