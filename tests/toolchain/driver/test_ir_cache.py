"""IR of unchanged C files from the cache (`cc -fcache-ir`)."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from tests.toolchain.c_programs import build
from toolchain.driver import driver, ir_cache
from toolchain.frontend import clang

MAIN = '#include "size.h"\n#include <limit.h>\nint other(int);\nint main(void) { return other(SIZE); }\n'
BOTH = ["main.c", "other.c"]


class Compiled:
    """Builds a program of two C files with -fcache-ir and counts the files that clang compiles."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder = folder
        self.runs: list[str] = []
        original = clang.run_jobs

        def run_jobs(jobs: list[clang.ClangJob], parallel: int, show: bool = False) -> list[bool]:
            self.runs += [job.source.name for job in jobs if job.source.suffix == ".c"]
            return original(jobs, parallel, show)

        monkeypatch.setattr(clang, "run_jobs", run_jobs)
        monkeypatch.setattr(ir_cache, "front_end_results", lambda: folder / "cache" / "ir")
        self.write("main.c", MAIN)
        self.write("other.c", "int other(int x) { return x + 1; }\n")
        self.write("late/limit.h", "#define LIMIT 4\n")
        self.write("late/size.h", "#define SIZE LIMIT\n")
        (folder / "early").mkdir()

    def write(self, name: str, text: str) -> None:
        """Write a file with a time stamp before the run, like a file that a user saved before the build."""
        path = self.folder / name
        path.parent.mkdir(exist_ok=True, parents=True)
        path.write_text(text)
        os.utime(path, (time.time() - 60,) * 2)

    def __call__(self, *options: str) -> tuple[list[str], bytes]:
        """Build; return the names of the compiled C files and the image."""
        self.runs.clear()
        folders = [f"-I{self.folder / name}" for name in ("early", "late")]
        sources = [self.folder / name for name in BOTH]
        built = build(sources, self.folder / "a.elf", "-fcache-ir", "-Os", "-g", *folders, *options)
        assert built.status == 0, built.messages
        return sorted(self.runs), (self.folder / "a.elf").read_bytes()


@pytest.fixture
def compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Compiled:
    return Compiled(tmp_path, monkeypatch)


def test_only_changed_files_are_compiled(compiled: Compiled) -> None:
    """Changed sources, headers and flags, and headers found earlier, cause compilation; images equal full builds."""
    first = compiled()
    assert first[0] == BOTH
    assert compiled() == ([], first[1])
    compiled.write("other.c", "int other(int x) { return x + 2; }\n")
    assert compiled()[0] == ["other.c"]
    compiled.write("late/limit.h", "#define LIMIT 5\n")
    changed = compiled()
    assert changed[0] == ["main.c"]
    assert changed[1] == compiled("-fno-cache-ir")[1] != first[1]
    compiled.write("early/size.h", "#define SIZE 6\n")
    assert compiled()[0] == ["main.c"]
    compiled.write("limit.h", "#error not found by <limit.h>\n")
    assert compiled()[0] == ["main.c"]
    assert compiled("-DADDED")[0] == BOTH
    assert compiled("-DADDED")[0] == []
    (compiled.folder / "early/size.h").unlink()
    assert compiled()[1] == changed[1]


@pytest.mark.parametrize("text", [
    "int other(int x) { return x + __TIME__[0]; }\n",
    "int other(int x) { return x + __TI\\\nME__[0]; }\n",
    '#if __has_include("absent.h")\n#error\n#endif\nint other(int x) { return x; }\n',
    "int other(int x) { int unused; return x; }\n",
])  # fmt: skip
def test_a_file_that_varies_or_has_warnings_is_compiled_each_time(compiled: Compiled, text: str) -> None:
    compiled.write("other.c", text)
    assert compiled("-Wall")[0] == BOTH
    assert compiled("-Wall")[0] == ["other.c"]


@pytest.mark.parametrize(("options", "source", "found", "new"), [
    (["-Ilate", "-include", "x.h"], "src/m.c", "late/x.h", "x.h"),
    (["-Ilate", "-imacros", "x.h"], "src/m.c", "late/x.h", "x.h"),
    (["-Iearly/", "-Ilate/", "-DHEADER=<sub/x.h>"], "src/m.c", "late/sub/x.h", "early/sub/x.h"),
    (["-Iearly", "-I.", "-DHEADER=<sub/x.h>"], "m.c", "sub/x.h", "early/sub/x.h"),
    (["-I./early", "-I./late", "-DHEADER=<sub/x.h>"], "src/m.c", "late/sub/x.h", "early/sub/x.h"),
    (["-DHEADER=<x.h>"], "src/m.c", "by_environment/x.h", "first/x.h"),
])  # fmt: skip
def test_a_new_file_that_clang_finds_first_is_compiled(
    compiled: Compiled, monkeypatch: pytest.MonkeyPatch, options: list[str], source: str, found: str, new: str
) -> None:
    """Cases: forced includes, folders with a final slash or a leading dot, and folders of environment variables."""
    monkeypatch.chdir(compiled.folder)
    monkeypatch.setenv("CPATH", "first:by_environment")
    for folder in ("early", "first"):
        (compiled.folder / folder).mkdir(exist_ok=True)
    compiled.write(source, "#ifdef HEADER\n#include HEADER\n#endif\nint other(void) { return X; }\n")
    compiled.write(found, "#define X 1\n")
    words = ["-fcache-ir", *options, "-c", source, "-o", "m.o"]
    seen = []
    for is_new in (False, False, True):
        if is_new:
            compiled.write(new, "#define X 2\n")
        compiled.runs.clear()
        assert driver.main(words) == 0
        seen.append((compiled.runs == ["m.c"], (compiled.folder / "m.o").read_bytes()))
    assert [ran for ran, _ in seen] == [True, False, True]
    assert seen[0][1] == seen[1][1] != seen[2][1]


