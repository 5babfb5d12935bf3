"""`make TOOLCHAIN=xc16`: Microchip's compiler supports the command line, the C and the assembly of the firmware.

The compiler itself is not available. A stand-in on PATH accepts only its documented options (XC16 C Compiler User's
Guide DS50002071, MPLAB Assembler, Linker and Utilities DS50002106) and builds with this project's toolchain.
"""

from __future__ import annotations

import os
import re
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from emu.cli import main
from openswarm.cli import main as openswarm
from tests.cases import check_all
from tests.firmware.conftest import FIRMWARE, ROOT
from toolchain.device_header import folder_of

APPS = ["hello", "listing1", "processors", "footprint", "latency", "stress"]
OPTIONS = (
    r"-mcpu=30F6014A|-omf=elf|-std=gnu99|-Os|-g|-fno-short-double|-Wall|-Wextra|-o|-D\w+(=.*)?|-I\S+|-Wa,-I\S+"
    r"|-Wl(,(--script=p30F6014A\.gld|-Map=\S+?))+"
)
STAND_IN = f'''#!{sys.executable}
import re, subprocess, sys
known = re.compile(r"""{OPTIONS}""")
words = sys.argv[1:]
for word in words:
    if word.startswith("-") and not known.fullmatch(word):
        sys.exit("xc16-gcc: unknown option " + word)
kept = [w for w in words if not re.match("-mcpu|-omf|-std|-fno-short-double|-W[la],", w)]
sys.exit(subprocess.run([sys.executable, "-m", "toolchain", "cc", *kept]).returncode)
'''
DIRECTIVES = {".equ", ".global", ".text", ".bss", ".space", ".macro", ".endm", ".ifndef", ".endif", ".irp", ".endr"}
DIRECTIVES |= {".set", ".pword", ".include"}
"""Directives of pic30-as, all documented in DS50002106."""
SECTION = r"\.section \.\w+(, (code|noload|keep|persist|address\(\w+\)))+"
"""Section attributes of pic30-as (DS50002106); the preprocessor expands a macro to the number."""
OTHER_ROBOTS = {"posix", "template", "host", "avr", "kilobot", "cortex_m", "epuck2", "riscv", "qemu_virt"}
"""Names of ports and boards that are not built for the dsPIC30F."""
BUILTINS = ["write_NVM()=((void)0)"]
BUILTINS += [f"{name}(offset)=((unsigned)(offset))" for name in ("tblrdl", "tblrdh")]
BUILTINS += [f"{name}(offset,value)=((void)(offset),(void)(value))" for name in ("tblwtl", "tblwth")]
"""Macros for the built-in functions that only XC16 has, with their arguments."""
HEADERS = sorted({path.parent for path in (FIRMWARE / "openswarm").rglob("*.h") if not OTHER_ROBOTS & {*path.parts}})


def sources(pattern: str) -> list[Path]:
    """Return the files of the kernel, of its dsPIC30F port and of the e-puck's board."""
    return sorted(path for path in FIRMWARE.glob(f"openswarm/**/{pattern}") if not OTHER_ROBOTS & {*path.parts})


def script(path: Path, text: str) -> None:
    path.write_text(text)
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


