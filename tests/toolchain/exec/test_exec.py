"""Cases of `*.c` on the emulator at several levels, compiled as a whole program and file by file.

There is one image per file and level. A generated main calls the cases in order and reports each over UART1 as `name
line`, with line 0 for a pass. A case that traps or hangs is reported as such, and the cases after it as not run.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.fuzz.seeds import base_seed
from tests.toolchain.c_programs import FrontEndOnce, build, run

FOLDER = Path(__file__).parent
MODES = ("-O0", "-O1", "-Os -fno-lto", "-O2", "-O1 -fno-lto")
"""Modes besides -Os. Every second file is built in one of them; the commit determines the files and their modes.

With -fno-lto files are compiled separately: calls are not inlined, so that aliasing effects of functions show.
"""
FILES = sorted(FOLDER.glob("*.c"))
CASE = re.compile(r'^TEST\((\w+),\s*"([^"]+)"\)', re.MULTILINE)
CYCLES = 40_000_000

MAIN = """
#include <stdio.h>
int exec_failed_line;
{declarations}
static const struct {{ const char *name; void (*run)(void); }} cases[] = {{ {table} }};
int main(void)
{{
    for (unsigned i = 0; i < sizeof cases / sizeof *cases; i++) {{
        exec_failed_line = 0;
        printf("%s ", cases[i].name);
        cases[i].run();
        printf("%d\\n", exec_failed_line);
    }}
    return 0;
}}
"""


def cases_of(path: Path) -> list[str]:
    """Return the names of the cases of one file, in order."""
    return [name for name, _ in CASE.findall(path.read_text())]


def results(path: Path, level: str, folder: Path, front: FrontEndOnce | None = None) -> dict[str, str]:
    """Return the result of each case: "ok", or a description of the failure."""
    names = cases_of(path)
    main = folder / f"{path.stem}_main.c"
    main.write_text(
        MAIN.format(
            declarations="\n".join(f"void test_{name}(void);" for name in names),
            table=", ".join(f'{{"{name}", test_{name}}}' for name in names),
        )
    )
    image = folder / f"{path.stem}{level.replace(' ', '')}.elf"
    options = [*level.split(), "-std=gnu11", "-Wall", "-Wno-unused", "-Wno-parentheses", f"-I{FOLDER}"]
    built = build([path, main], image, *options, front=front)
    if built.status != 0:
        return dict.fromkeys(names, f"does not build: {built.first_error}")
    ran = run(image, CYCLES, engine="auto")
    outcome = dict.fromkeys(names, f"not run: the program ended before ({ran.why or 'exit ' + str(ran.status)})")
    for line in ran.uart.decode("latin-1").splitlines():
        name, _, failed = line.partition(" ")
        if failed:
            outcome[name] = "ok" if failed == "0" else f"{path.name}:{failed}: check failed"
        else:
            outcome[name] = f"{ran.why or 'the program ended'} while it ran"
    return outcome


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_c_program_does_what_the_standard_says(path: Path, tmp_path: Path) -> None:
    """Each case passes in one or two modes; its second argument cites the paragraph of C11 or of abi-elf.md.

    The campaign `fuzz_compiler` runs random programs at every level.
    """
    front = FrontEndOnce()
    turn = base_seed() + FILES.index(path)
    modes = ("-Os", MODES[turn // 2 % len(MODES)]) if turn % 2 else ("-Os",)
    found = {mode: results(path, mode, tmp_path, front) for mode in modes}
    assert all(found.values())
    failed = [f"{mode}: {name}: {said}" for mode in modes for name, said in found[mode].items() if said != "ok"]
    assert not failed, "\n".join(failed)


def test_there_are_at_least_300_cases() -> None:
    """The suite contains at least 300 cases, each counted once for all levels."""
    assert sum(len(cases_of(path)) for path in FOLDER.glob("*.c")) >= 300


def test_a_failing_case_is_reported_as_failing(tmp_path: Path) -> None:
    """A failed check, a trap and the case after the trap are reported as not passed."""
    source = tmp_path / "broken.c"
    source.write_text(
        '#include "exec.h"\n'
        'TEST(good, "frame") { CHECK(I(1) == 1); }\n'
        'TEST(wrong, "frame") { CHECK(I(1) == 2); }\n'
        'TEST(trapping, "frame") { volatile int zero = 0; volatile int x = 7 / zero; (void)x; }\n'
        'TEST(after, "frame") { CHECK(1); }\n'
    )
    outcome = results(source, "-Os", tmp_path)
    assert outcome["good"] == "ok"
    assert "broken.c:3" in outcome["wrong"]
    assert "math error" in outcome["trapping"]
    assert "not run" in outcome["after"]
