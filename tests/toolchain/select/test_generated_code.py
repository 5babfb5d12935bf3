"""Generated code: size limits, idioms and loops."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.compiler.codegen import GOAL_TOTAL, XC16_OS_WORDS, sizes
from tests.toolchain.compiled import assembly, body, words

SAMPLES = """
int sat(int a,int lo,int hi){ return a<lo?lo:a>hi?hi:a; }
unsigned crc16(const unsigned char*p,int n){ unsigned c=0xFFFF;int k; while(n--){ c^=*p++;
  for(k=0;k<8;k++) c=(c&1)?(c>>1)^0xA001:c>>1; } return c; }
long dot(const int*a,const int*b,int n){ long s=0; while(n--) s+=(long)*a++ * *b++; return s; }
struct node{struct node*next;int key;char tag;};
struct node*find(struct node*l,int key){ for(;l;l=l->next) if(l->key==key&&l->tag=='x') return l; return 0; }
int itoa10(unsigned v,char*out){ char t[6];int n=0,m=0; do{ t[n++]='0'+v%10; v/=10; }while(v);
  while(n) out[m++]=t[--n]; out[m]=0; return m; }
"""
XC16_WORDS = {"sat": 8, "crc16": 19, "dot": 12, "find": 12, "itoa10": 25}  # abi-elf.md §8.2, -Os
PRIMITIVES = """
long add32(long a,long b){return a+b;} long neg32(long a){return -a;} long shl1(long a){return a<<1;}
int lt32(long a,long b){return a<b;} int eq32(long a,long b){return a==b;} long shlv(long a,int n){return a<<n;}
int mul16(int a,int b){return a*b;} long muls(int a,int b){return (long)a*b;} int div16(int a,int b){return a/b;}
int mod16(int a,int b){return a%b;} unsigned divu10(unsigned a){return a/10;} long div32(long a,long b){return a/b;}
long shl4(long a){return a<<4;} long shr8(long a){return a>>8;}
"""
XC16_PRIMITIVES = {"add32": 3, "neg32": 3, "shl1": 3, "lt32": 8, "eq32": 8, "shlv": 6, "mul16": 2, "muls": 2,
                   "div16": 4,
                   "mod16": 5, "divu10": 4, "div32": 2, "shl4": 6, "shr8": 5}  # fmt: skip


def test_the_five_sample_functions_are_no_larger_than_xc16s() -> None:
    """Five sample functions are in total no larger than XC16's at -Os, and none is above 1.25 times XC16's (§8.2).

    Source: abi-elf.md.
    """
    text = assembly(SAMPLES)
    ours = {name: words(text, name) for name in XC16_WORDS}
    assert sum(ours.values()) <= sum(XC16_WORDS.values()), ours
    assert all(ours[n] <= 1.25 * XC16_WORDS[n] for n in ours), ours


def test_primitive_functions_are_no_larger_than_xc16s() -> None:
    """Primitive functions are no larger than XC16's (abi-elf.md §8.2, second table)."""
    text = assembly(PRIMITIVES)
    ours = {name: words(text, name) for name in XC16_PRIMITIVES}
    assert {n: w for n, w in ours.items() if w > XC16_PRIMITIVES[n]} == {}


def test_the_public_set_is_small_at_os(tmp_path: Path) -> None:
    """The functions of bench.compiler.codegen meet the total size goal; none is larger than XC16's or than at -O1."""
    small, fast = sizes("-Os", tmp_path), sizes("-O1", tmp_path)
    assert sum(small[n] for n in XC16_OS_WORDS) <= GOAL_TOTAL * sum(XC16_OS_WORDS.values())
    assert [n for n, most in XC16_OS_WORDS.items() if small[n] > most] == []
    assert [n for n in small if small[n] > fast[n]] == []


