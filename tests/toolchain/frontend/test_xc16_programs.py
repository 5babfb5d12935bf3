"""Programs and command lines written for XC16 compile unchanged and have the same meaning."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

import emu
from emu.chips import NAMES as CHIPS
from tests.toolchain.c_programs import run
from toolchain.driver import driver

LEVELS = ("-O0", "-O1", "-O2", "-Os")


def status_of(folder: Path, source: str, *options: str) -> int:
    """Return the exit status of a program on the emulator; assert that compiling prints nothing."""
    (folder / "main.c").write_text(source)
    image = folder / "main.elf"
    assert driver.main([*options, str(folder / "main.c"), "-o", str(image)]) == 0
    return run(image, engine="auto").status


def refusal(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert driver.main([str(word) for word in words]) == 2
    return capsys.readouterr().err


@pytest.mark.parametrize("level", LEVELS)
def test_plain_inline_defines_the_function(level: str, tmp_path: Path) -> None:
    """Plain `inline` also defines the function (gnu89, XC16's default); in C99 another file would have to define it."""
    source = """
    inline int two(int x) { return x + 2; }
    int (*volatile f)(int) = two;
    int main(void) { return two(1) + f(2); }
    """
    assert status_of(tmp_path, source, level) == 7


@pytest.mark.parametrize("level", LEVELS)
def test_operands_with_register_and_memory_constraints_are_registers(level: str, tmp_path: Path) -> None:
    """Operands with the constraints "rm" and "g" are registers.

    GCC's reload prefers registers, and most instructions of this CPU require them.
    """
    source = """
    volatile unsigned kept; unsigned char small;
    int main(void)
    {
        unsigned from = 5, to;
        __asm__ volatile("mov %1,%0" : "=rm"(to) : "g"(from));
        if (to != 5) return 1;
        __asm__ volatile("inc %0,%0" : "+rm"(to));
        if (to != 6) return 2;
        __asm__ volatile("inc %0,%0" : "+g"(kept));
        if (kept != 1) return 3;
        __asm__ volatile("mov.b %1,%0" : "=rm"(small) : "rm"((unsigned char)9));
        return small == 9 ? 0 : 4;
    }
    """
    assert status_of(tmp_path, source, level) == 0


def test_accumulators_have_names_in_assembly(tmp_path: Path) -> None:
    """Accumulators have names in assembly: 0x22 and 0x28 are the lowest of three registers each."""
    source = """
    int main(void)
    {
        unsigned a, b;
        __asm__("mov #ACCA,%0" : "=r"(a));
        __asm__("mov #_ACCB,%0" : "=r"(b));
        return a + b;
    }
    """
    assert status_of(tmp_path, source) == 0x22 + 0x28


@pytest.mark.parametrize("options", [("-ansi",), ("-std=c89",), ("-std=gnu89",), ("-std=c99",), ("-std=c11",), ()])
def test_every_header_is_accepted_in_every_dialect(options: tuple[str, ...], tmp_path: Path) -> None:
    folder = Path(driver.__file__).parents[1] / "include"
    others = tuple(part for other in CHIPS[1:] for part in (other.lower(), f"p{other[5:]}"))
    names = sorted(h.name for h in folder.glob("*.h") if h.stem not in others)
    source = "".join(f"#include <{name}>\n" for name in names) + "int main(void) { return 3; }\n"
    assert status_of(tmp_path, source, "-Wall", "-Werror", *options) == 3


def test_header_names_are_not_case_sensitive(tmp_path: Path) -> None:
    """Header names are case-insensitive beside the source, in an -I folder, and for the device header."""
    (tmp_path / "Library").mkdir()
    (tmp_path / "Library" / "e_motors.h").write_text("#define ONE 1\n")
    (tmp_path / "Own.h").write_text("#define TWO 2\n")
    headers = '#include "library/E_Motors.h"\n#include "own.h"\n#include <P30F6014A.H>\n'
    source = headers + "int main(void) { return ONE + TWO; }\n"
    assert status_of(tmp_path, source, f"-I{tmp_path}") == 3


def test_a_header_that_is_nowhere_stays_an_error(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "main.c").write_text('#include "nowhere.h"\n')
    assert driver.main(["-c", str(tmp_path / "main.c"), "-o", str(tmp_path / "main.o")]) == 1
    assert "main.c:1:10: fatal error: 'nowhere.h' file not found" in capfd.readouterr().err


def test_the_command_lines_of_mplab_x(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "main.c").write_text("int main(void) { return 0; }\n")
    compile_words = ["-c", "-mcpu=30F6014A", "-MP", "-MMD", "-MF", str(tmp_path / "main.d"), "-g", "-omf=elf"]
    compile_words += ["-DXPRJ_default=default", "-legacy-libc", "-O0", "-msmart-io=1", "-Wall", "-msfr-warn=off"]
    compile_words += ["-merrata=psv_trap"]
    assert driver.main([*compile_words, str(tmp_path / "main.c"), "-o", str(tmp_path / "main.o")]) == 0
    linker = (
        "--local-stack,--defsym=__MPLAB_BUILD=1,--script=p30F6014A.gld,--stack=16,--check-sections,--data-init,"
        "--pack-data,--handles,--isr,--no-gc-sections,--fill-upper=0,--stackguard=16,--no-force-link,--smart-io,"
        f"-Map={tmp_path / 'x.map'},--report-mem,--memorysummary,{tmp_path / 'memory.xml'}"
    )
    words = ["-o", str(tmp_path / "x.elf"), str(tmp_path / "main.o"), "-mcpu=30F6014A", "-omf=elf", f"-Wl,{linker}"]
    assert driver.main([*words, "-Wl,-T,p30f6014A.gld", "-T", "p30F6014A.gld"]) == 0
    assert "of 147456 bytes" in capsys.readouterr().out
    memories = {m.get("name"): m for m in ElementTree.parse(tmp_path / "memory.xml").iter("memory")}
    for memory, length in (("program", 147456), ("data", 8192)):
        used, free = (int(memories[memory].findtext(tag, "")) for tag in ("used", "free"))
        assert used + free == length


def test_what_means_nothing_here_is_refused_with_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main = tmp_path / "main.c"
    main.write_text("int main(void) { return 0; }\n")
    assert "there is no COFF output" in refusal(capsys, "-omf=coff", main)
    assert "linker script 'boot.gld' is not used here" in refusal(capsys, "-Wl,--script=boot.gld", main)
    assert "linker option: unrecognized arguments: --nonsense" in refusal(capsys, "-Wl,--nonsense", main)


@pytest.mark.parametrize("options", [(), ("-mlarge-data",)])
@pytest.mark.parametrize("level", LEVELS)
def test_variables_beyond_near_memory(level: str, options: tuple[str, ...], tmp_path: Path) -> None:
    """Variables beyond near memory are accessed correctly.

    A fixed address determines the access; with -mlarge-data all other variables are far, too.
    """
    source = """
    int big __attribute__((address(0x2100))) = 3;
    unsigned char small __attribute__((address(0x2200)));
    int other, close __attribute__((near));
    int main(void) { big++; small |= 4; other += big; close++; return big + small + other + close; }
    """
    assert status_of(tmp_path, source, level, *options) == 13


def test_priorities_by_microchip_s_macros(tmp_path: Path) -> None:
    source = """
    #include <xc.h>
    _FOSC(CSW_FSCM_OFF & XT_PLL8)
    _FWDT(WDT_OFF);
    int main(void)
    {
        int saved;
        SET_CPU_IPL(3);
        SET_AND_SAVE_CPU_IPL(saved, 5);
        int now = __builtin_get_isr_state();
        RESTORE_CPU_IPL(saved);
        return saved * 100 + now * 10 + __builtin_get_isr_state();
    }
    """
    assert status_of(tmp_path, source, "-Os") == 353


def test_bits_found_by_one_instruction(tmp_path: Path) -> None:
    source = """
    volatile unsigned word = 0x1000, mask = 0xFFF0;
    int main(void) { return __builtin_ff1l(word) * 100 + __builtin_ff1r(word) + __builtin_fbcl(mask) + 11; }
    """
    assert status_of(tmp_path, source, "-Os") == 413


NAMES = ["__printf_cdnopuxX", "__dprintf_cdnopuxX", "__dprintf_acdeEfFgGnopsuxX", "__dprintf_0"]


@pytest.mark.parametrize("name", NAMES)
def test_names_of_smart_io_link(name: str, tmp_path: Path) -> None:
    """The names by which XC16's objects call variants of printf link (abi-elf.md §2.8)."""
    (tmp_path / "call.s").write_text(
        "\t.section .text,code\n\t.global _main\n_main: mov #42,w1\n\tmov w1,[w15++]\n\tmov #text,w1\n"
        f"\tmov w1,[w15++]\n\tcall {name}\n\tsub w15,#4,w15\n\tclr w0\n\treturn\n"
        '\t.section .const,psv,page\ntext: .asciz "<%d>"\n'
    )
    image = tmp_path / "main.elf"
    assert driver.main([str(tmp_path / "call.s"), "-o", str(image)]) == 0
    assert run(image, engine="auto").uart == b"<42>"


def test_a_call_with_short_doubles_does_not_link(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "call.s").write_text("\t.section .text,code\n\t.global _main\n_main: call __sprintf_fF\n\treturn\n")
    said = refusal(capsys, tmp_path / "call.s", "-o", tmp_path / "x.elf")
    assert "call.s: error: it calls sprintf with 32-bit doubles (__sprintf_fF)" in said


def test_calendar_time_agrees_with_the_host(tmp_path: Path) -> None:
    import time

    moments = [0, -1, 951782400, 1795346127, -(2**31) + 1, 2**31 - 1]
    expected = "".join(time.asctime(time.gmtime(moment)) + "\\n" for moment in moments)
    source = f"""
    #include <string.h>
    #include <time.h>
    static const time_t moments[] = {{ {", ".join(f"{m}L" for m in moments)} }};
    int main(void)
    {{
        static char all[200];
        for (unsigned k = 0; k < {len(moments)}; k++) {{
            struct tm calendar = *gmtime(&moments[k]);
            if (mktime(&calendar) != moments[k]) return 1;
            strcat(all, asctime(&calendar));
        }}
        return strcmp(all, "{expected}") ? 2 : time(NULL) == -1 ? 7 : 3;
    }}
    """
    assert status_of(tmp_path, source, "-Os") == 7


HANDLERS = """
#include <xc.h>
int saved = 7, entered, kept = 5;
volatile int seen, count;
#define BEFORE preprologue("mov w0,_seen; inc _entered")
void __attribute__((interrupt(irq(3), save(saved, kept), BEFORE), no_auto_psv)) tick(void)
{
    saved = 99;
    count++;
    IFS0bits.T1IF = 0;
}
void __attribute__((__interrupt__(__save__(saved, seen), __shadow__), no_auto_psv)) _T2Interrupt(void)
{
    seen = saved = 1;
    count += 10;
    IFS0bits.T2IF = 0;
}
int main(void)
{
    __asm__ volatile("mov #0x55,w0" ::: "w0");
    IEC0bits.T1IE = IEC0bits.T2IE = 1;
    __asm__ volatile("mov #0x55,w0\\n\\tbset _IFS0,#3\\n\\tnop\\n\\tnop\\n\\tnop\\n\\tnop" ::: "w0", "memory");
    IFS0bits.T2IF = 1;
    Nop(); Nop(); Nop(); Nop();
    return seen == 0x55 && saved == 7 && entered == 1 && kept == 5 ? count : 99;
}
"""


@pytest.mark.parametrize("level", LEVELS)
def test_arguments_of_the_interrupt_attribute(level: str, tmp_path: Path) -> None:
    """Arguments of the interrupt attribute: irq(N) binds a handler of any name, save() saves variables, preprologue()
    runs code.

    Variables that only these arguments name are linked.
    """
    assert status_of(tmp_path, HANDLERS, level) == 11


def test_an_interrupt_number_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "main.c").write_text(
        "void __attribute__((interrupt(irq(99)))) f(void) {}\nint main(void) { return 0; }\n"
    )
    said = refusal(capsys, tmp_path / "main.c", "-o", tmp_path / "x.elf")
    assert "interrupt function 'f': irq(99) is not an interrupt number of this chip (expected 0 to 53)" in said


