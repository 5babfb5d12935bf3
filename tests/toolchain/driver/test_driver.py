"""The compiler driver: options, outputs, dependency files, bad input."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.toolchain.c_programs import run
from toolchain.driver import driver
from toolchain.elf.read import is_object, read_executable
from toolchain.errors import ToolError
from toolchain.frontend.clang import clang_program
from toolchain.frontend.options import parse


def cc(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str]:
    """Run the driver in this process; return exit status and stderr."""
    status = driver.main([str(word) for word in words])
    return status, capsys.readouterr().err


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_the_hidden_clang_command_of_the_wheel_exists() -> None:
    """The front end exists: the `clang` command hidden in the wheel `ziglang` (engines.md §5)."""
    said = subprocess.run([*clang_program(), "--version"], capture_output=True, text=True, check=True).stdout
    assert said.startswith("clang version")


def test_predefined_macros_are_those_of_the_device(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The predefined macros are those of the device (abi-elf.md §2.9).

    No MSP430 macro of the borrowed clang target may remain (engines.md §5).
    """
    source = write(tmp_path, "empty.c", "")
    assert driver.main(["-E", "-dM", str(source)]) == 0
    macros = capsys.readouterr().out
    assert "MSP430" not in macros.upper()
    for name in ("__dsPIC30F__", "__dsPIC30F6014A__", "__HAS_DSP__"):
        assert f"#define {name} 1" in macros
    for text in ("__SIZEOF_INT__ 2", "__SIZEOF_LONG__ 4", "__SIZEOF_POINTER__ 2", "__SIZEOF_DOUBLE__ 8",
                 "__SIZEOF_WCHAR_T__ 2", "__WCHAR_TYPE__ unsigned short"):  # fmt: skip
        assert f"#define {text}" in macros
    assert "__CHAR_UNSIGNED__" not in macros
    assert "__XC16__" not in macros


