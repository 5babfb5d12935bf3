"""Runs clang, which the `ziglang` package contains: C to LLVM IR text, preprocessed text and dependency files.

The front end uses clang's MSP430 target for its data layout, which equals XC16's (abi-elf.md §1.1), but not its code
generator. This is the only module that starts clang.
"""

from __future__ import annotations

import importlib.util
import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path

from emu.chips import chip_named
from emu.chips.chip import Chip
from toolchain.abi.struct_alignment import LAYOUT_FLAGS
from toolchain.device_header import include_folders
from toolchain.errors import ToolError
from toolchain.frontend import accumulators, annotated_lines, asm_constraints, attributes, config_pragma, header_case
from toolchain.frontend.asm_registers import REFUSED, respell
from toolchain.frontend.options import CcOptions, Input
from toolchain.frontend.short_double import FLAGS as SHORT_DOUBLE_FLAGS

INCLUDE_DIR = Path(__file__).parents[1] / "include"

TARGET_FLAGS = [
    "--target=msp430",
    "-fno-unwind-tables",
    "-fno-asynchronous-unwind-tables",
    "-fno-stack-protector",
    "-fno-finite-loops",  # delay loops without effect are not deleted; XC16 programs contain them
    "-fno-vectorize",
    "-fno-slp-vectorize",
]
# Plain char is signed (abi-elf.md §1.1), unlike on the MSP430; wchar_t is unsigned short.
# Unknown pragmas cause a warning, which also reveals `#pragma config`.
# `space(ymemory), far` are two section names for clang, which uses the first. Notes about macro expansions are omitted.
LANGUAGE_FLAGS = ["-nostdinc", "-fsigned-char", "-fshort-wchar", "-fno-ident", "-Wunknown-pragmas", "-Wno-section",
                  "-Wno-atomic-alignment", "-Wno-unknown-warning-option",
                  "-Wno-ignored-optimization-argument", "-fmacro-backtrace-limit=1"]  # fmt: skip
# Errors of clang that are warnings in GCC 4 and XC16 in every dialect of C: calls of undeclared functions, `main()`,
# incompatible pointers, a missing or superfluous value of `return`. With -Werror, GCC reports them as errors as well.
WARNINGS_OF_C = ["implicit-function-declaration", "implicit-int", "int-conversion", "incompatible-pointer-types",
                 "incompatible-function-pointer-types", "return-mismatch"]  # fmt: skip
# Library functions that clang may introduce, but that the run-time library does not contain.
ABSENT_FUNCTIONS = ["stpcpy", "stpncpy", "bcmp", "exp10", "ldexp",
                    "ldexpf", "memccpy", "strndup", "cabs", "iprintf", "siprintf", "wcslen"]  # fmt: skip
# Allocation functions, whose failure clang would assume away.
ALLOCATION_FUNCTIONS = ["malloc", "calloc", "realloc", "aligned_alloc", "free"]
# Predefined macros besides that of the chip (abi-elf.md §2.9). __XC16__ and __C30__ are undefined, because they select
# Microchip's spellings of attributes.
PREDEFINED = ["__dsPIC30F__", "__dsPIC30__", "__HAS_DSP__", "__HAS_EEDATA__", "__HAS_5VOLTS__"]
# Freestanding C++: no exceptions, no run-time types, no thread-safe statics, no destructors of statics.
CXX_FLAGS = ["-fno-exceptions", "-fno-rtti", "-fno-threadsafe-statics", "-fno-c++-static-destructors", "-nostdinc++"]
# Configuration macros of libc++.
LIBCXX_SETTINGS = {"ABI_VERSION": "1", "ABI_NAMESPACE": "__1", "HARDENING_MODE_DEFAULT": "_LIBCPP_HARDENING_MODE_NONE",
                   "ASSERTION_SEMANTIC_DEFAULT": "_LIBCPP_ASSERTION_SEMANTIC_IGNORE",
                   "DISABLE_VISIBILITY_ANNOTATIONS": "1", "PSTL_BACKEND_SERIAL": "1", **dict.fromkeys(
    ("HAS_THREADS", "HAS_MONOTONIC_CLOCK", "HAS_TERMINAL", "HAS_FILESYSTEM", "HAS_RANDOM_DEVICE", "HAS_LOCALIZATION",
     "HAS_UNICODE", "HAS_WIDE_CHARACTERS", "HAS_TIME_ZONE_DATABASE", "HAS_VENDOR_AVAILABILITY_ANNOTATIONS",
     "HAS_MUSL_LIBC"), "0")}  # fmt: skip
