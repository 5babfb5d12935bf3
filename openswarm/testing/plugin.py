"""pytest plugin: builds firmware, runs it on an emulated robot, and keeps the artefacts of failures.

    @pytest.mark.firmware("main.c")            # or a folder with a Makefile, or an ELF file; else the ini value
    @pytest.mark.robot(selector=3)             # board and surroundings: see openswarm.testing.robot.Robot
    def test_it_answers(robot):
        robot.uart.expect("ready", within_ms=50)

The artefacts of a failed test are in their own folder below `--robot-artefacts`, which the report and JUnit's
properties name. Every test has a new robot, so tests may run in any order and in several processes.
"""

from __future__ import annotations

import fcntl
import re
import shutil
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pytest

if TYPE_CHECKING:
    from openswarm.testing.robot import Robot

ROBOTS: Final = pytest.StashKey[list[Any]]()
"""Stash key of the robots that a test has created."""
BUILT: Final = pytest.StashKey[dict[tuple[str, ...], Path]]()
"""Stash key of the images that this process has built, by their source."""
MADE: Final = "build/firmware.elf"
"""Path of the image that a project's Makefile builds (`openswarm new`)."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the plugin's command line options and ini settings."""
    group = parser.getgroup("openswarm", "firmware on an emulated robot")
    group.addoption(
        "--robot-artefacts", metavar="DIR", default="robot-artefacts",
        help="where failed tests leave reports and waveforms (default: robot-artefacts)",
    )  # fmt: skip
    parser.addini("firmware", "C file, folder with a Makefile, or ELF file that `firmware` is, relative to the rootdir")


def pytest_configure(config: pytest.Config) -> None:
    """Register the plugin's marks."""
    config.addinivalue_line("markers", "firmware(source, flags=...): what the fixture `firmware` is made from")
    config.addinivalue_line("markers", "robot(**around): what is around the chip of the fixture `robot`")
    config.stash[BUILT] = {}


@pytest.fixture
def firmware(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the ELF file of this test, given by its mark `firmware` or by the ini value."""
    config = request.config
    mark = request.node.get_closest_marker("firmware")
    if mark is not None and mark.args:
        source = (request.path.parent / mark.args[0]).resolve()
        flags = tuple(mark.kwargs.get("flags", ("-Os", "-g")))
    elif config.getini("firmware"):
        source, flags = (config.rootpath / config.getini("firmware")).resolve(), ("-Os", "-g")
    else:
        raise pytest.UsageError("no firmware: mark the test @pytest.mark.firmware(...) or set `firmware` in pytest.ini")
    built = config.stash[BUILT]
    key = (str(source), *flags)
    if key not in built:
        built[key] = _built(source, flags, tmp_path_factory)
    return built[key]


def _built(source: Path, flags: tuple[str, ...], folders: pytest.TempPathFactory) -> Path:
    import emu

    if source.is_dir():
        return _build_project(source)
    if not source.exists():
        raise pytest.UsageError(f"{source} does not exist")
    if source.suffix != ".c":
        return source
    return emu.build(source, flags=flags, output=folders.mktemp("firmware") / f"{source.stem}.elf")


def _build_project(folder: Path) -> Path:
    """Build a project with its Makefile and return the image. A lock serialises the builds of several processes."""
    from emu import BuildError

    with (folder / "Makefile").open(encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        words = ["make", "-s", "-C", str(folder), f"PYTHON={sys.executable}"]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BuildError(done.stderr.strip() or done.stdout.strip())
    return folder / MADE


@pytest.fixture
def robot(request: pytest.FixtureRequest, firmware: Path) -> Robot:
    """Return a robot with the test's firmware after power-on; the mark `robot` configures the board and its
    surroundings."""
    from openswarm.testing.robot import Robot

    around: dict[str, Any] = {}
    for mark in reversed(list(request.node.iter_markers("robot"))):
        around |= mark.kwargs
    for name in ("camera", "stimulus"):
        if isinstance(around.get(name), str):
            around[name] = request.path.parent / around[name]
    shutil.rmtree(_artefacts(request.node), ignore_errors=True)
    made = Robot(firmware, **around)
    request.node.stash.setdefault(ROBOTS, []).append(made)
    return made


def _cut_traceback(info: pytest.ExceptionInfo[BaseException]) -> None:
    """End the traceback of a failed test at the last line outside this package: a user cannot mend the lines inside."""
    import emu

    packages = [Path(emu.__file__).parent, Path(__file__).parents[1]]
    entries = list(info.traceback)
    while len(entries) > 1 and any(Path(entries[-1].path).is_relative_to(one) for one in packages):
        entries.pop()
    info.traceback = type(info.traceback)(entries)


def failure_of(call: pytest.CallInfo[None]) -> str:
    """Return what failed in a test: `assert 0 == 3 (test_robot.py:12)`, or the exception."""
    info = call.excinfo
    if info is None:
        return ""
    place = info.getrepr(style="short").reprcrash
    text = info.exconly(tryshort=True).removeprefix("AssertionError: ")
    return f"{text}\n  at {Path(place.path).name}:{place.lineno}" if place is not None else text


def _artefacts(item: pytest.Item) -> Path:
    """Return the folder for the artefacts of a test."""
    root: Path = item.config.rootpath / item.config.getoption("--robot-artefacts")
    return root / re.sub(r"[^\w.-]+", "_", item.nodeid).strip("_")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add properties for the JUnit report, and write the artefacts of a failed test."""
    robots = item.stash.get(ROBOTS, [])
    if robots and call.excinfo is not None and not item.config.getoption("fulltrace"):
        _cut_traceback(call.excinfo)
    report = yield
    if report.when != "call" or not robots:
        return report
    for number, one in enumerate(robots):
        item.user_properties.append((f"robot{number or ''}_cycles", one.cycle))
    if report.failed:
        from openswarm.testing import artefacts

        for number, one in enumerate(robots):
            folder = _artefacts(item) / str(number) if number else _artefacts(item)
            text = artefacts.write(one, folder, failure_of(call))
            report.sections.append(("robot", f"{text}\n\nwaveform: {folder / 'waves.vcd'}\nall of it: {folder}"))
            item.user_properties.append((f"robot{number or ''}_artefacts", str(folder)))
    report.user_properties = list(item.user_properties)
    return report
