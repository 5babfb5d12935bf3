"""binutils' readelf and LLVM's dwarfdump read the debug information without warnings."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile

import emu
from emu.debug.dwarf.units import debug_of
from tests.toolchain.c_programs import build

COMPLAINTS = ("arning", "rror", "orrupt", "overlap", "There is a hole", "nknown")
READELF_VIEWS = ("--debug-dump", "--debug-dump=decodedline", "--debug-dump=frames-interp")
MAIN = """\
struct three { int a, b, c; };
struct pair { int lo, hi; };
volatile int sink;
int never_called(int a) { int k = a; { int j = k * 3; sink = j; } return k; }
__attribute__((noinline)) int sum(struct three t, struct pair p, long q)
{
    int s = t.a + p.lo;
    sink = s;
    return s + t.c + p.hi + (int)q;
}
static inline int square(int x) { int r = x * x; sink = r; return r; }
const int limit = 17;
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void) { sink++; }
void __attribute__((interrupt, auto_psv)) _T2Interrupt(void)
{
    sink = sum((struct three){1, 2, 3}, (struct pair){1, 2}, 3);
}
int never_called_either(int a) { return a + limit; }
int in_assembly(int);
int main(void)
{
    struct three t = {1, sink, 3};
    struct pair p = {sink, 4};
    for (int i = 0; i < limit; i++)
        sink = square(i);
    return sum(t, p, sink) + in_assembly(3);
}
"""
ASSEMBLY = """\
    .text
    .global _in_assembly
_in_assembly:
    inc w0,w0
    return
"""


def debug_image(folder: Path, *options: str) -> Path:
    """Return an image with debug information, linked from a C and an assembly file."""
    (folder / "main.c").write_text(MAIN)
    (folder / "low.s").write_text(ASSEMBLY)
    image = folder / "both.elf"
    built = build([folder / "main.c", folder / "low.s"], image, "-g", *options)
    assert built.status == 0, built.messages
    return image


@pytest.mark.skipif(shutil.which("readelf") is None, reason="readelf is not installed (Debian package binutils)")
@pytest.mark.parametrize(
    "options", [("-O0",), ("-Os",), ("-O2", "-fno-lto"), ("-O1", "-fno-lto", "-Wl,--gc-sections")], ids=" ".join
)
def test_readelf_and_dwarfdump_report_no_errors(tmp_path: Path, options: tuple[str, ...]) -> None:
    """readelf and dwarfdump report no errors in images with plain DWARF, the default.

    Discarded functions leave no gaps and do not end lists.
    """
    image = debug_image(tmp_path, *options)
    for view in READELF_VIEWS:
        said = subprocess.run(["readelf", view, str(image)], capture_output=True, text=True, check=True)
        found = [line for line in (said.stdout + said.stderr).splitlines() if any(word in line for word in COMPLAINTS)]
        assert not found, (view, found[:3])
        assert "Contents of the .debug_" in said.stdout
    if shutil.which("llvm-dwarfdump") is None:
        pytest.skip("llvm-dwarfdump is not there (Debian package llvm)")
    done = subprocess.run(["llvm-dwarfdump", "--verify", str(image)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert "No errors" in done.stdout


def test_debug_phantoms_are_stored_on_request_and_both_forms_are_readable(tmp_path: Path) -> None:
    """With the option images store each DWARF byte with a phantom octet in SHT_NOTE sections, like XC16 (abi-elf.md
    §6.2).

    Both forms are readable.
    """
    plain = debug_image(tmp_path, "-Os")
    doubled = plain.rename(tmp_path / "plain.elf")
    plain, doubled = doubled, debug_image(tmp_path, "-Os", "-Wl,--debug-phantoms")

    def sections(image: Path) -> dict[str, tuple[str, bytes]]:
        with image.open("rb") as file:
            return {
                s.name: (s["sh_type"], s.data()) for s in ELFFile(file).iter_sections() if s.name.startswith(".debug_")
            }

    ours, theirs = sections(plain), sections(doubled)
    assert ours.keys() == theirs.keys()
    for name, (kind, octets) in theirs.items():
        assert (kind, octets[::2], any(octets[1::2])) == ("SHT_NOTE", ours[name][1], False)
        assert ours[name][0] == "SHT_PROGBITS"
    images = [emu.load(one).image for one in (plain, doubled)]
    rows = [[(row.start, row.line) for row in image.lines.rows] for image in images]
    assert rows[0] == rows[1] != []
    functions = [[(f.name, f.ranges) for f in debug_of(image).functions] for image in images]
    assert functions[0] == functions[1] != []