CXX_FLAGS += [f"-D_LIBCPP_{name}={value}" for name, value in LIBCXX_SETTINGS.items()]
C_ONLY = {"-fgnu89-inline", "-fno-gnu89-inline"}
FOREIGN_MACROS = ["MSP430", "__MSP430__"]
CLANG_LEVEL = {"0": "-O0", "1": "-O1", "2": "-O2", "s": "-Oz"}


SILENT = "-Wno-everything"  # instead of -w, which would hide the warning that reveals XC16's attributes
MAX_FRONT_END_RUNS = 4  # each run changes the text for features that the previous run revealed
Change = Callable[[str], str]
"""Function that rewrites preprocessed text for clang."""


class ClangError(Exception):
    """clang reported errors, which are already on stderr; the driver exits with status 1."""


@dataclass(frozen=True)
class ClangJob:
    """One clang run: its arguments and its input file."""

    arguments: list[str]
    source: Path
    printed: Path | None = None  # file that receives its standard output
    chip: Chip = field(default_factory=chip_named)

    @property
    def output(self) -> Path:
        """The file behind -o, which ends the arguments of a job with an output file."""
        return Path(self.arguments[-1])


def clang_program() -> list[str]:
    """Command prefix that runs clang. Raises ToolError if the `ziglang` package is missing."""
    spec = importlib.util.find_spec("ziglang")
    if spec is None or spec.origin is None:
        raise ToolError("the C front end is missing: install the Python package 'ziglang' (pip install ziglang)")
    zig = Path(spec.origin).parent / ("zig.exe" if os.name == "nt" else "zig")
    return [str(zig), "clang"]


def builtin_include_dir() -> Path:
    """Folder of clang's headers (stdatomic.h, iso646.h, ...), searched after the toolchain's own headers."""
    return Path(clang_program()[0]).parent / "lib" / "include"


def library_include_dir() -> Path:
    """Folder of libc++'s headers, of which C++ sources can use the header-only part."""
    return Path(clang_program()[0]).parent / "lib" / "libcxx" / "include"


def front_end_flags(options: CcOptions, language: str = "c") -> list[str]:
    """Flags of the target and language, followed by the user's flags."""
    flags = [*TARGET_FLAGS, *LANGUAGE_FLAGS, CLANG_LEVEL[options.level]]
    flags += [f"-U{name}" for name in FOREIGN_MACROS]
    own_folders = (INCLUDE_DIR, *include_folders(options.chip.name), builtin_include_dir())
    folders = [word for folder in (own_folders if options.own_headers else ()) for word in ("-isystem", str(folder))]
    guard = ["__HAS_CODEGUARD__"] if "FBS" in options.chip.config else []
    flags += [f"-D{name}=1" for name in (f"__{options.chip.name}__", *PREDEFINED, *guard)]
    flags += [f"-fno-builtin-{name}" for name in (*ABSENT_FUNCTIONS, *ALLOCATION_FUNCTIONS)]
    flags += ["-include", str(INCLUDE_DIR / "dspic_builtins.h")]
    if options.short_double:
        flags += SHORT_DOUBLE_FLAGS
    if options.single_constants:
        flags += ["-Xclang", "-cl-single-precision-constant"]
    if options.debug:
        # Images must not depend on the folders in which this package and clang are installed.
        own = ((INCLUDE_DIR, "toolchain/include"), (include_folders(options.chip.name)[0], "toolchain/include"),
               (builtin_include_dir(), "clang/include"))  # fmt: skip
        flags += ["-g", "-gdwarf-2", *(f"-fdebug-prefix-map={path}={name}" for path, name in own)]
    if any(word.startswith("-fsanitize=") for word in options.clang):
        flags.append("-fsanitize-trap=all")  # checks trap, because there is no sanitizer run-time library
    named = any(word.startswith("-std=") or word == "-ansi" for word in options.clang)
    if is_cxx(language):
        flags += CXX_FLAGS if named else [*CXX_FLAGS, "-std=gnu++17"]
        flags += [word for word in options.clang if word not in C_ONLY]
        return [*_without_silence(flags), "-isystem", str(library_include_dir()), *folders]
    if not named:
        flags.append("-fgnu89-inline")  # XC16's default is gnu89, where plain `inline` defines the function
    if not {"-Werror", "-pedantic-errors"} & set(options.clang):
        flags += [f"-Wno-error={name}" for name in WARNINGS_OF_C]
    flags += options.clang
    return [*_without_silence(flags), *folders]