@pytest.mark.parametrize("alone", ["", "-fno-lto"], ids=["whole program", "file by file"])
@pytest.mark.parametrize("level", LEVELS)
def test_persistent_and_noload_variables_have_no_known_initial_value(level: str, alone: str, tmp_path: Path) -> None:
    """`persistent` and `noload` variables start with the RAM's content, even if all stores have the same value."""
    (tmp_path / "main.c").write_text("""
    static int __attribute__((persistent)) magic, boots;
    static unsigned __attribute__((noload)) kept;
    static int __attribute__((section(".mine,persist"))) mine;
    void __attribute__((user_init)) early(void) { boots = boots + 1; }
    int main(void)
    {
        int seen = boots + (magic == 0x1234) * 16 + (kept == 0x4321) * 32 + (mine == 0x5678) * 64;
        magic = 0x1234;
        kept = 0x4321;
        mine = 0x5678;
        return seen;
    }
    """)
    image = tmp_path / "main.elf"
    assert driver.main([level, *alone.split(), str(tmp_path / "main.c"), "-o", str(image)]) == 0
    machine = emu.load(image, engine="auto")
    for values, seen in (((0x0101, 3, 0x0101, 0x0101), 4), ((0x1234, 7, 0x4321, 0x5678), 8 + 16 + 32 + 64)):
        machine.reset()
        for name, value in zip(("_magic", "_boots", "_kept", "_mine"), values, strict=True):
            machine.poke(name, value)
        assert machine.run(cycles=5000).reason == "halt"
        assert machine.w[0] == seen