def test_compile_link_and_run(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Two C files and one assembly file are linked to one image, which returns the status of main."""
    a = write(tmp_path, "a.c", "int b(int); extern int c(void); int main(void) { return b(20) + c(); }\n")
    b = write(tmp_path, "b.c", "int b(int x) { return 2 * x; }\n")
    s = write(tmp_path, "c.s", "\t.section .text,code\n\t.global _c\n_c: mov #2,w0\n\treturn\n")
    image = tmp_path / "x.elf"
    assert cc(capsys, "-Os", "-Wall", a, b, s, "-o", image) == (0, "")
    assert run(image, engine="auto").status == 42


@pytest.mark.parametrize("flags", [(), ("-flto",), ("-g",)])
def test_separate_compilation(capsys: pytest.CaptureFixture[str], tmp_path: Path, flags: tuple[str, ...]) -> None:
    """Objects can be compiled with -c and linked later; with -flto they are bitcode, optimised as a whole program."""
    a = write(tmp_path, "a.c", "int b(int); static int k = 3; int main(void) { return b(20) + k; }\n")
    b = write(tmp_path, "b.c", "static int k = 1; int b(int x) { return 2 * x + k; }\n")
    for source in (a, b):
        assert cc(capsys, "-Os", "-c", *flags, source, "-o", source.with_suffix(".o")) == (0, "")
    assert is_object((tmp_path / "a.o").read_bytes()) == (flags != ("-flto",))
    image = tmp_path / "x.elf"
    assert cc(capsys, "-Os", tmp_path / "a.o", tmp_path / "b.o", "-o", image) == (0, "")
    assert run(image, engine="auto").status == 44


def test_whole_program_and_separate_linking_agree(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Whole-program optimisation, the default, gives the same result as -fno-lto and no larger image."""
    a = write(tmp_path, "a.c", "int b(int); int main(void) { return b(20) + b(1); }\n")
    b = write(tmp_path, "b.c", "int unused(int x) { return x / 3; } int b(int x) { return 2 * x; }\n")
    sizes = []
    for flag in ("-flto", "-fno-lto"):
        image = tmp_path / f"x{flag}.elf"
        assert cc(capsys, "-Os", flag, a, b, "-o", image) == (0, "")
        assert run(image, engine="auto").status == 42
        sizes.append(image.stat().st_size)
    assert sizes[0] <= sizes[1]


def test_hex_output_equals_the_elf(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The output of -o x.hex equals that of `toolchain hex` for the ELF file (abi-elf.md §6.8)."""
    source = write(tmp_path, "a.c", "const int t[3] = {1, 2, 3}; volatile int i = 2; int main(void) { return t[i]; }\n")
    assert cc(capsys, "-Os", source, "-o", tmp_path / "x.hex") == (0, "")
    assert cc(capsys, "-Os", source, "-o", tmp_path / "x.elf") == (0, "")
    assert (tmp_path / "x.hex").read_text().endswith(":00000001ff\n")
    assert run(tmp_path / "x.hex", engine="auto").status == run(tmp_path / "x.elf", engine="auto").status == 3


def test_dependency_file_names_headers_and_output(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """-MMD lists user headers but no system headers, as gcc does."""
    write(tmp_path, "mine.h", "#define N 3\n")
    source = write(tmp_path, "a.c", '#include <stdint.h>\n#include "mine.h"\nint main(void) { return N; }\n')
    assert cc(capsys, "-c", "-MMD", source, "-o", tmp_path / "a.o") == (0, "")
    text = (tmp_path / "a.d").read_text()
    assert text.startswith(str(tmp_path / "a.o"))
    assert "mine.h" in text
    assert "stdint.h" not in text
    assert cc(capsys, "-c", "-MD", "-MF", tmp_path / "deps", "-MT", "target", source, "-o", tmp_path / "a.o")[0] == 0
    assert (tmp_path / "deps").read_text().startswith("target:")
    assert "stdint.h" in (tmp_path / "deps").read_text()


@pytest.mark.parametrize("flags", [["-c", "-g"], ["-g"]])
def test_a_source_whose_name_is_no_text_is_compiled(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, flags: list[str]
) -> None:
    source = write(tmp_path, os.fsdecode(b"\xe9t\xe9.c"), "int main(void) { return 3; }\n")
    assert cc(capsys, *flags, source, "-o", tmp_path / "out.elf") == (0, "")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes of POSIX")
def test_a_pipe_is_no_source(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A pipe is refused: its first reader takes the content, so the next one would compile an empty text."""
    os.mkfifo(tmp_path / "main.c")
    status, said = cc(capsys, "-c", tmp_path / "main.c", "-o", tmp_path / "out.o")
    assert (status, said.count("\n")) == (2, 1)
    assert "main.c: is a pipe; expected a file" in said
    assert not (tmp_path / "out.o").exists()


def test_diagnostics_carry_the_users_file_and_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """All diagnostics of clang are printed with the user's file and line; warnings do not fail the run."""
    source = write(tmp_path, "warn.c", "int main(void)\n{\n    int unused = 3;\n    return 0;\n}\n")
    status, said = cc(capsys, "-Wall", source, "-o", tmp_path / "x.elf")
    assert status == 0
    assert f"{source}:3:9: warning: unused variable" in said


def test_single_precision_constants(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """-fsingle-precision-constant avoids double arithmetic for 1.1 * float."""
    source = write(tmp_path, "a.c", "float f(float x) { return x * 1.1; }\n")
    assert cc(capsys, "-Os", "-S", source, "-o", tmp_path / "double.s") == (0, "")
    assert cc(capsys, "-Os", "-S", "-fsingle-precision-constant", source, "-o", tmp_path / "single.s") == (0, "")
    assert "muldf3" in (tmp_path / "double.s").read_text()
    assert "muldf3" not in (tmp_path / "single.s").read_text()


XC16_ATTRIBUTES = """
int interrupt, space, address, near; /* attributes are no reserved words */
#define MY_ISR __attribute__((interrupt, no_auto_psv))
void __attribute__((interrupt, auto_psv)) _T1Interrupt(void) { interrupt++; }
void MY_ISR _T2Interrupt(void) { space++; }
void __attribute__((__interrupt__, __no_auto_psv__, __shadow__)) _T3Interrupt(void) { address++; }
int __attribute__((space(eedata))) settings = 5;
const int __attribute__((space(eedata))) defaults[3] = {5, 6, 7};
int __attribute__((space(xmemory), aligned(32))) x_line[16];
int __attribute__((__space__(ymemory), far)) y_line[16];
int __attribute__((persistent)) survivor;
int __attribute__((near)) close[100];
int __attribute__((far)) distant;
int __attribute__((noload)) untouched;
char __attribute__((reverse(64))) fft[64];
int __attribute__((address(0x1000))) fixed;
const char __attribute__((space(prog))) text[] = "hello";
void __attribute__((address(0x8000), noinline, unused)) moved(void) { near++; }
int main(void)
{
    moved();
    return x_line[0] + y_line[1] + survivor + close[0] + distant + untouched + fft[0] + fixed;
}
"""


def test_xc16_attributes(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Each Microchip attribute, in its spelling, selects its section (abi-elf.md §1.4, §2.5)."""
    source = write(tmp_path, "a.c", XC16_ATTRIBUTES)
    assert cc(capsys, "-Os", "-Wall", "-S", source, "-o", tmp_path / "a.s") == (0, "")
    said = re.sub(r"(\.eedata|\.prog)\.\d+,", r"\1.N,", (tmp_path / "a.s").read_text())
    assert said.count(".section .eedata.N,") == 2
    for line in (
        ".eedata.N,eedata,keep", ".xmemory._x_line,bss,xmemory",
        ".ymemory._y_line,bss,ymemory",
        ".pbss,persist", ".near._close,bss,near", ".far._distant,bss", ".nbss._untouched,bss,near,noload",
        ".nbss._fft,bss,near,reverse(0x40)", ".bss._fixed,bss,address(0x1000),keep", ".prog.N,code",
        ".text._moved,code,address(0x8000),keep",
    ):  # fmt: skip
        assert f"\t.section {line}\n" in said, line
    assert "push.s" in said
    assert cc(capsys, source, "-o", tmp_path / "x.elf") == (0, "")
    unknown = write(tmp_path, "b.c", "\nint __attribute__((bogus)) n;\n")
    said = cc(capsys, "-c", unknown, "-o", tmp_path / "b.o")[1]
    assert f"{unknown}:2:20: warning: unknown attribute 'bogus' ignored" in said


@pytest.mark.parametrize(("line", "attribute"), [
    ("void __attribute__((boot)) n(void) {}", "boot"),
    ("void __attribute__((noinline, secure(1))) n(void) {}", "secure"),
    ("int n __attribute__((space(dma)));", "space(dma)"),
    ("int n __attribute__((aligned(4), __space__(extern_memory)));", "space(extern_memory)"),
])  # fmt: skip
def test_unsupported_attributes_of_location_are_errors(
    line: str, attribute: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """An attribute that clang does not support and that affects a variable's location is an error."""
    source = write(tmp_path, "a.c", f"\n{line}\n")
    code, said = cc(capsys, "-c", source, "-o", tmp_path / "a.o")
    assert code == 1
    assert f"{source}:2:" in said
    assert f"error: static assertion failed: attribute {attribute} is not supported" in said


def test_xc16_register_names_in_inline_assembly(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Inline assembly may use w0-w15 as clobbers and register variables.

    Equal strings elsewhere, and diagnostics, are unchanged.
    """
    source = write(
        tmp_path,
        "a.c",
        r"""
int f(int a) { int r; asm("mov %1,w4\n\tadd w4,#1,w4\n\tmov w4,%0" : "=r"(r) : "r"(a) : "w4", "cc"); return r; }
int g(void) { register int x asm("w5") = 7; asm volatile("inc w5,w5" : "+r"(x)); return x; }
int main(void) { int unused; const char *s = "w4"; return f(4) == 5 && g() == 8 && s[0] == 'w' ? 0 : 1; }
""",
    )
    status, said = cc(capsys, "-Os", "-Wall", "-MMD", source, "-o", tmp_path / "x.elf")
    assert status == 0
    assert f"{source}:4:22: warning: unused variable" in said
    assert said.count("warning:") == 1
    assert str(source) in (tmp_path / "x.d").read_text()
    assert run(tmp_path / "x.elf").status == 0
    broken = write(tmp_path, "b.c", 'void f(void) { asm("nop" ::: "w4", "w16"); }\n')
    assert "unknown register name 'w16'" in cc(capsys, "-c", broken)[1]


@pytest.mark.parametrize("cycles", [13, 14, 15, 16, 17, 100, 1001, 70000])
def test_delays_have_the_requested_length(capsys: pytest.CaptureFixture[str], tmp_path: Path, cycles: int) -> None:
    """__delay32 of libpic30.h takes the requested cycles with call and return, measured by timer 1."""
    source = write(
        tmp_path,
        "a.c",
        f"""
#include <libpic30.h>
#include <p30f6014A.h>
int main(void)
{{
    T1CON = 0x8000;
    T2CON = 0x8008; /* 32 bits */
    unsigned start = TMR2;
    __delay32({cycles}ul);
    unsigned low = TMR2, high = TMR3HLD;
    unsigned long took = ((unsigned long)high << 16 | low) - start;
    return took >= {cycles}ul && took <= {cycles}ul + 12 ? 0 : (int)took | 1;
}}
""",
    )
    assert cc(capsys, "-Os", source, "-o", tmp_path / "x.elf") == (0, "")
    assert run(tmp_path / "x.elf").status == 0


def test_configuration_words_are_program_words(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Configuration words are in the output sections __FOSC, ... with code flags (abi-elf.md §6.6)."""
    text = "#include <p30F6014A.h>\n_FOSC(CSW_FSCM_OFF & XT_PLL8);\n_FWDT(WDT_OFF);\nint main(void) { return 0; }\n"
    assert cc(capsys, "-Os", write(tmp_path, "a.c", text), "-o", tmp_path / "x.elf") == (0, "")
    image = read_executable((tmp_path / "x.elf").read_bytes(), "x.elf")
    found = {s.name: s for s in image.sections if s.name in ("__FOSC", "__FWDT")}
    assert {name: (s.load, s.is_code, bytes(s.data)) for name, s in found.items()} == {
        "__FOSC": (0xF80000, True, b"\xe6\xff\0\0"), "__FWDT": (0xF80002, True, b"\xff\x7f\0\0")
    }  # fmt: skip


def test_calls_of_large_programs(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """-mlarge-code emits two-word calls; otherwise calls are RCALL (abi-elf.md §1.4)."""
    text = "extern void f(void), g(void); int main(void) { f(); g(); return 0; }\n"
    source = write(tmp_path, "a.c", text)
    for option, call in (("-mlarge-code", "\tcall _f\n"), ("-msmall-code", "\trcall _f\n")):
        assert cc(capsys, "-Os", option, "-S", source, "-o", tmp_path / "a.s") == (0, "")
        assert call in (tmp_path / "a.s").read_text()


def test_a_program_replaces_library_functions(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Functions of the program, such as memcpy and __putchar, override the library's weak archive members."""
    source = write(tmp_path, "a.c", """
#include <stdio.h>
#include <string.h>
static int said, copied;
int __putchar(int c) { said++; return c; }
void *memcpy(void *to, const void *from, size_t n)
{
    char *d = to;
    const char *s = from;
    for (copied++; n--;)
        *d++ = *s++;
    return to;
}
int main(void)
{
    char a[40], b[40] = "x";
    volatile size_t n = 40;
    memcpy(a, b, n);
    memset(b, 0, n);
    printf("%s!", a);
    return said * 10 + copied;
}
""")  # fmt: skip
    assert cc(capsys, "-Os", source, "-o", tmp_path / "x.elf") == (0, "")
    assert run(tmp_path / "x.elf", engine="auto").status == 21


def test_only_what_is_used_is_linked(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """An empty main is linked with start-up code and vectors only."""
    source = write(tmp_path, "a.c", "int main(void) { return 0; }\n")
    assert cc(capsys, "-Os", source, "-o", tmp_path / "x.elf") == (0, "")
    from toolchain.elf.read import read_executable

    image = read_executable((tmp_path / "x.elf").read_bytes(), "x.elf")
    words = sum(len(s.data) // 4 for s in image.sections if s.is_code and s.name == ".text")
    assert words < 90


BAD_COMMAND_LINES = [
    (["-Os"], "no input files"),
    (["nowhere.c"], "nowhere.c: no such file"),
    (["--frobnicate", "a.c"], "unknown option '--frobnicate'"),
    (["-mlarge-arrays", "a.c"], "an object has at most 32 Kbytes"),
    (["-mcpu=33FJ128", "a.c"], "device '33FJ128' is not supported"),
    (["a.c", "-o"], "option '-o' needs a value"),
    (["a.c", "-o", "a.c"], "would overwrite an input"),
    (["-c", "a.c", "b.c", "-o", "x.o"], "takes exactly one input"),
    (["a.xyz"], "unknown kind of file"),
    (["-x", "fortran", "a.c"], "unknown language 'fortran'"),
    (["a.c", "-o", "missing/x.elf"], "does not exist"),
    (["a.c", "-lnone"], "cannot find libnone.a"),
    (["a.c", "-Wl,--frob"], "linker option: unrecognized arguments: --frob"),
    (["a.c", "-Wl,--heap=lots"], "--heap: 'lots' is not a number"),
    (["a.c", "-j", "0"], "positive number"),
    (["@nothere"], "cannot read response file"),
]


@pytest.mark.parametrize(("words", "message"), BAD_COMMAND_LINES)
def test_bad_command_lines_say_what_is_wrong(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bad command line ends with exit status 2 and one message, without output file."""
    monkeypatch.chdir(tmp_path)
    for name in ("a.c", "b.c"):
        write(tmp_path, name, "int main(void) { return 0; }\n" if name == "a.c" else "")
    write(tmp_path, "a.xyz", "")
    before = sorted(os.listdir(tmp_path))
    status, said = cc(capsys, *words)
    assert status == 2
    assert message in said
    assert sorted(os.listdir(tmp_path)) == before


EMPTY_MAIN = "int main(void) { return 0; }\n"
TWO_UNKNOWN = "int f(void), g(void); int main(void) { return f() + g(); }\n"
F_IN_C = "int f(void) { return 1; } int main(void) { return f(); }\n"
F_IN_ASSEMBLY = "\t.section .text,code\n\t.global _f\n_f: return\n"
MUCH_RAM = "char big[9000]; int main(void) { big[3] = 1; return *(volatile char *)&big[8000]; }\n"
MUCH_CONST = "const unsigned char t[40000] = {1}; int main(void) { volatile int i = 3; return t[i]; }\n"
PLAIN_HANDLER = "int n; void _T1Interrupt(void) { n++; } int main(void) { return n; }\n"
MISSPELT_HANDLER = "#include <xc.h>\nint n; OS_ISR(_T1Interupt) { n++; } int main(void) { return n; }\n"
STRANGE_OPERAND = 'int main(void)\n{\n    int x;\n    __asm__("nop" : "=q"(x));\n    return x;\n}\n'

BAD_PROGRAMS = {
    "C error": ({"a.c": "int main(void) { return x; }\n"}, 1, "a.c:1:25: error: use of undeclared identifier 'x'"),
    "missing header": ({"a.c": '#include "none.h"\n'}, 1, "'none.h' file not found"),
    "undefined symbol": ({"a.c": TWO_UNKNOWN}, 2, "undefined symbol _f"),
    "undefined symbols are all listed": ({"a.c": TWO_UNKNOWN}, 2, "undefined symbol _g"),
    "duplicate in C": ({"a.c": F_IN_C, "b.c": "int f(void) { return 2; }\n"}, 2, "duplicate symbol"),
    "duplicate of C and assembly": ({"a.c": F_IN_C, "b.s": F_IN_ASSEMBLY}, 2, "duplicate symbol _f"),
    "assembly error": ({"a.c": EMPTY_MAIN, "b.s": "\tfrob w0,w1\n"}, 2, "b.s:1"),
    "RAM overflow": ({"a.c": MUCH_RAM}, 2, "overflows by"),
    "constants overflow": ({"a.c": MUCH_CONST}, 2, "_t"),
    "handler without attribute": ({"a.c": PLAIN_HANDLER}, 2, "not an interrupt function"),
    "handler with a wrong name": ({"a.c": MISSPELT_HANDLER}, 2, "_T1Interrupt"),
    "unsupported operand": ({"a.c": STRANGE_OPERAND}, 1, "a.c:4"),
    "bitcode that is none": ({"a.bc": "nonsense"}, 2, "not readable as LLVM IR"),
    "object that is none": ({"a.o": "nonsense"}, 2, "a.o"),
}


@pytest.mark.parametrize(("files", "status", "message"), BAD_PROGRAMS.values(), ids=BAD_PROGRAMS.keys())
def test_bad_programs_leave_a_message_and_no_output(
    files: dict[str, str], status: int, message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Bad programs end with status 1 for C errors, otherwise 2, without output file or traceback."""
    paths = [write(tmp_path, name, text) for name, text in files.items()]
    before = sorted(os.listdir(tmp_path))
    got, said = cc(capsys, "-Os", *paths, "-o", tmp_path / "x.elf")
    assert got == status, said
    assert message in said
    assert "Traceback" not in said
    assert sorted(os.listdir(tmp_path)) == before


def test_errors_of_all_files_are_reported(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The parallel front end compiles every file and reports all errors in command line order."""
    paths = [write(tmp_path, f"{n}.c", f"int f{n} = x{n};\n") for n in range(4)]
    status, said = cc(capsys, "-j", 2, *paths, "-o", tmp_path / "x.elf")
    assert status == 1
    places = [said.index(f"x{n}'") for n in range(4)]
    assert places == sorted(places)


def test_options_reach_their_stage() -> None:
    """Options reach the front end, the back end or the linker."""
    words = ["-O2", "-DX=1", "-I", "inc", "-Wall", "-Wl,--heap=64,--gc-sections", "-fstack-check", "-g"]
    options = parse([*words, "-x", "c", __file__])
    assert options.level == "2"
    assert options.clang == ["-DX=1", "-I", "inc", "-Wall"]
    assert options.linker == ["--heap=64", "--gc-sections"]
    assert options.stack_check
    assert options.debug


def test_response_files_nest(tmp_path: Path) -> None:
    """Response files @file may be nested and quoted; endless nesting is refused."""
    write(tmp_path, "a.c", "")
    inner = write(tmp_path, "inner", f"-DNAME='a b' {tmp_path / 'a.c'}")
    outer = write(tmp_path, "outer", f"-O1 @{inner}")
    options = parse([f"@{outer}"])
    assert options.clang == ["-DNAME=a b"]
    assert options.level == "1"
    inner.write_text(f"@{outer}")
    with pytest.raises(ToolError, match="nest too deeply"):
        parse([f"@{outer}"])


def test_help_shows_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    """--help contains an example."""
    assert driver.main(["--help"]) == 0
    assert "example: python -m toolchain cc" in capsys.readouterr().out


def test_usage_errors_import_neither_llvmlite_nor_the_back_end() -> None:
    """A usage error imports neither llvmlite nor the back end, which keeps messages fast."""
    code = (
        "import sys\nfrom toolchain.cli import main\nmain(['cc', '--nonsense'])\n"
        "print([name for name in sys.modules if 'llvmlite' in name])"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


def test_archives_and_preprocessed_assembly(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """-L and -l link archive members by symbol; .S files are preprocessed with the device header."""
    from toolchain.elf.archive import ArchiveMember, archive_bytes

    f = write(tmp_path, "f.c", "int f(int x) { return x + 2; }\n")
    g = write(tmp_path, "g.S", "#include <dspic30f6014a.h>\n#define V 40\n\t.section .text,code\n\t.global _g\n"
              "_g: mov #V,w0\n\tbset _LATB,#3\n\treturn\n")  # fmt: skip
    for source in (f, g):
        assert cc(capsys, "-Os", "-c", source, "-o", source.with_suffix(".o")) == (0, "")
    members = [ArchiveMember(name, (tmp_path / name).read_bytes()) for name in ("f.o", "g.o")]
    (tmp_path / "libfg.a").write_bytes(archive_bytes(members))
    main = write(tmp_path, "m.c", "int f(int), g(void); int main(void) { return f(g()); }\n")
    assert cc(capsys, "-Os", main, f"-L{tmp_path}", "-lfg", "-lm", "-o", tmp_path / "x.elf") == (0, "")
    assert run(tmp_path / "x.elf", engine="auto").status == 42


def test_linker_options_pass_through(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """-Wl,--heap provides memory for malloc, and the map lists the library's members."""
    source = write(tmp_path, "a.c", "#include <stdlib.h>\nint main(void) { char *p = malloc(100), *q = malloc(100); "
                   "free(p); return p && q && malloc(90) == p ? 0 : 1; }\n")  # fmt: skip
    words = [
        "-Os", "-fno-builtin", source, "-Wl,--heap=300", f"-Wl,-Map={tmp_path / 'x.map'}", "-o", tmp_path / "x.elf",
    ]  # fmt: skip
    assert cc(capsys, *words) == (0, "")
    assert run(tmp_path / "x.elf", engine="auto").status == 0
    assert "heap.o" in (tmp_path / "x.map").read_text()
    status, said = cc(capsys, "-Os", "-fno-builtin", source, "-o", tmp_path / "y.elf")
    assert (status, said.split(" (")[0]) == (0, "warning: malloc always fails, because there is no heap")
    assert run(tmp_path / "y.elf", engine="auto").status == 1
