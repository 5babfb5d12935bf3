"""Table of the compiler's options: those of this driver, of gcc, of XC16's user's guide and of MPLAB X's Makefiles.

`python -m toolchain.frontend.option_table` prints docs/xc16-options.md. A spelling is a pattern: `[...]` is optional,
`<...>` is any text, and a blank separates a value that is the next argument.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

DRIVER, CLANG, IGNORED, REFUSED = "yes", "clang", "ignored", "refused"
EFFECTS = {
    DRIVER: "has the effect of XC16's option, or the one stated",
    CLANG: "passed to the front end, clang, where it has gcc's meaning",
    IGNORED: "accepted without effect for the stated reason; the program means the same",
    REFUSED: "an error with the stated sentence, because the program would mean something else",
}


@dataclass(frozen=True)
class OptionRow:
    """One option or family of options. `note` is the reason of an ignored option, or the sentence of a refusal."""

    spelling: str
    effect: str
    note: str

    @property
    def takes_next_word(self) -> bool:
        """Whether the value is always the next argument."""
        return " " in self.spelling.replace("[ ]", "")

    def example(self) -> list[str]:
        """Arguments that match the row, with the value `1`."""
        text = re.sub(r"\[([^\]]*)\]", r"\1", self.spelling.replace("[ ]", ""))
        return re.sub("<[^>]*>", "1", text).split(" ")


SECTIONS: list[tuple[str, list[tuple[str, str, str]]]] = [
    ("Device and memory", [
        ("-mcpu=<device>", DRIVER, "dsPIC30F6014A by default; `python -m toolchain cc --help` lists the devices"),
        ("-mdfp=<path>", IGNORED, "headers and memory maps of the devices are built in, so no device pack is read"),
        ("-mconst-in-code", IGNORED, "the only memory model: constants are read through the PSV window"),
        ("-mconst-in-data", REFUSED, "constants live in program memory and are read through the PSV window"),
        ("-mconst-in-auxflash", REFUSED, "this device has no auxiliary flash"),
        ("-mauxflash", REFUSED, "this device has no auxiliary flash"),
        ("-mboot[=<name>]", REFUSED, "there are no boot segments: place code with attribute address"),
        ("-mlarge-code", DRIVER, "two-word calls"), ("-msmall-code", DRIVER, "RCALL; the default"),
        ("-mlarge-data", DRIVER, "only variables with attribute near are near"),
        ("-mlarge-scalar", DRIVER, "as -mlarge-data"), ("-mlarge-aggregate", DRIVER, "as -mlarge-data"),
        ("-msmall-data", DRIVER, "the default"), ("-msmall-scalar", DRIVER, "the default"),
        ("-msmall-aggregate", DRIVER, "objects up to 64 bytes are near, as by default"),
        ("-mlarge-arrays", REFUSED, "an object has at most 32 Kbytes, more than the data memory of this family"),
        ("-mtext=<name>", REFUSED, "each function has its own section: use attribute section"),
        ("-mfillupper=<byte>", REFUSED, "give the linker's option: -Wl,--fill-upper=BYTE"),
        ("-menable-fixed[=<mode>]", REFUSED, "there are no fixed-point types: use int and __builtin_mulss"),
        ("-merrata=<list>", IGNORED, "the workarounds of other chips' errata have no use here"),
        ("-mreserve=<range>", IGNORED, "no debug executive occupies memory"),
        ("-mpa[=<n>]", IGNORED, "procedural abstraction only makes code smaller; -Os merges common endings"),
        ("-mno-pa", IGNORED, "procedural abstraction is not done"),
        ("-msmart-io[=<n>]", IGNORED, "always active: format strings decide which parts of printf are linked"),
        ("-msmart-io-format=<format>", DRIVER, "conversions of formats that are computed at run time"),
        ("-msfr-warn=<word>", IGNORED, "registers are volatile, so that no access needs a warning"),
        ("-mno-isr-warn", IGNORED, "handlers without a vector are reported when linking"),
        ("-mno-eds-warn", IGNORED, "this family has no extended data space"),
        ("-mno-file", IGNORED, "no file is needed"),
        ("-moptimize-page-setting", IGNORED, "this family has no DSRPAG register"),
        ("-mcodecov[=<word>]", REFUSED, "there is no coverage instrumentation: use `emu run --coverage`"),
        ("-mchp-stack-usage", IGNORED, "use `python -m toolchain bounds`"),
        ("-mdebugger", IGNORED, "no debug executive is linked"),
        ("-mafrlcsj", IGNORED, "MPLAB X's switch for comparing the optimisers of licences"),
        ("-mnofallback", IGNORED, "there is no licence"), ("--nofallback", IGNORED, "there is no licence"),
        ("-nofallback", IGNORED, "there is no licence"),
        ("-omf=elf", IGNORED, "the only format"), ("-omf=<format>", REFUSED,
         "there is no COFF output; Microchip's tools read our ELF (-omf=elf)"),
        ("-p<device>", DRIVER, "as -mcpu="),
    ]),
    ("Language", [
        ("-std=<name>", CLANG, "gnu17 by default, with gnu89's meaning of inline"), ("-ansi", CLANG, ""),
        ("-ffreestanding", CLANG, ""), ("-fhosted", CLANG, ""), ("-f[no-]builtin[-<name>]", CLANG, ""),
        ("-f[no-][un]signed-char", CLANG, ""), ("-f[no-]gnu89-inline", CLANG, ""), ("-fms-extensions", CLANG, ""),
        ("-fdollars-in-identifiers", CLANG, ""), ("-fpack-struct[=<n>]", CLANG, ""), ("-f[no-]short-enums", CLANG, ""),
        ("-fsigned-bitfields", IGNORED, "the default"), ("-fno-unsigned-bitfields", IGNORED, "the default"),
        ("-funsigned-bitfields", REFUSED, "plain bit-fields are signed: declare them unsigned"),
        ("-fno-signed-bitfields", REFUSED, "plain bit-fields are signed: declare them unsigned"),
        ("-fno-short-double", DRIVER, "double has 64 bits; the default"),
        ("-fshort-double", DRIVER, "double and long double have 32 bits; XC16's long double has 64"),
        ("--xc16-defaults", DRIVER, "-fshort-double; the driver's default under the name xc16-gcc"),
        ("-fsingle-precision-constant", DRIVER, "unsuffixed floating constants are float"),
        ("-fno-asm", REFUSED, "asm is always a keyword: use -std=c11 instead"),
        ("-traditional[-cpp]", REFUSED, "there is no dialect before C89"),
        ("-fwritable-strings", REFUSED, "string literals are constants in flash: use arrays"),
        ("-fvolatile[-global]", REFUSED, "declare the objects volatile"),
        ("-fvolatile-static", REFUSED, "declare the objects volatile"),
        ("-f[no-]cond-mismatch", REFUSED, "both operands of ?: need compatible types"),
        ("-ext=cci", DRIVER, "Common C Interface: defines `__CCI__`; xc.h has its keywords"),
        ("-ext=<name>", IGNORED, "the language with gcc's and XC16's extensions is the default"),
        ("-mcci", DRIVER, "as -ext=cci"),
        ("-aux-info <file>", REFUSED, "prototypes are not written to a file"),
        ("-fxc16-attributes", IGNORED, "XC16's attributes are always active"),
        ("-x[ ]<language>", DRIVER, "language of the following files"),
    ]),
    ("Warnings and messages", [
        ("-w", CLANG, ""), ("-pedantic[-errors]", CLANG, ""), ("-W[<name>]", CLANG, "unknown names are ignored"),
        ("-fmessage-length=<n>", CLANG, ""), ("-ferror-limit=<n>", CLANG, ""), ("-f[no-]color-diagnostics", CLANG, ""),
        ("-f[no-]diagnostics-color[=<when>]", CLANG, ""), ("-fno-caret-diagnostics", CLANG, ""),
        ("-Q", IGNORED, "statistics of GCC's passes"), ("-fmax-errors=<n>", IGNORED, "clang stops after 20 errors"),
        ("-v", DRIVER, "print the commands"), ("--verbose", DRIVER, "as -v"),
    ]),
    ("Optimisation", [
        ("-O[<level>]", DRIVER, "0, 1, 2, 3 (as 2), s, z (as s), g (as 1), fast (as 2 -ffast-math)"),
        ("-f[no-]lto[=<n>]", DRIVER, "whole-program optimisation; the default when linking C files"),
        ("-fwhole-program", IGNORED, "the default when linking C files"),
        ("-fast-math", IGNORED, "XC16's faster library has larger errors; this library is linked"),
        ("-relaxed-math", IGNORED, "XC16's faster library has larger errors; this library is linked"),
        ("-f[no-]fast-math", CLANG, ""), ("-f[no-]math-errno", CLANG, ""), ("-f[no-]trapping-math", CLANG, ""),
        ("-f[no-]signed-zeros", CLANG, ""), ("-f[no-]finite-math-only", CLANG, ""), ("-ffp-contract=<mode>", CLANG, ""),
        ("-f[no-]wrapv", CLANG, ""), ("-f[no-]strict-aliasing", CLANG, ""), ("-f[no-]strict-overflow", CLANG, ""),
        ("-f[no-]common", CLANG, ""), ("-f[no-]inline", CLANG, ""), ("-f[no-]inline-functions", CLANG, ""),
        ("-f[no-]jump-tables", CLANG, ""), ("-f[no-]unroll-loops", CLANG, ""), ("-f[no-]finite-loops", CLANG, ""),
        ("-f[no-]delete-null-pointer-checks", CLANG, ""), ("-f[no-]optimize-sibling-calls", CLANG, ""),
        ("-f[no-]strict-flex-arrays[=<n>]", CLANG, ""),
        ("-f[no-]omit-frame-pointer", DRIVER, "LNK and ULNK with W14 in every function; the default at -O0"),
        ("-f[no-]function-sections", IGNORED, "each function always has its own section"),
        ("-f[no-]data-sections", IGNORED, "each variable always has its own section"),
        *((f"-f[no-]{name}", IGNORED, "chooses how GCC optimises") for name in (
            "align-functions[=<n>]", "align-labels[=<n>]", "align-loops[=<n>]", "align-jumps[=<n>]", "caller-saves",
            "cse-follow-jumps", "cse-skip-blocks", "expensive-optimizations", "gcse", "gcse-lm", "gcse-sm",
            "gcse-las", "gcse-after-reload", "move-all-movables", "reduce-all-givs", "defer-pop", "peephole",
            "peephole2", "optimize-register-move", "regmove", "rename-registers", "rerun-cse-after-loop",
            "rerun-loop-opt", "schedule-insns", "schedule-insns2", "strength-reduce", "thread-jumps",
            "unroll-all-loops", "force-mem", "force-addr", "inline-small-functions", "inline-functions-called-once",
            "inline-limit=<n>", "keep-inline-functions", "keep-static-consts", "function-cse", "crossjumping",
            "if-conversion", "if-conversion2", "ivopts", "tree-<name>", "ipa-<name>", "merge-constants",
            "merge-all-constants", "section-anchors", "toplevel-reorder", "reorder-blocks", "reorder-functions",
            "loop-optimize", "guess-branch-probability", "branch-count-reg", "split-wide-types", "forward-propagate",
            "dce", "dse", "web", "tracer", "prefetch-loop-arrays", "zero-initialized-in-bss", "verbose-asm")),
        ("-fargument-alias", IGNORED, "the default of C"),
        ("-fargument-noalias[-global]", IGNORED, "permits an optimisation that is not done: use restrict"),
        ("-param <name>", IGNORED, "chooses how GCC optimises"),
        ("--param <name>", IGNORED, "chooses how GCC optimises"),
        ("-fuse-linker-plugin", IGNORED, "whole-program optimisation needs no plugin"),
        ("-pipe", IGNORED, "no temporary files are needed"),
    ]),
    ("Code generation", [
        ("-g[<level>]", DRIVER, "debug information; -g0: none"), ("-gdwarf[-<n>]", DRIVER, "as -g"),
        ("-fcall-saved-<register>", REFUSED, "it changes the calling convention"),
        ("-fcall-used-<register>", REFUSED, "it changes the calling convention"),
        ("-ffixed-<register>", REFUSED, "the compiler uses W0 to W14: save the register around your assembly"),
        ("-fpcc-struct-return", REFUSED, "it changes the calling convention"),
        ("-freg-struct-return", IGNORED, "the calling convention"),
        ("-f[no-]stack-check", DRIVER, "frames above 8 bytes are checked against SPLIM"),
        ("-fno-stack-protector", IGNORED, "the default"), ("-f[no-]ident", IGNORED, "no .ident is written"),
        ("-fno-exceptions", IGNORED, "the default"), ("-fno-unwind-tables", IGNORED, "the default"),
        ("-fno-asynchronous-unwind-tables", IGNORED, "the default"), ("-fno-pic", IGNORED, "the default"),
        ("-fno-pie", IGNORED, "the default"), ("-fno-plt", IGNORED, "the default"),
        ("-fpic", REFUSED, "position-independent code is not supported"),
        ("-fPIC", REFUSED, "position-independent code is not supported"),
        ("-finstrument-functions", CLANG, ""), ("-pg", REFUSED, "use the emulator's profiler"),
        ("-f[no-]sanitize=<list>", CLANG, "a violation stops at a breakpoint"),
        ("-f[no-]verify-machine", DRIVER, "check the code after every pass"),
        ("-f[no-]cache-ir", DRIVER, "reuse the IR of unchanged C files"),
        ("-ftemplate-<name>", CLANG, ""), ("-fconstexpr-<name>", CLANG, ""), ("-fbracket-depth=<n>", CLANG, ""),
    ]),
    ("Preprocessor", [
        ("-I[ ]<dir>", CLANG, ""), ("-D[ ]<macro>", CLANG, ""), ("-U[ ]<macro>", CLANG, ""),
        ("-include <file>", CLANG, ""),
        ("-imacros <file>", CLANG, ""), ("-isystem <dir>", CLANG, ""), ("-iquote <dir>", CLANG, ""),
        ("-idirafter <dir>", CLANG, ""), ("-iprefix <prefix>", CLANG, ""), ("-iwithprefix <dir>", CLANG, ""),
        ("-iwithprefixbefore <dir>", CLANG, ""), ("-I-", REFUSED, "use -iquote for folders of #include \"...\""),
        ("-A <name>", REFUSED, "there are no assertions: use -D"), ("-nostdinc", DRIVER, "no headers of the toolchain"),
        ("-M[M]", CLANG, ""), ("-M[M]D", CLANG, ""), ("-MG", CLANG, ""), ("-MP", CLANG, ""), ("-MF <file>", CLANG, ""),
        ("-MT <target>", CLANG, ""), ("-MQ <target>", CLANG, ""), ("-P", CLANG, ""), ("-C[C]", CLANG, ""),
        ("-H", CLANG, ""), ("-dM", CLANG, ""), ("-dD", CLANG, ""), ("-dI", CLANG, ""),
        ("-dN", REFUSED, "use -dD"), ("-undef", CLANG, ""), ("-trigraphs", CLANG, ""),
        ("-fmacro-prefix-map=<map>", CLANG, ""), ("-ffile-prefix-map=<map>", CLANG, ""),
        ("-fdebug-prefix-map=<map>", CLANG,
         ""),
        ("-Wp,<options>", DRIVER, "options of the preprocessor, separated by commas"),
        ("-Xpreprocessor <option>", DRIVER, "an option of the preprocessor"),
    ]),
    ("Assembler and linker", [
        ("-Wa,<options>", DRIVER, "--defsym and -I act on assembly; listings and -MD are omitted"),
        ("-Xassembler <option>", DRIVER, "as -Wa"), ("-Wl,<options>", DRIVER, "see `python -m toolchain ld --help`"),
        ("-Xlinker <option>", DRIVER, "as -Wl"), ("-T[ ]<script>", DRIVER, "only the device's own script"),
        ("-L[ ]<dir>", DRIVER, ""), ("-l[ ]<name>", DRIVER, ""),
        ("-u <symbol>", DRIVER, "link the definition of a symbol"),
        ("-Map <file>", DRIVER, "link map"), ("--Map <file>", DRIVER, "link map"), ("-nostdlib", DRIVER, ""),
        ("-nostartfiles", DRIVER, ""), ("-nodefaultlibs", DRIVER, ""), ("-static", IGNORED, "the only kind of linking"),
        ("-shared", REFUSED, "there are no shared libraries on this device"),
        ("-s", IGNORED, "flash and HEX files hold no symbols"),
        ("-legacy-libc", IGNORED, "there is one library"), ("-no-legacy-libc", IGNORED, "there is one library"),
        ("-B[ ]<dir>", IGNORED, "the stages are parts of this program"),
        ("-specs=<file>", REFUSED, "the stages are parts of this program and read no specs"),
    ]),
    ("Output and information", [
        ("-o[ ]<file>", DRIVER, "a name in .hex: Intel HEX"), ("-c", DRIVER, ""), ("-S", DRIVER, ""),
        ("-E", DRIVER, ""),
        ("-emit-llvm", DRIVER, "with -S: LLVM IR"), ("-fsyntax-only", DRIVER, ""),
        ("-save-temps[=<where>]", DRIVER, ""), ("--save-temps", DRIVER, ""),
        ("-j[ ]<n>", DRIVER, "parallel front ends"),
        ("-print-prog-name=<name>", DRIVER, ""), ("-print-file-name=<name>", DRIVER, ""),
        ("-print-libgcc-file-name", DRIVER, ""), ("-print-search-dirs", DRIVER, ""), ("-print-multi-lib", DRIVER, ""),
        ("-dumpversion", DRIVER, ""), ("-dumpmachine", DRIVER, ""), ("--version", DRIVER, ""), ("--help", DRIVER, ""),
        ("-h", DRIVER, "as --help"),
    ]),
]  # fmt: skip
TABLE = [OptionRow(*row) for _, rows in SECTIONS for row in rows]


def _pattern(spelling: str) -> re.Pattern[str]:
    """Pattern of the first argument of a spelling."""
    word = spelling.replace("[ ]", "").partition(" ")[0]
    literal = re.escape(re.sub("<[^>]*>", "\0", word))
    return re.compile(literal.replace(r"\[", "(?:").replace(r"\]", ")?").replace("\0", ".*"), re.DOTALL)


@cache
def _patterns() -> list[tuple[re.Pattern[str], OptionRow]]:
    """Patterns of all rows, those with the longest fixed beginning first."""
    rows = sorted(TABLE, key=lambda row: -len(re.split(r"[\[<]", row.spelling)[0]))
    return [(_pattern(row.spelling), row) for row in rows]


@cache
def row_of(word: str) -> OptionRow | None:
    """The row of an option; None if the table has none."""
    return next((row for pattern, row in _patterns() if pattern.fullmatch(word)), None)


def page() -> str:
    """Text of docs/xc16-options.md."""
    lines = [
        "# Options of the compiler",
        "",
        "For users who move a Makefile or an MPLAB X project from XC16: every option of `dspic-cc` and its effect.",
        "The compiler reads the same table (`toolchain/frontend/option_table.py`). Any other option is an error.",
        "",
        '| in the column "taken" | meaning |',
        "|---|---|",
        *(f"| {effect} | {text} |" for effect, text in EFFECTS.items()),
    ]
    for title, rows in SECTIONS:
        lines += ["", f"## {title}", "", "| option | effect | note |", "|---|---|---|"]
        lines += [f"| `{spelling}` | {effect} | {note} |" for spelling, effect, note in rows]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(page(), end="")