@pytest.mark.parametrize("level", LEVELS)
def test_attributes_of_place_stand_on_variables_constants_and_functions_of_one_file(level: str, tmp_path: Path) -> None:
    """Placement attributes may be used for variables, constants and functions of one file.

    Clang implements them as sections, and a section contains one kind of definition only.
    """
    source = """
    extern int __attribute__((far)) one;
    int __attribute__((far)) one = 1;
    const int __attribute__((far)) two = 2;
    int __attribute__((far, noinline)) three(int x) { return x + 3; }
    int __attribute__((near)) four = 4;
    const int __attribute__((near)) five = 5;
    int __attribute__((near, noinline)) six(int x) { return x + 6; }
    int __attribute__((__space__(__xmemory__))) seven[2] = {7, 7};
    const int __attribute__((space(xmemory))) eight[2] = {8, 8};
    int __attribute__((space(ymemory))) nine[2] = {9, 9};
    const int __attribute__((space(ymemory))) ten[2] = {10, 10};
    int __attribute__((section(".eleven,bss,near"), unordered)) eleven;
    int main(void)
    {
        eleven = 11;
        return six(three(one + two)) + four + five + seven[0] + eight[1] + nine[0] + ten[1] + eleven;
    }
    """
    assert status_of(tmp_path, source, level) == 66