IDIOMS = [
    ("one SFR bit is set atomically", "void f(void){ P |= 4; }", ["bset _P,#2", "return"]),
    ("one SFR bit is cleared atomically", "void f(void){ P &= ~0x8000; }", ["bclr _P,#15", "return"]),
    ("a near counter is incremented in place", "void f(void){ N++; }", ["inc _N", "return"]),
    ("a wide near counter carries through memory", "void f(void){ T++; }", ["inc _T", "clr w0", "addc _T+2", "return"]),
    ("a widening product is one MUL", "long f(int a,int b){ return (long)a*b; }", ["mul.ss w1,w0,w0", "return"]),
    ("a tail call is a branch", "int g(int); int f(int a){ return g(a+1); }", ["inc w0,w0", "bra _g"]),
    (
        "a long times a signed word is two MUL",
        "long f(long a,int b){ return a*b; }",
        ["mul.ss w1,w2,w6", "mul.us w0,w2,w0", "add w1,w6,w1", "return"],
    ),
    (
        "the last comparison of a value may overwrite it",
        "void f(int a){ if (a > 300) P = 1; }",
        ["sub #300,w0", "bra le,.L1_2", "mov #1,w7", "mov w7,_P", "return"],
    ),
    (
        "an index of two arrays is scaled once",
        "int g(int,int); int f(int *a,int *b,int i){ return g(a[i], b[i]); }",
        ["sl w2,w7", "mov [w0+w7],w0", "mov [w1+w7],w1", "bra _g"],
    ),
    (
        "only the low word of a long shifted left by a variable is computed if the other is not read",
        "unsigned f(unsigned long a, unsigned n){ return (unsigned)(a << n); }",
        ["sl w0,w2,w0", "return"],
    ),
    (
        "division of an int by two is a shift",
        "int f(int a){ return a / 2; }",
        ["lsr w0,#15,w7", "add w0,w7,w7", "asr w7,w0", "return"],
    ),
    (
        "DIV provides the remainder of a division by a power of two",
        "int f(int a, int *r){ *r = a % 8; return a / 8; }",
        ["mov w1,w7", "mov #8,w6", "repeat #17", "div.s w0,w6", "mov w1,[w7]", "return"],
    ),
    ("a zero store is CLR", "void f(int *p){ *p = 0; }", ["clr [w0]", "return"]),
]


@pytest.mark.parametrize(("name", "source", "expected"), IDIOMS, ids=[i[0] for i in IDIOMS])
def test_idiom(name: str, source: str, expected: list[str]) -> None:
    """Idioms of the source are compiled to the instructions of abi-elf.md §8.1."""
    text = assembly("extern volatile unsigned P; unsigned N; unsigned long T; " + source)
    assert body(text, "f") == expected


def test_constants_are_in_the_one_section_microchips_linker_counts() -> None:
    """Constants are in the section .const, whose size is `__const_length` (abi-elf.md §1.4)."""
    text = assembly('const int k[3] = {1, 2, 3}; const char *f(void){ return "text"; }')
    sections = [line for line in text.split("\n") if ".const" in line]
    assert sections
    assert {line.strip() for line in sections} == {".section .const,psv,page"}


def test_quotient_and_remainder_share_one_division() -> None:
    """Quotient and remainder share one DIV, which leaves them in W0 and W1 (isa.md §6.7)."""
    text = assembly("unsigned f(unsigned a,unsigned b,unsigned*r){ *r=a%b; return a/b; }")
    assert sum(line.startswith("div.u") for line in body(text, "f")) == 1


def test_dense_switches_use_a_branch_table() -> None:
    """Dense switches use a branch table: BRA Wn, one word per value (abi-elf.md §8.1)."""
    cases = "".join(f"case {k}: g({k * k}, {k} + h()); break;" for k in range(12))
    lines = body(assembly(f"void g(int,int); int h(void); void f(int x){{ switch(x){{ {cases} }} }}"), "f")
    at = lines.index("bra w0")
    assert all(line.startswith("bra .L") for line in lines[at + 1 : at + 13])


def test_block_copies_repeat_a_move() -> None:
    """Block copies are a repeated move: REPEAT #n-1; MOV [Ws++],[Wd++] (isa.md §15)."""
    lines = body(assembly("struct s{int a[9];}; void f(struct s*a,struct s*b){ *a=*b; }"), "f")
    assert lines == ["repeat #8", "mov [w1++],[w0++]", "return"]


def test_the_compiler_never_emits_do() -> None:
    """The compiler never emits DO, so that the kernel need not save the DO registers (abi-elf.md §2.1)."""
    assert not any(line.startswith("do ") for line in assembly(SAMPLES, "2").replace("\t", "").split("\n"))


