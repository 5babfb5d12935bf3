"""Compile and run a folder of C tests that must exit with 0: `python tests/toolchain/run_c_tests.py DIR`.

The runner was written for GCC's c-torture `execute` directory, but takes any folder. It prints every failure and every
skip with its reason, and then the counts. The exit status is 0 if no test failed.

A test that does not compile is skipped if SKIP_RULES gives a reason, or if it exceeds the device's memory. A failing
test is skipped if one of these conditions holds:

- A dg- directive that GCC's harness obeys excludes it.
- Its behaviour is undefined with 16-bit int, as clang's sanitizer, clang's warning about uninitialised variables or the
  division trap proves.
- EXPECTATIONS lists it together with the property of GCC that it expects.

Tests that check which library calls GCC folds are compiled without __OPTIMIZE__ and then check results only.
"""

from __future__ import annotations

import argparse
import json
import re
import signal
import sys
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.toolchain.c_programs import Built, Ran, build, run

STACK_SIZE = 5000
"""Stack bytes available to a test. GCC's tests read this macro and shrink their arrays accordingly."""

HEAP_SIZE = 3200
WALL_SECONDS = 100
SHORT = 3_000_000
"""Cycles run by the interpreter before the JIT continues: short runs start faster in the interpreter."""

FLAGS = ["-std=gnu17", "-w", f"-DSTACK_SIZE={STACK_SIZE}", "-DNO_TRAMPOLINES", "-DSIGNAL_SUPPRESS",

         *[f"-Wno-error={name}" for name in ("implicit-function-declaration", "implicit-int", "int-conversion",
           "incompatible-pointer-types", "return-mismatch", "incompatible-function-pointer-types", "parentheses")],
         *[f"-Wno-{name}" for name in ("implicit-function-declaration", "implicit-int", "int-conversion",
           "incompatible-pointer-types", "return-mismatch", "incompatible-function-pointer-types")]]  # fmt: skip

KNOWN_OPTION = re.compile(
    r"-(fwrapv|fno-builtin.*|fgnu89-inline|std=.*|D.*|f(un)?signed-char|fno-strict-aliasing|fms-extensions|finstrument-functions)"
)

# dg-require-effective-target names that this target does not fulfil, with the reason
ABSENT_TARGETS = {
    "int32plus": "needs 32-bit int", "int32": "needs 32-bit int", "size32plus": "needs objects above 64 kB",
    "ptr32plus": "needs 32-bit pointers", "size20plus": "needs objects above 64 kB", "trampolines": "nested functions",
    "int128": "needs __int128", "ptr_eq_long": "needs pointers as wide as long", "lp64": "needs 64-bit long",
    "mmap": "needs an operating system", "signal": "needs signals", "fopen": "needs files", "float128": "_Float128",
    "freorder": "GCC option", "vma_equals_lma": "needs VMA equal to LMA", "indirect_jumps": None, "label_values": None,
}  # fmt: skip
SIXTEEN_BIT_TARGETS = re.compile(r"\b(avr|msp430|xstormy16|pdp11|rl78|h8300)[-*]")

# messages of the C front end for features that the target or clang lacks, with the reason of the skip
SKIP_RULES = [
    (r"function definition is not allowed here|nested function|'auto' storage class", "GNU nested functions"),
    (r"variable.* has incomplete type|size of array|array is too large|array size", "object larger than 64 kB or RAM"),
    (r"__int128|_Decimal|_Float128|__float128|_Float16|_Float64x", "type this target does not have"),
    (r"bit-field.*exceeds|width of bit-field|exceeds the width of its type", "bit-field wider than 16-bit int"),
    (r"__builtin_(apply|return|setjmp|longjmp|shuffle|va_arg_pack|mul_overflow_p|add_overflow_p|sub_overflow_p|"
     r"aggregate_incoming|isinff|dwarf|init_|eh_|speculation|convertvector|extend|unwind|complex|call_with|has_attr)"
     r"|use of unknown builtin|undeclared.*__builtin", "GCC builtin that clang does not have"),
    (r"variable length array|fields must have a constant size|VLA in struct", "GNU variable-length struct fields"),
    (r"unknown register name|invalid output constraint|invalid input constraint|invalid .*constraint|inline asm",
     "inline assembly for other machines"),
    (r"error: (unknown|unsupported) (argument|option)|unknown argument", "GCC option"),
    (r"file not found|No such file", "needs a header of an operating system"),
    (r"static assertion|is not a compile-time constant|initializer element is not", "not a constant for clang"),
    (r"error: unknown type name|undeclared identifier|undeclared function", "needs declarations this target lacks"),
    (r"scalar_storage_order|'vector_size'|vector_size|ext_vector|vector type", "GNU vector types"),
    (r"redefinition of|conflicting types|cannot redeclare|has different definitions", "code clang rejects"),
    (r"_Complex", "complex integers"),
    (r"decimal type", "decimal floating point"),
    (r"asm label|register.*asm", "register variables of other machines"),
    (r"indirect goto|address of label|computed goto", "computed goto in a form clang rejects"),
    (r"invalid LLVM IR input: Intrinsic called", "builtin whose form clang gets wrong where int has 16 bits"),
    (r"called object type|invalid operands|assigning to|passing|incompatible|returning|conversion|cast|too (many|few)"
     r"|must return a value|not assignable|expected|requires|cannot|duplicate case|flexible array|invalid|typeof|enum",
     "code clang rejects"),
]  # fmt: skip
# messages of the back end for GNU extensions
UNSUPPORTED_RULES = [
    (r"vector type|(extract|insert)element|shufflevector", "GNU vector types"),
    (r"builtin function __builtin_", "GCC builtin that clang does not have"),
    (r"undefined symbol _link_error", "checks what GCC's optimiser removes"),
]