OLD_C = """
typedef void (*handler)(void);
static handler called;
static int count;
int counted(void) { count = count + 1; return count; }
remember(what) handler what; { called = what; }
float nothing(int wanted) { if (wanted) return; return 1.5f; }
main()
{
    char *place = 0x1F00; int number = place; unsigned *words = place;
    remember(counted);
    called();
    nothing(1);
    *words = number;
    return count + (*(unsigned *)0x1F00 == 0x1F00) * 2 + later(3, 4);
}
int later(int a, int b) { return a * b; }
"""


@pytest.mark.parametrize("options", [(), ("-std=gnu89",), ("-ansi",), ("-std=c99",), ("-std=gnu99",)])
def test_errors_of_clang_that_gcc_4_warns_of_are_warnings(
    options: tuple[str, ...], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Undeclared functions, `main()` and incompatible pointers cause warnings, as in GCC 4, instead of clang's
    errors."""
    assert status_of(tmp_path, OLD_C, *options) == 15
    assert "warning: incompatible function pointer types passing" in capfd.readouterr().err
    assert driver.main(["-Werror", *options, str(tmp_path / "main.c"), "-o", str(tmp_path / "not.elf")]) == 1
    assert "error: incompatible function pointer types passing" in capfd.readouterr().err


@pytest.mark.parametrize("level", LEVELS)
def test_section_macros_of_the_device_header(level: str, tmp_path: Path) -> None:
    """Section macros of the device header such as `_XBSS(64)`, used for DSP buffers, work."""
    source = """
    #include <p30F6014A.h>
    _FBS(0xFFFF) _FSS(0xFFFE);
    int _YBSS(16) ybss[8]; int _YDATA(8) ydata[4] = {4}; int _XBSS(64) xbss[32]; int _XDATA(32) xdata[16] = {1, 2, 3};
    int _PERSISTENT kept; int _NEAR nearby = 7; int _EEDATA(2) eedata[4] = {0x1234, 5};
    static int _EEDATA(32) row[16] = {1};
    int main(void)
    {
        if ((unsigned)ybss % 16 || (unsigned)ydata % 8 || (unsigned)xbss % 64 || (unsigned)xdata % 32) return 1;
        if ((unsigned)ybss < 0x1800 || (unsigned)ydata < 0x1800 || (unsigned)xbss >= 0x1800) return 2;
        if ((unsigned)xdata >= 0x1800 || xdata[1] != 2 || ydata[0] != 4 || nearby != 7) return 3;
        TBLPAG = __builtin_tblpage(eedata);
        if (__builtin_tblrdl(__builtin_tbloffset(eedata)) != 0x1234) return 4;
        return kept = __builtin_tbloffset(row) % 32;
    }
    """
    assert status_of(tmp_path, source, level) == 0