def test_volatile_accesses_are_neither_merged_nor_dropped() -> None:
    """Volatile accesses are neither merged nor removed (C11 5.1.2.3p6)."""
    lines = body(assembly("extern volatile unsigned P; void f(void){ P; P; P=1; P=1; }"), "f")
    assert sum("_P" in line for line in lines) == 4


def test_a_minimal_interrupt_function_saves_nothing() -> None:
    """A minimal interrupt function has 2 words and saves no registers (abi-elf.md §2.5)."""
    source = "#include <dspic30f6014a.h>\nunsigned N; OS_ISR(_T1Interrupt) { N++; }"
    assert body(assembly(source), "_T1Interrupt") == ["inc _N", "retfie"]


def test_an_interrupt_function_with_a_call_saves_all_scratch_registers() -> None:
    """An interrupt function with a call saves all scratch registers (abi-elf.md §2.5, rules 2 and 3)."""
    source = "#include <dspic30f6014a.h>\nvoid g(void); OS_ISR(_T1Interrupt) { g(); }"
    lines = body(assembly(source), "_T1Interrupt")
    assert lines[:5] == ["push _RCOUNT", *(f"mov.d w{r},[w15++]" for r in (0, 2, 4, 6))]
    assert lines[-6:] == [*(f"mov.d [--w15],w{r}" for r in (6, 4, 2, 0)), "pop _RCOUNT", "retfie"]


def test_auto_psv_loads_the_page_before_anything_else() -> None:
    """An auto_psv function loads the page first, even if its body overwrites W0 at once (abi-elf.md §2.5, rule 6)."""
    source = "extern volatile unsigned char P; const int k = 3; volatile unsigned char Q; volatile unsigned N;"
    source += '__attribute__((annotate("os_isr:auto_psv"))) void _T2Interrupt(void) { Q = P; N = *(volatile int *)&k; }'
    lines = body(assembly(source), "_T2Interrupt")
    at = lines.index("push _PSVPAG")
    assert lines[at + 1 : at + 3] == ["mov #__const_psvpage,w0", "mov w0,_PSVPAG"]
    assert "pop _PSVPAG" in lines
    assert lines[-1] == "retfie"


def test_stack_check_probes_only_frames_above_eight_bytes() -> None:
    """The stack check only probes frames above eight bytes (kernel.md §4).

    Reading through W15 above SPLIM traps at entry, before W15 changes, so that the trap's frame stays inside the
    stack.
    """
    small = assembly("void g(char*); void f(void){ char b[4]; g(b); }", stack_check=True)
    large = assembly("void g(char*); void f(void){ char b[20]; g(b); }", stack_check=True)
    assert "[w15+" not in body(small, "f")[0]
    assert body(large, "f")[:5] == ["push w7", "mov [w15+20],w7", "pop w7", "nop", "add w15,#20,w15"]


def test_every_function_and_variable_has_a_section_of_its_own() -> None:
    """Every function and variable has its own section, which --gc-sections requires."""
    text = assembly("int a; int b=1; const int c=2; int f(void){return a+b;} int g(void){return c;}")
    for section in (".text._f,code", ".text._g,code", ".nbss._a,bss,near", ".ndata._b,data,near"):
        assert f"\t.section {section}\n" in text


def test_function_pointers_are_handles() -> None:
    """Function pointers are handles (abi-elf.md §1.5)."""
    text = assembly("int g(void); int (*p)(void)=g; int (*f(void))(void){ return g; }")
    assert ".word handle(_g)" in text
    assert body(text, "f") == ["mov #handle(_g),w0", "return"]


def test_a_loop_that_counts_to_n_needs_no_limit_of_its_own() -> None:
    """A loop to n needs no max(n, 0) before it, because DEC also decides `i < n` for negative n."""
    lines = body(assembly("void f(int *p, int n){ for (int i = 0; i < n; i++) p[i] = 0; }"), "f")
    assert lines[1:] == ["clr [w0++]", "dec w1,w1", lines[3], "return"]
    assert lines[3].startswith("bra ge,")