@pytest.mark.parametrize("flag", ["-DODD=__TIME__", "-DODD=__has_include"])
def test_a_file_with_a_flag_that_varies_is_compiled_each_time(compiled: Compiled, flag: str) -> None:
    assert compiled(flag)[0] == BOTH
    assert compiled(flag)[0] == BOTH


def test_an_override_of_clangs_options_is_another_entry(compiled: Compiled, monkeypatch: pytest.MonkeyPatch) -> None:
    first = compiled()
    monkeypatch.setenv("CCC_OVERRIDE_OPTIONS", "# +-DADDED")
    assert compiled()[0] == BOTH
    monkeypatch.delenv("CCC_OVERRIDE_OPTIONS")
    assert compiled() == ([], first[1])


def test_a_header_whose_name_is_no_text_is_cached(compiled: Compiled) -> None:
    name = os.fsdecode(b"\xe9t\xe9.h")
    compiled.write(name, "#define X 1\n")
    (compiled.folder / "other.c").write_bytes(b'#include "\xe9t\xe9.h"\nint other(int x) { return x + X; }\n')
    os.utime(compiled.folder / "other.c", (time.time() - 60,) * 2)
    first = compiled()
    assert compiled() == ([], first[1])
    compiled.write(name, "#define X 2\n")
    assert compiled()[0] == ["other.c"]


def test_debug_information_names_headers_by_the_given_map(
    compiled: Compiled, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(compiled.folder)
    compiled.write("x.h", "static inline int own(int x) { return x; }\n")
    compiled.write("other.c", '#include "x.h"\nint other(int x) { return own(x); }\n')
    images = []
    for mapped in ("one", "two"):
        words = ["-fcache-ir", "-g", "-O0", f"-fdebug-prefix-map=./={mapped}/", "-c", "other.c", "-o", "o.o"]
        assert driver.main(words) == 0
        images.append((compiled.folder / "o.o").read_bytes())
    assert images[0] != images[1]


def test_a_file_changed_during_the_run_is_not_cached(compiled: Compiled) -> None:
    (compiled.folder / "late/limit.h").touch()
    os.utime(compiled.folder / "late/limit.h", (time.time() + 60,) * 2)
    assert compiled()[0] == BOTH
    assert compiled()[0] == ["main.c"]


def test_copies_in_other_folders_share_entries(compiled: Compiled, monkeypatch: pytest.MonkeyPatch) -> None:
    """Relative paths, and -ffile-prefix-map= of the working folder; without the map, debug information names it."""
    images = []
    for name in ("one", "two"):
        folder = compiled.folder / name
        for part in (*BOTH, "late/limit.h", "late/size.h"):
            compiled.write(f"{name}/{part}", (compiled.folder / part).read_text())
        monkeypatch.chdir(folder)
        for recorded in ("here", "there"):
            compiled.runs.clear()
            words = ["-fcache-ir", "-g", "-Ilate", *BOTH, "-o", "a.elf", f"-ffile-prefix-map={folder}={recorded}"]
            assert driver.main(words) == 0
            images.append((sorted(compiled.runs), (folder / "a.elf").read_bytes()))
        compiled.runs.clear()
        assert driver.main(["-fcache-ir", "-g", "-Ilate", *BOTH, "-o", "a.elf"]) == 0
        assert sorted(compiled.runs) == BOTH
    assert [runs for runs, _ in images] == [BOTH, BOTH, [], []]
    assert images[0][1] == images[2][1] != images[1][1] == images[3][1]


def test_a_damaged_cache_is_not_used(compiled: Compiled) -> None:
    first = compiled()
    for path in (compiled.folder / "cache" / "ir").glob("*/*"):
        path.write_bytes(path.read_bytes()[:-1])
    assert compiled() == first


def test_dependency_files_are_written_each_time(compiled: Compiled, tmp_path: Path) -> None:
    for _ in range(2):
        built = build([tmp_path / "main.c"], tmp_path / "main.o", "-fcache-ir", "-c", "-MD", f"-I{tmp_path / 'late'}")
        assert built.status == 0, built.messages
        assert "limit.h" in (tmp_path / "main.d").read_text()
        (tmp_path / "main.d").unlink()


def test_errors_are_reported_each_time(compiled: Compiled, capfd: pytest.CaptureFixture[str]) -> None:
    compiled.write("other.c", "int other(int x) { return y; }\n")
    for _ in range(2):
        assert driver.main(["-fcache-ir", "-c", str(compiled.folder / "other.c")]) == 1
        assert "undeclared identifier 'y'" in capfd.readouterr().err
