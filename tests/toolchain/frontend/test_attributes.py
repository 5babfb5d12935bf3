"""XC16's attributes: both spellings, lists of any length, constant expressions, all places of a declaration."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run
from toolchain.frontend import attributes

PROGRAM = r"""
#include <xc.h>
#define BASE 0x1000
#define LIST unused, used, aligned(2), weak, noclone, noinline
enum { OFF = 0x20 };
volatile int n;
int __attribute__((address(BASE+0x10))) a;
int __attribute((address(BASE))) b; int c __attribute__((__address__(0x1040)));
static volatile int d __attribute__((address(BASE+OFF))) = 5, d2 = 6;
int __attribute((address(0x1900))) z; int __attribute((space(ymemory))) y; const int __attribute((space(eedata))) e=5;
int __attribute__((unused, used, aligned(2), weak, noclone, noinline, address(0x1902), persistent)) z2;
int z3 __attribute__((LIST, address(sizeof(long) * 0x400 + 0x600)));
unsigned char area[384] __attribute__((space(prog), section(".boot"), noload, address(0x15800 - 0x800)));
void __attribute__((used, unused, weak, cold, noinline, noclone, interrupt, no_auto_psv))
_T1Interrupt(void)
{ IFS0bits.T1IF = 0; n++; }
void __attribute((__interrupt__(__save__(d2), __preprologue__("nop")), __auto_psv__))
_T2Interrupt(void)
{ IFS0bits.T2IF = 0; d2 = 1; }
void _ISR _T3Interrupt(void);
void _T3Interrupt(void) { IFS0bits.T3IF = 0; }
void _AltINT0Interrupt(void) __attribute__((interrupt, shadow, no_auto_psv));
void _AltINT0Interrupt(void) { n++; }
extern volatile unsigned int MYREG __attribute__((__sfr__(0x2D6)));
extern volatile unsigned int LATD __attribute__((__sfr__));
__attribute__((far)) char farbuf[20];
char nearbuf[300] __attribute((near));
uint16_t m = _T1CON_TCS_MASK, p = _T1CON_TCKPS_POSITION, l = _T1CON_TCKPS_LENGTH;
struct __attribute__((packed)) { char x; int y; } s;
const char *text = "__attribute__((space(nonsense)))";
int main(void){
  PR1=100; IPC0bits.T1IP=4; IEC0bits.T1IE=1; T1CON=0x8000; while(n<5) ;
  T1CON = 0;
  if ((unsigned)&a != 0x1010 || (unsigned)&b != 0x1000 || (unsigned)&c != 0x1040 || (unsigned)&d != 0x1020) return 1;
  if ((unsigned)&z != 0x1900 || (unsigned)&y < 0x1800 || (unsigned)&z2 != 0x1902 || (unsigned)&z3 != 0x1600) return 2;
  if (__builtin_tblpage(area) != 1 || __builtin_tbloffset(area) != 0x5000) return 3;
  if (__builtin_tbladdress(area) != 0x15000) return 3;
  MYREG = 0x55; if (LATD != 0x55) return 4;
  if (sizeof s != 3 || d != 5) return 5;
  if (m != 2 || p != 4 || l != 2) return 6;
  if ((unsigned)nearbuf >= 0x2000) return 7;
  return 0; }