def _without_silence(flags: list[str]) -> list[str]:
    """The flags with SILENT instead of -w; `run_jobs` prints no message of a silent job without an error."""
    if "-w" not in flags:
        return flags
    return [*(flag for flag in flags if flag != "-w"), SILENT, "-Wunknown-attributes"]


def is_cxx(language: str) -> bool:
    """Whether a language of `-x` is C++."""
    return language.startswith("c++")


def _dependency_flags(options: CcOptions, item: Input) -> list[str]:
    """Flags of dependency files: -MF defaults to a .d file beside the output, the target to the output file."""
    flags = list(options.dependency)
    if not {"-MD", "-MMD"} & set(flags):
        return flags
    output = options.output or Path(item.path.stem + ".o")
    if "-MF" not in flags:
        beside = output if len(options.inputs) == 1 else output.parent / item.path.name
        flags += ["-MF", str(beside.with_suffix(".d"))]
    if "-MT" not in flags and "-MQ" not in flags:
        flags += ["-MQ", str(output)]
    return flags


def ir_job(options: CcOptions, item: Input, output: Path) -> ClangJob:
    """Job that compiles one C file to unoptimised IR text with the attributes of the level."""
    arguments = [*front_end_flags(options, item.language), *_dependency_flags(options, item)]
    arguments += [*LAYOUT_FLAGS, "-Xclang", "-disable-llvm-passes", "-emit-llvm", "-S"]
    arguments += annotated_lines.definitions(item.path)
    arguments += ["-x", item.language, str(item.path)]
    return ClangJob([*arguments, "-o", str(output)], item.path, output.with_suffix(".layouts"), options.chip)


def with_i32_levels(ir: bytes) -> bytes:
    """IR with i32 arguments of two intrinsics; clang passes an `int`, which has 16 bits on this target."""
    for name in (b"returnaddress", b"frameaddress.p0"):
        ir = ir.replace(b"@llvm.%s(i16 " % name, b"@llvm.%s(i32 " % name)
    return ir


def preprocess_job(options: CcOptions, item: Input, output: Path | None) -> ClangJob:
    """Job for -E, -M and -fsyntax-only; output None is standard output."""
    arguments = [*front_end_flags(options, item.language), *_dependency_flags(options, item)]
    if item.language == "assembler-with-cpp":
        arguments.append("-D__ASSEMBLER__=1")
    if "-fsyntax-only" not in options.clang and not {"-M", "-MM"} & set(options.dependency):
        arguments.append("-E")
    arguments += ["-x", item.language, str(item.path)]
    return ClangJob(arguments if output is None else [*arguments, "-o", str(output)], item.path)


def optimise_job(options: CcOptions, module: Path, output: Path) -> ClangJob:
    """Job that runs clang's middle end on a module."""
    passed = [flag for flag in options.clang if flag.startswith(("-funroll", "-fno-unroll", "-ffast", "-fno-inline"))]
    if options.level != "2":  # clang replaces a CRC loop of eight iterations by a table of 256 words
        passed += ["-mllvm", "-disable-loop-idiom-hashrecognize"]
    arguments = [*TARGET_FLAGS, CLANG_LEVEL[options.level], *passed, "-Wno-override-module", "-x", "ir"]
    return ClangJob([*arguments, "-S", "-emit-llvm", str(module), "-o", str(output)], module)


def _run_changed(program: list[str], arguments: list[str], changes: list[Change]) -> subprocess.CompletedProcess[bytes]:
    """Compile the preprocessed text with the changes applied."""
    *options, _, language, source, _, output = arguments  # ... -x LANGUAGE SOURCE -o OUTPUT
    text = Path(output).with_suffix(".changed.i")
    emit = {"-emit-llvm", "-S"}
    first = [option for option in options if option not in emit]
    made = subprocess.run(
        [*program, *first, "-E", "-x", language, source, "-o", str(text)], capture_output=True, check=False
    )
    if made.returncode:
        return made
    changed = reduce(lambda given, change: change(given), changes, text.read_text(errors="surrogateescape"))
    text.write_text(changed, errors="surrogateescape")
    second = [*without_preprocessing(options), "-Wno-unused-command-line-argument"]
    second += ["-x", "c++-cpp-output" if is_cxx(language) else "cpp-output", str(text), "-o", output]
    return subprocess.run([*program, *second], capture_output=True, check=False)