FOLDING = re.compile(r"should_optimize|inside_main")
WIDE_FIELD = re.compile(r"long long( int)?\s+\w+\s*:\s*(1[7-9]|[2-6]\d)")

EXPECTATIONS = {
    "990208-1": "checks that GCC inlines a function with labels whose addresses are taken",
    "alloca-1": "__attribute__((aligned)) means 16 to clang and 2 to XC16; alloca gives 2",
    "memops-asm": "expects an asm label to rename the builtin function too",
    "pr17377": "checks that a call at the end of a function is not made a jump",
    "pr60003": "reads a local variable, not volatile, that changed between setjmp and longjmp (C11 7.13.2.1)",
    "pr64242": "checks that __builtin_setjmp takes nothing from the stack",
    "strstr-asm": "expects an asm label to rename the builtin function too",
}
"""Tests whose expectations exceed C and clang's documented extensions."""

MEMORY = re.compile(r"does not fit|no room for the stack|overflow|largest symbols|must be less than 8192|bytes too")


@dataclass(frozen=True)
class Verdict:
    """Result of one test at one level; `kind` is passed, failed or skipped."""

    test: str
    level: str
    kind: str
    reason: str = ""


def directive_skip(source: str) -> str | None:
    """Return the reason for which a dg- directive excludes this test on a 16-bit machine, or None."""
    for name in re.findall(r"dg-require-effective-target\s+([\w-]+)", source):
        reason = ABSENT_TARGETS.get(name)
        if reason:
            return f"{reason} (dg-require-effective-target {name})"
    for need in re.findall(r'dg-require-stack-size\s+"(\d+)', source):
        if int(need) > STACK_SIZE:
            return f"needs {need} bytes of stack"
    for line in re.findall(r"dg-(?:skip-if|xfail-run-if|xfail-if)[^\n]*", source):
        if SIXTEEN_BIT_TARGETS.search(line):
            return f"GCC skips it on 16-bit machines: {line.strip(' {}*/')}"
        if re.search(r'"(-O0|-Os|-O2)', line) is None and re.search(r"\{ \*-\*-\* \}", line) and "xfail" in line:
            return f"fails everywhere in GCC: {line.strip(' {}*/')}"
    return None


def options_of(path: Path, source: str) -> list[str]:
    """Return the options of dg- directives and of the test's .x file, without switches of GCC's optimiser."""
    words = ["-fno-lto"] if "externally_visible" in source else []
    beside = path.with_suffix(".x")
    if beside.exists():
        found = re.findall(r'set (?:additional_flags|options) "?(-[^"\n}]*)', beside.read_text())
        words += [word for text in found for word in text.split() if KNOWN_OPTION.fullmatch(word)]
    for text in re.findall(r'dg-(?:additional-)?options\s+["{]\s*"?([^"}]*)"?\s*["}](?![^\n]*target)', source):
        words += [word for word in text.split() if KNOWN_OPTION.fullmatch(word)]
    return words


def sources_of(path: Path) -> list[Path]:
    """Return the source files: the test and, in GCC's `builtins` folder, its library functions and the common main."""
    main = path.parent / "lib" / "main.c"
    return [path, path.with_name(f"{path.stem}-lib.c"), main] if main.exists() else [path]


def is_test(path: Path) -> bool:
    """Whether a file is a test of its own and not part of another test."""
    return not path.stem.endswith("-lib") and path.parent.name != "lib"


def heap_of(source: str) -> list[str]:
    """Return the linker option that provides a heap if the program allocates memory."""
    return [f"-Wl,--heap={HEAP_SIZE}"] if re.search(r"malloc|calloc|realloc", source) else []