@pytest.fixture(scope="module")
def stand_in(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with executable stand-ins for xc16-gcc and xc16-bin2hex."""
    folder = tmp_path_factory.mktemp("xc16")
    script(folder / "xc16-gcc", STAND_IN)
    script(
        folder / "xc16-bin2hex",
        f"#!{sys.executable}\nimport subprocess, sys\nassert sys.argv[2:] == ['-a', '-omf=elf'], sys.argv\n"
        "sys.exit(subprocess.run([sys.executable, '-m', 'toolchain', 'hex', sys.argv[1]]).returncode)\n",
    )
    return folder


def make(stand_in: Path, app: str, out: Path) -> Path:
    path = os.pathsep.join([str(stand_in), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), "MAKEFLAGS": ""}
    command = ["make", "-s", "-C", str(FIRMWARE), f"APP={app}", "TOOLCHAIN=xc16", f"OUT={out}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    return out / "firmware.elf"


@pytest.mark.slow
def test_it_builds_and_the_measuring_commands_find_their_symbols(stand_in: Path, tmp_path: Path, capsys) -> None:
    """`make -C firmware APP=... TOOLCHAIN=xc16` builds an image in which the measuring commands find their symbols.

    The image is compiled without stack checks.
    """
    image = make(stand_in, "latency", tmp_path / "latency")
    assert (tmp_path / "latency" / "firmware.hex").exists()
    assert main(["cycles", "--suite", str(image)]) == 0
    assert "Sys_Yield to a preempted thread" in capsys.readouterr().out
    assert main(["footprint", str(image), "--seconds", "0.1"]) == 0
    assert "kernel stack" in capsys.readouterr().out


def test_the_assembler_is_given_the_folder_of_interrupt_entries() -> None:
    """The assembler receives the include path of isr.inc, which openswarm_interrupt.h includes in assembly within C.

    A GCC of XC16's version does not pass -I on to its assembler.
    """
    command = ["make", "-n", "-C", str(FIRMWARE), "APP=spi", "TOOLCHAIN=xc16", "OUT=build/never"]
    words = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    folders = [word.removeprefix("-Wa,-I") for word in words if word.startswith("-Wa,-I")]
    assert any((FIRMWARE / folder / "isr.inc").exists() for folder in folders)


def test_an_option_of_ours_is_none_of_theirs(stand_in: Path) -> None:
    """The stand-in refuses options that only this project's compiler has."""
    done = subprocess.run([stand_in / "xc16-gcc", "-fstack-check"], capture_output=True, text=True, check=False)
    assert "unknown option" in done.stderr


@pytest.mark.slow
def test_the_kernel_is_gnu99() -> None:
    """The kernel compiles as gnu99: GCC 4.5 supports neither C11 nor later extensions."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed (Debian package gcc)")
    check_all(check_gnu99, sources("*.c"))


def test_the_applications_are_gnu99(tmp_path: Path) -> None:
    """The applications compile as gnu99, including the host programs in their folders."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed (Debian package gcc)")

    def check(app: Path) -> None:
        for program in sorted(app.glob("*/main.c")):
            rows = tmp_path / program.parent.name
            words = ["program", str(program), "--version", "1", "-o", f"{rows}.elf", "--header", f"{rows}.h"]
            assert openswarm(words) == 0
            check_gnu99(program)
        for source in sorted(app.glob("*.c")):
            check_gnu99(source, tmp_path)

    check_all(check, sorted(path for path in FIRMWARE.glob("apps/*") if path.is_dir()))


def check_gnu99(source: Path, *folders: Path) -> None:
    shared = [FIRMWARE / "apps" / app for app in ("clustering", "clocks")]
    includes = [f"-I{folder}" for folder in [*HEADERS, *shared, *folders]] + [
        "-isystem",
        str(ROOT / "toolchain" / "include"),
        "-isystem",
        str(folder_of("dsPIC30F6014A")),
    ]
    flags = [
        "-std=gnu99", "-pedantic", "-Wall", "-Wextra", "-Wc99-c11-compat", "-Wno-pointer-to-int-cast", "-fsyntax-only",
    ]  # fmt: skip
    # Addresses have 16 bits: pointers do not fit into integers on a host.
    layout = ["-DSYS_DEFAULT_STACK=256", "-include", "stddef.h", "-Wno-type-limits", "-Wno-attributes"]
    layout += ["-D__dsPIC30F6014A__"]  # as -mcpu defines it
    if source.parent.name == "update_auth":
        layout += ["-DSYS_UPDATE_AUTH"]  # as its device.mk defines it
    layout += [f"-D__builtin_{one}" for one in BUILTINS]
    command = ["gcc", *flags, *layout, *includes, str(source)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    found = [line for line in done.stderr.splitlines() if re.search(r"(error|warning):", line)]
    assert [line for line in found if not re.search(r"size of array|different size", line)] == []


def test_the_assembly_uses_directives_of_pic30_as_only() -> None:
    """Assembly files contain only labels, instructions, comments after `;`, preprocessor lines and known directives."""

    def check(source: Path) -> None:
        for number, line in enumerate(source.read_text().splitlines(), 1):
            code = line.split(";")[0].strip()
            if code.startswith("#"):
                assert re.fullmatch(r'#(include "[\w.]+"|if \w+ == \w+|else|endif)', code), number
            if code.startswith(".section"):
                assert re.fullmatch(SECTION, code), f"{number}: {code}"
                continue
            for word in re.findall(r"(?<!\S)\.\w+", code):
                assert word in DIRECTIVES, f"{number}: {word}"

    check_all(check, sources("*.[Si]*"))