def _run_job(program: list[str], job: ClangJob) -> subprocess.CompletedProcess[bytes]:
    """Run clang, and again with changed text if the source uses XC16 features that clang does not support."""
    arguments = job.arguments
    compiles = job.printed is not None  # a job that compiles a source to IR
    changes = _changes_of(job) if compiles else []
    for _ in range(MAX_FRONT_END_RUNS):
        if changes:
            result = _run_changed(program, arguments, changes)
        else:
            result = subprocess.run([*program, *arguments], capture_output=True, check=False)
        if result.returncode and header_case.MISSING.search(result.stderr) and "-ivfsoverlay" not in arguments:
            with tempfile.TemporaryDirectory(prefix="dspic-names-") as folder:
                overlay = Path(folder) / "overlay.yaml"
                overlay.write_text(header_case.overlay(arguments))
                return _run_job(program, replace(job, arguments=["-ivfsoverlay", str(overlay), *arguments]))
        wanted = [change for change in _changes_for(result, job) if change not in changes] if compiles else []
        if not wanted:
            break
        changes += wanted
    return result


def _changes_of(job: ClangJob) -> list[Change]:
    """The changes that the text of the source file itself needs, whatever its headers contain."""
    try:
        source = job.source.read_bytes()
    except OSError:
        return []
    changes: list[Change] = [attributes.rewrite] if attributes.suspected(source) else []
    if config_pragma.IN_SOURCE.search(source):
        changes.append(config_pragma.rewriter(job.chip.name))
    return changes


def _changes_for(result: subprocess.CompletedProcess[bytes], job: ClangJob) -> list[Change]:
    """Return the rewrites of the source text that clang's messages ask for."""
    said, failed = result.stderr, result.returncode != 0
    changes: list[Change] = []
    if attributes.IGNORED.search(said):
        changes.append(attributes.rewrite)
    if failed and attributes.NAKED_WITH_STATEMENTS.search(said):
        changes.append(attributes.rewrite_naked)
    if config_pragma.PRESENT in said:
        changes.append(config_pragma.rewriter(job.chip.name))
    if failed and (REFUSED.search(said) or asm_constraints.REFUSED.search(said) or accumulators.REFUSED.search(said)):
        changes.append(respell)
    if failed and asm_constraints.REFUSED.search(said):
        changes.append(asm_constraints.respell)
    if failed and accumulators.REFUSED.search(said):
        changes.append(accumulators.rewrite)
    return changes


def without_preprocessing(options: list[str]) -> list[str]:
    """Options of a clang run for preprocessed input: without forced includes and dependency files."""
    out: list[str] = []
    words = iter(options)
    for word in words:
        if word in ("-include", "-MF", "-MT", "-MQ"):
            next(words)
        elif word not in ("-MD", "-MMD", "-MP"):
            out.append(word)
    return out


def run_jobs(jobs: list[ClangJob], parallel: int, show: bool = False) -> list[bool]:
    """Run jobs, at most `parallel` at once (0: one per core); diagnostics appear in the order of the jobs.

    Return whether each job had no diagnostics. With `show`, the commands are printed first. Raises ClangError after the
    last job if any of them failed.
    """
    program = clang_program()
    colour = ["-fdiagnostics-color=always"] if os.isatty(2) and not os.environ.get("NO_COLOR") else []

    if show:
        for job in jobs:
            print(shlex.join([*program, *job.arguments]), file=sys.stderr)

    def run(job: ClangJob) -> subprocess.CompletedProcess[bytes]:
        return _run_job([*program, *colour], job)

    with ThreadPoolExecutor(max_workers=parallel or os.cpu_count() or 1) as pool:
        results = list(pool.map(run, jobs))
    for job, result in zip(jobs, results, strict=True):
        if result.returncode or SILENT not in job.arguments:
            sys.stderr.write(result.stderr.decode(errors="replace").replace("zig: ", "cc: "))
        if job.printed is None:
            sys.stdout.write(result.stdout.decode(errors="replace"))
        else:
            job.printed.write_bytes(result.stdout)
    if any(result.returncode != 0 for result in results):
        raise ClangError
    return [not result.stderr for result in results]