def judge(path: Path, level: str, cycles: int) -> Verdict:
    """Compile and run one test and return the verdict."""
    source = path.read_text(encoding="latin-1")
    excluded = directive_skip(source)
    with tempfile.TemporaryDirectory(prefix="ctest-") as folder:
        image = Path(folder) / "test.elf"
        built = compile_test(path, source, image, level)
        if built.status != 0:
            kind, reason = refusal(built)
            return Verdict(path.name, level, "skipped" if excluded else kind, excluded or reason)
        result = run_test(image, SHORT if excluded else cycles)
        if result.status == 0:
            return Verdict(path.name, level, "passed")
        reason = excluded or excuse(path, source, result, image) or ""
    if reason:
        return Verdict(path.name, level, "skipped", reason)
    return Verdict(path.name, level, "failed", result.why or f"exit status {result.status}")


def compile_test(path: Path, source: str, image: Path, level: str, *more: str) -> Built:
    """Build one test with its options."""
    files = sources_of(path)
    folding = ["-U__OPTIMIZE__"] if len(files) > 1 or FOLDING.search(source) else []
    return build(files, image, level, *FLAGS, *folding, *options_of(path, source), *heap_of(source), *more)


def run_test(image: Path, cycles: int) -> Ran:
    """Run one test, in the interpreter first and then with the JIT."""
    result = run(image, SHORT, engine="auto")
    return run(image, cycles) if result.why.startswith("limit") and cycles > SHORT else result


def refusal(built: Built) -> tuple[str, str]:
    """Return kind and reason of the verdict on a test that does not compile."""
    if built.status == 1:
        for pattern, why in SKIP_RULES:
            if re.search(pattern, built.first_error):
                return "skipped", f"{why}: {built.first_error.split('error:')[-1].strip()}"
        return "failed", built.first_error
    for pattern, why in UNSUPPORTED_RULES:
        if re.search(pattern, built.messages):
            return "skipped", f"{why}: {built.first_error}"
    return "skipped" if MEMORY.search(built.messages) else "failed", built.first_error


def excuse(path: Path, source: str, result: Ran, image: Path) -> str | None:
    """Return the reason to skip a test that did not exit with 0, or None.

    Reasons are undefined behaviour and expectations of GCC's behaviour.
    """
    if path.stem in EXPECTATIONS:
        return EXPECTATIONS[path.stem]
    if result.why == "trap: stack error":
        return "needs more stack than there is RAM (stack error trap)"
    checks = ["-Werror=uninitialized", "-Werror=sometimes-uninitialized", "-fsyntax-only"]
    quiet = [flag for flag in FLAGS if flag != "-w"]
    if build([path], image, "-O0", *quiet, "-Wno-everything", *checks).status == 1:
        return "uses an uninitialised variable"
    if compile_test(path, source, image, "-O0", "-fsanitize=undefined").status == 0:
        checked = run_test(image, 3 * SHORT).why
        if checked.startswith("undefined behaviour"):
            return f"undefined where int has 16 bits: the sanitizer stops it ({checked})"
        if checked == "trap: math error":
            return "undefined where int has 16 bits: divides by zero"
    return "expects GCC's type for bit-fields wider than int" if WIDE_FIELD.search(source) else None


def _judge(work: tuple[Path, str, int]) -> Verdict:
    def late(signum: int, frame: object) -> None:
        raise TimeoutError(f"took longer than {WALL_SECONDS} s")

    signal.signal(signal.SIGALRM, late)
    signal.alarm(WALL_SECONDS)
    try:
        return judge(*work)
    except TimeoutError as error:
        return Verdict(work[0].name, work[1], "failed", str(error))
    except Exception as error:
        return Verdict(work[0].name, work[1], "failed", f"internal error: {type(error).__name__}: {error}")
    finally:
        signal.alarm(0)


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="example: run_c_tests.py gcc.c-torture/execute --jobs 2 -Os",
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("-O", dest="levels", action="append", help="level, repeatable: -O 0 -O s (default s)")
    parser.add_argument("--cycles", type=int, default=1_500_000_000, help="limit per run, in Tcy")
    parser.add_argument("--match", default="*.c", help="file name pattern")
    parser.add_argument("--json", action="store_true", help="print one JSON list of verdicts")
    options = parser.parse_args()
    if not options.folder.is_dir():
        parser.error(f"{options.folder} is not a folder")
    files = sorted(path for path in options.folder.rglob(options.match) if is_test(path))
    work = [(path, f"-O{level}", options.cycles) for path in files for level in options.levels or ["s"]]
    with ProcessPoolExecutor(options.jobs) as pool:
        verdicts = list(pool.map(_judge, work, chunksize=4))
    if options.json:
        print(json.dumps([asdict(v) for v in verdicts], indent=1))
    else:
        for v in verdicts:
            if v.kind != "passed":
                print(f"{v.kind} {v.test} {v.level}: {v.reason}")
    counts = Counter(v.kind for v in verdicts)
    print(f"{counts['passed']} passed, {counts['failed']} failed, {counts['skipped']} skipped", file=sys.stderr)
    return 1 if counts["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