"""


NAKED = """
#include <xc.h>
int x, y;
void __attribute__((naked)) only_assembly(void) { asm("mov #3,w0"); asm("mov w0,_x"); asm("return"); }
void __attribute((__naked__, unused)) with_statements(void) { asm("mov #4,w0"); y = x + 4; LATB |= 5; asm("return"); }
int main(void)
{
    unsigned top = WREG15;
    only_assembly();
    with_statements();
    return x == 3 && y == 7 && (LATB & 5) == 5 && WREG15 == top ? 0 : 1;
}
"""


@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_naked_functions_have_no_frame(level: str, tmp_path: Path) -> None:
    """A naked function, with or without C statements, returns by its own `return`: nothing is on the stack."""
    (tmp_path / "a.c").write_text(NAKED)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", level, "-Wall", "-fstack-check")
    assert (built.status, built.messages) == (0, "")
    assert run(tmp_path / "a.elf").status == 0


def test_naked_function_that_needs_a_frame_is_an_error(tmp_path: Path) -> None:
    """C statements of a naked function that need the stack are refused with function and cure."""
    (tmp_path / "a.c").write_text(
        'void g(int *);\nvoid __attribute__((naked)) f(void) { int a; g(&a); asm("return"); }\n'
    )
    built = build([tmp_path / "a.c"], tmp_path / "a.o", "-c")
    assert built.status == 2
    assert "a stack frame in the naked function f" in built.first_error
    assert "a.c:2" in built.first_error


MIXED = """
int y;
int __attribute__((naked)) next(int a) { asm("add w0,#1,w0"); asm volatile("return"); }
void __attribute__((naked)) with_statements(void) { y = y + 4; asm("return"); }
int main(void) { with_statements(); return next(3) == 4 && y == 4 ? 0 : 1; }
"""


def test_naked_functions_of_assembly_keep_parameter_and_result(tmp_path: Path) -> None:
    """A naked function of assembly only is unchanged by a naked function with C statements in the same file."""
    (tmp_path / "a.c").write_text(MIXED)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-Wall")
    assert (built.status, built.messages) == (0, "")
    assert run(tmp_path / "a.elf").status == 0


@pytest.mark.parametrize("body", ['y = a + 4; asm("mov #1,w0\\n return");', 'y = 4; asm("return"); return 0;'])
def test_operands_that_only_assembly_of_a_naked_function_uses_are_an_error(body: str, tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text(f"int y;\nint __attribute__((naked)) f(int a) {{ {body} }}\n")
    built = build([tmp_path / "a.c"], tmp_path / "a.o", "-c", "-Os")
    assert built.status == 2
    assert "a result or parameter of the naked function f that only assembly uses" in built.messages


@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_program_with_all_attributes(level: str, tmp_path: Path) -> None:
    """The program returns 0, otherwise the number of its first failing check; a copy in a header works, too."""
    (tmp_path / "a.c").write_text(PROGRAM)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", level, "-w", "-fverify-machine")
    assert (built.status, built.messages) == (0, "")
    assert run(tmp_path / "a.elf").status == 0


def test_attributes_that_only_a_header_contains(tmp_path: Path) -> None:
    """A source whose attributes come from a header and a macro is compiled with them, also under -w."""
    (tmp_path / "a.h").write_text(
        "#define PLACE(n) __attribute((address(n)))\n#define HANDLER __attribute__((interrupt))\n"
    )
    source = '#include "a.h"\nint PLACE(0x1234) x;\nvoid HANDLER _T1Interrupt(void) {}\n'
    (tmp_path / "a.c").write_text(source + "int main(void) { return (unsigned)&x == 0x1234; }\n")
    for words in ((), ("-w",)):
        built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", *words)
        assert (built.status, built.messages) == (0, "")
        assert run(tmp_path / "a.elf").status == 1


REFUSED = {
    "int x __attribute__((space(pmp)));": "attribute space(pmp) is not supported",
    "int __attribute((__boot__)) x;": "attribute boot is not supported",
    "int x __attribute__((address(1, 2)));": "attribute address with 2 arguments is not supported",
    "int y; int x __attribute__((address(y)));": "annotate",
    "void __attribute__((interrupt(vector(5)))) _T1Interrupt(void) {}": "argument vector of attribute interrupt",
    "int x __attribute__((fillupper(3)));": "attribute fillupper is not supported",
}


@pytest.mark.parametrize("source", REFUSED)
def test_refused_attribute_is_an_error_with_its_line(source: str, tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text(f"\n{source}\nint main(void) {{ return 0; }}\n")
    built = build([tmp_path / "a.c"], tmp_path / "a.elf")
    assert built.status == 1
    assert "a.c:2:" in built.first_error
    assert REFUSED[source] in built.first_error


def test_lines_after_a_list_over_several_lines_keep_their_numbers() -> None:
    text = 'int x __attribute__ ((\n  far,\n  aligned(4)))\n = "__attribute__((near))";\nint y;\n'
    changed = attributes.rewrite(text)
    assert changed.split("\n").index("int y;") == text.split("\n").index("int y;")
    assert '"__attribute__((near))"' in changed
    assert "aligned(4)" in changed


def test_common_c_interface(tmp_path: Path) -> None:
    """-ext=cci: the keywords of the Common C Interface, which XC16's user's guide describes."""
    (tmp_path / "a.c").write_text(
        "#include <xc.h>\nint __at(0x1500) x; __near char y[100]; __persistent int z;\n"
        "void __interrupt(no_auto_psv) _T1Interrupt(void) { IFS0bits.T1IF = 0; }\n"
        "int main(void) { return (unsigned)&x == 0x1500 && z + 1 != z; }\n"
    )
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-ext=cci")
    assert (built.status, built.messages) == (0, "")
    assert run(tmp_path / "a.elf").status == 1