LOOPS = [
    (
        "a pointer step behind skips merges with the load before them",
        "2",
        """void f(int *a, int n, int *lo, int *hi){ int l = a[0], h = a[0];
           for (int i = 1; i < n; i++) { if (a[i] < l) l = a[i]; if (a[i] > h) h = a[i]; } *lo = l; *hi = h; }""",
        ["mov [w6++],w1", "cpsgt w1,w5", "mov w1,w5", "cpslt w1,w4", "mov w1,w4", "dec w7,w7", "bra nz"],
    ),
    (
        "DEC decides whether more than one iteration remains",
        "2",
        "void f(int *d, const int *s, int n){ while (n-- > 0) d[n] = s[n]; }",
        ["mov [--w5],w6", "mov w6,[--w7]", "dec w2,w2", "bra gtu"],
    ),
    (
        "steps move behind the last use of the old value, in any block of the loop",
        "2",
        """void f(int *a, int n){ for (int i = 1; i < n; i++) { int x = a[i], j = i - 1;
           while (j >= 0 && a[j] > x) { a[j + 1] = a[j]; j--; } a[j + 1] = x; } }""",
        ["mov [w7-2],w5", "cp w5,w6", "bra le", "mov w5,[w7--]", "dec w4,w4", "bra gt"],
    ),
    (
        "the step of the counter is the last instruction, so that its flags decide the branch",
        "2",
        """struct s { int v[10]; }; struct t { struct s s; int k; };
           void f(struct t *d, const struct t *s, int n){ for (int i = 0; i < n; i++) d[i].s = s[i].s; }""",
        ["add w1,#22,w1", "add w0,#22,w0", "dec w2,w2", "bra nz"],
    ),
    (
        "a copy of a struct advances its pointers",
        "2",
        """struct s { int v[10]; };
           void f(struct s *d, const struct s *s, int n){ for (int i = 0; i < n; i++) d[i] = s[i]; }""",
        ["repeat #9", "mov [w1++],[w0++]", "dec w2,w2", "bra nz"],
    ),
    (
        "a copy without REPEAT advances its pointers",
        "s",
        "struct s { int x, y, z; }; void f(struct s *d, const struct s *s, unsigned n){ while (n--) *d++ = *s++; }",
        [*["mov [w1++],[w0++]"] * 3, "dec w2,w2", "bra geu"],
    ),
    (
        "a fill advances its pointer",
        "2",
        "struct s { int v[10]; }; void f(struct s *d, int n){ for (int i = 0; i < n; i++) d[i] = (struct s){{0}}; }",
        ["repeat #9", "clr [w0++]"],
    ),
    (
        "pointer steps merge if nearly all registers are in use",
        "2",
        """void f(const unsigned *a, const unsigned *b, unsigned *r, int n){ for (int i = 0; i < n; i++) {
           unsigned carry = 0; for (int j = 0; j < n; j++) {
           unsigned long t = (unsigned long)a[i] * b[j] + r[i + j] + carry;
           r[i + j] = (unsigned)t; carry = (unsigned)(t >> 16); } r[i + n] = carry; } }""",
        ["mov w0,[w7++]", "dec w5,w5", "bra nz"],
    ),
]


@pytest.mark.parametrize(("name", "level", "source", "expected"), LOOPS, ids=[i[0] for i in LOOPS])
def test_inner_loop(name: str, level: str, source: str, expected: list[str]) -> None:
    """Inner loops consist of the expected instructions (branch targets are ignored)."""
    lines = [line.split(",.L")[0] for line in body(assembly(source, level), "f")]
    starts = range(len(lines) - len(expected) + 1)
    assert any(lines[k : k + len(expected)] == expected for k in starts), lines


def test_division_by_a_constant_multiplies_where_speed_counts() -> None:
    """Division by a constant multiplies if speed counts; at -Os DIV remains, with two words and 19 cycles (isa.md
    §6.7)."""
    source = "unsigned f(unsigned a){ return a / 10; } int g(int a){ return a % 7; }"
    assert "repeat" not in assembly(source, "2")
    assert "repeat" in assembly(source, "s")


def test_a_pair_is_cleared_by_one_word() -> None:
    """One word clears a register pair: MUL.UU Wb, #0 (isa.md §6.5)."""
    assert "mul.uu w0,#0,w0" in body(assembly("long g(void); long f(int a){ return a > 3 ? g() : 0; }"), "f")
