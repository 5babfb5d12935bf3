"""Command line of `python -m toolchain cc`: parses an argument list to CcOptions.

Options are handled by the driver, passed to clang, or accepted without effect for compatibility with gcc and XC16. The
parser reads no files except @response files.
"""

from __future__ import annotations

import os
import shlex
from dataclasses import dataclass, field
from pathlib import Path

from emu.chips import chip_named
from emu.chips.chip import Chip
from toolchain.device import device
from toolchain.errors import ToolError

HELP = """\
usage: python -m toolchain cc [options] files... [-o out.elf|out.hex|out.o]

C compiler, assembler and linker for the dsPIC30F6014A and its relatives (-mcpu=), used like gcc.
  files                 .c  .cpp .cc (C++)  .s (assembly)  .S (preprocessed assembly)  .i  .ll/.bc (LLVM IR)  .o  .a
  -o FILE               output; .hex writes Intel HEX, anything else ELF (default a.elf)
  -c | -S | -E          stop after assembling | compiling | preprocessing
  -emit-llvm            with -S: optimised LLVM IR instead of assembly
  -O0 -O1 -O2 -Os -Oz   optimisation level (default -O0; -Os and -Oz both mean smallest code)
  -g                    debug information
  -flto / -fno-lto      optimise the whole program when linking C files (default on; with -c: off)
  -ffreestanding        no assumptions about library functions; main need not return int
  -fsingle-precision-constant   unsuffixed floating constants are float
  -mlarge-code          two-word calls, which reach all of the flash (default -msmall-code: RCALL, +-32 K words)
  -ffile-prefix-map=OLD=NEW   paths that begin with OLD are recorded as NEW (debug information and __FILE__)
  -mlarge-data          only variables with attribute near are near (default -msmall-data: objects up to 64 bytes are
                        near); -mlarge-scalar and -mlarge-aggregate have the same effect
  -fstack-check         functions with a frame above 8 bytes probe SPLIM on entry
  -fverify-machine      check the code after every pass of the back end (also DSPIC_VERIFY_MACHINE=1)
  -fsanitize=undefined  undefined behaviour stops at a breakpoint (word DA4000) in the code that causes it
  -finstrument-functions  call __cyg_profile_func_enter and _exit
  -I -D -U -include -isystem -iquote -std= -W... -w -pedantic   as in gcc; without -std= the language is gnu17
                        with XC16's meaning of `inline` (gnu89: it defines the function); C++ is gnu++17, freestanding
  -MD -MMD -MF -MT -MQ -MP -M -MM                               dependency files, as in gcc
  -L DIR -l NAME        libraries; the run-time library is always searched last
  -nostdlib -nostartfiles -nodefaultlibs                        omit the run-time library, crt0
  -Map FILE             link map;  -Wl,OPTION and -Xlinker OPTION pass options to the linker
  -T FILE               accepted for the device's own linker script p30F6014A.gld, whose memory map is built in
  -Wa,OPTION            accepted for compatibility, as are -msfr-warn= -merrata= -msmart-io= -omf=elf
  -j N                  parallel front-end jobs (default: one per core)
  -save-temps           keep PROGRAM.ll and PROGRAM.s in the folder of the output
  -v  --version  --help

example: python -m toolchain cc -Os -g -Wall main.c switch.s -o firmware.elf
exit status: 0 done, 1 errors in the C source, 2 other errors; after an error there is no output file
"""

VALUE_FLAGS = {"-I", "-D", "-U", "-include", "-isystem", "-iquote", "-idirafter", "-imacros"}
DEPENDENCY_VALUE_FLAGS = {"-MF", "-MT", "-MQ"}
DEPENDENCY_FLAGS = {"-MD", "-MMD", "-MP"}
PREPROCESS_ONLY_FLAGS = {"-M", "-MM"}
CLANG_FLAGS = {
    "-w", "-pedantic", "-pedantic-errors", "-ansi", "-P", "-C", "-CC", "-H", "-undef", "-trigraphs",
    "-fwrapv", "-fno-wrapv", "-fno-strict-aliasing", "-fstrict-aliasing", "-fno-common", "-fcommon", "-fno-builtin",
    "-fbuiltin", "-ffreestanding", "-fhosted", "-funsigned-char", "-fsigned-char", "-fshort-enums", "-fno-short-enums",
    "-fno-inline", "-finline-functions", "-fno-inline-functions", "-fno-jump-tables", "-fjump-tables", "-ffast-math",
    "-fno-fast-math", "-funroll-loops", "-fno-unroll-loops", "-fno-math-errno", "-fmath-errno", "-ftrapping-math",
    "-fno-trapping-math", "-fms-extensions", "-fgnu89-inline", "-fno-gnu89-inline", "-fpack-struct",
    "-fcolor-diagnostics", "-fno-color-diagnostics", "-fdiagnostics-color", "-fno-diagnostics-color",
    "-fdiagnostics-color=always", "-fdiagnostics-color=never", "-fno-delete-null-pointer-checks",
    "-fno-signed-zeros", "-ffinite-math-only", "-fstrict-flex-arrays", "-fdollars-in-identifiers",
    "-ffinite-loops", "-fno-finite-loops", "-fno-caret-diagnostics", "-fno-optimize-sibling-calls",
    "-fno-strict-overflow", "-fstrict-overflow", "-ffp-contract=off", "-ffp-contract=on", "-ffp-contract=fast",
    "-dM", "-dD", "-dI", "-finstrument-functions",
}  # fmt: skip
CLANG_PREFIXES = (
    "-std=", "-W", "-I", "-D", "-U", "-fno-builtin-", "-fmessage-length=", "-ferror-limit=", "-fmacro-prefix-map=",
    "-ffile-prefix-map=", "-fdebug-prefix-map=", "-ftemplate-", "-fconstexpr-", "-fbracket-depth=", "-fpack-struct=",
    "-fsanitize=", "-fno-sanitize=",
)  # fmt: skip
IGNORED_FLAGS = {
    "-pipe", "-fno-short-double", "-ffunction-sections", "-fdata-sections", "-fno-function-sections",
    "-fno-data-sections", "-fomit-frame-pointer", "-fno-omit-frame-pointer", "-fno-exceptions", "-fno-unwind-tables",
    "-fno-asynchronous-unwind-tables", "-fno-stack-protector", "-mno-eds-warn", "-fno-ident", "-fno-pic", "-fno-pie",
    "-mdfp", "-legacy-libc", "-no-legacy-libc", "-static", "-fuse-linker-plugin", "-fno-plt", "-mconst-in-code",
    "-fxc16-attributes",
}  # fmt: skip
# Smart I/O is always active here (`link_stage.FORMAT_PARTS`). Errata options concern other chips. Warnings about SFR
# accesses are unnecessary, because all registers are `volatile`.
IGNORED_PREFIXES = ("-msmart-io=", "-msfr-warn=", "-merrata=", "-mreserve=")
LARGE_DATA = {"-mlarge-data", "-mlarge-scalar", "-mlarge-aggregate"}
SMALL_DATA = {"-msmall-data", "-msmall-scalar", "-msmall-aggregate"}
REFUSED = {
    "-fshort-double": "double is always 64-bit IEEE here; there is no 32-bit double",
    "-mconst-in-data": "constants live in program memory and are read through the PSV window",
    "-omf=coff": "there is no COFF output; Microchip's tools read our ELF (-omf=elf)",
    "-mauxflash": "this device has no auxiliary flash",
    "-mpa": "procedural abstraction is not done here; -Os is the smallest code",
    "-shared": "there are no shared libraries on this device",
    "-fpic": "position-independent code is not supported",
    "-fPIC": "position-independent code is not supported",
    "-pg": "use the emulator's profiler",
}
LEVELS = {"-O": "1", "-O0": "0", "-O1": "1", "-O2": "2", "-O3": "2", "-Os": "s", "-Oz": "s", "-Og": "1"}
LANGUAGES = {"none", "c", "cpp-output", "c++", "c++-cpp-output", "assembler", "assembler-with-cpp", "ir"}
SUFFIX_LANGUAGE = {
    ".c": "c", ".i": "cpp-output", ".cpp": "c++", ".cc": "c++", ".cxx": "c++", ".C": "c++", ".ii": "c++-cpp-output",
    ".s": "assembler", ".asm": "assembler", ".S": "assembler-with-cpp", ".ll": "ir",
    ".bc": "ir", ".o": "object", ".obj": "object", ".a": "archive", ".elf": "object",
}  # fmt: skip


@dataclass(frozen=True)
class Input:
    """One input file. `language` is a value of SUFFIX_LANGUAGE or of -x."""

    path: Path
    language: str


@dataclass
class CcOptions:
    """The parsed command line. `level` is one of 0, 1, 2, s; `stage` one of preprocess, compile, assemble, link."""

    inputs: list[Input] = field(default_factory=list)
    output: Path | None = None
    stage: str = "link"
    level: str = "0"
    chip: Chip = field(default_factory=chip_named)
    debug: bool = False
    lto: bool | None = None
    emit_llvm: bool = False
    stack_check: bool = False
    verify: bool = field(default_factory=lambda: os.environ.get("DSPIC_VERIFY_MACHINE") == "1")
    single_constants: bool = False
    large_code: bool = False
    large_data: bool = False
    clang: list[str] = field(default_factory=list)
    dependency: list[str] = field(default_factory=list)
    linker: list[str] = field(default_factory=list)
    map_file: Path | None = None
    library_dirs: list[Path] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)
    runtime: bool = True
    startup: bool = True
    jobs: int = 0
    save_temps: bool = False
    verbose: bool = False
    action: str = "compile"

    @property
    def prefix_map(self) -> list[tuple[str, str]]:
        """Replacements (old, new) of path prefixes in debug information; the last matching one applies."""
        maps = ("-ffile-prefix-map=", "-fdebug-prefix-map=")
        pairs = [word.partition("=")[2].partition("=") for word in self.clang if word.startswith(maps)]
        return [(old, new) for old, _, new in pairs]

    @property
    def whole_program(self) -> bool:
        """Whether C inputs are merged into one module: when linking without -fno-lto."""
        return self.stage == "link" and self.lto is not False


class _ArgumentCursor:
    """Argument list with a cursor, so that options can consume the following word."""

    def __init__(self, words: list[str]) -> None:
        self.words = words
        self.at = 0

    def __bool__(self) -> bool:
        return self.at < len(self.words)

    def take(self) -> str:
        self.at += 1
        return self.words[self.at - 1]

    def value(self, option: str) -> str:
        if not self:
            raise ToolError(f"option '{option}' needs a value")
        return self.take()


def _expand_response_files(argv: list[str], depth: int = 0) -> list[str]:
    words: list[str] = []
    for word in argv:
        if not word.startswith("@") or len(word) == 1:
            words.append(word)
            continue
        if depth > 10:
            raise ToolError(f"response files nest too deeply at '{word}'")
        try:
            text = Path(word[1:]).read_text()
        except (OSError, UnicodeDecodeError) as error:
            raise ToolError(f"cannot read response file '{word[1:]}': {error}") from error
        if "\0" in text:
            raise ToolError(f"response file '{word[1:]}': holds a zero byte at offset {text.index(chr(0))}")
        try:
            inside = shlex.split(text)
        except ValueError as error:
            raise ToolError(f"response file '{word[1:]}': {str(error).lower()}") from None
        words += _expand_response_files(inside, depth + 1)
    return words


def _joined(word: str, option: str, words: _ArgumentCursor) -> str | None:
    """Value of an option written '-Lx' or '-L x'; None if `word` is another option."""
    if word == option:
        return words.value(option)
    return word[len(option) :] if word.startswith(option) else None


def parse(argv: list[str]) -> CcOptions:
    """Parse `argv` (without the program name). Raises ToolError that names the wrong word."""
    options = CcOptions()
    words = _ArgumentCursor(_expand_response_files(argv))
    language = "none"
    while words:
        word = words.take()
        if word == "-x":
            language = words.value("-x")
            if language not in LANGUAGES:
                raise ToolError(f"unknown language '{language}' after -x (expected {', '.join(sorted(LANGUAGES))})")
        elif not word.startswith("-"):
            options.inputs.append(_input(word, language))
        elif not (
            _stage(options, word)
            or _code_generation(options, word)
            or _linking(options, word, words)
            or _front_end(options, word, words)
            or _session(options, word, words)
        ):
            raise ToolError(f"unknown option '{word}' (see --help)")
    if options.action == "compile":
        _check(options)
    return options


def _input(word: str, language: str) -> Input:
    path = Path(word)
    known = SUFFIX_LANGUAGE.get(path.suffix)
    if language != "none":
        return Input(path, language)
    if known is None:
        raise ToolError(f"{word}: unknown kind of file (expected {' '.join(SUFFIX_LANGUAGE)}; or use -x)")
    return Input(path, known)


def _stage(options: CcOptions, word: str) -> bool:
    stages = {"-c": "assemble", "-S": "compile", "-E": "preprocess"}
    if word in stages:
        options.stage = stages[word]
    elif word == "-emit-llvm":
        options.emit_llvm = True
    elif word == "-fsyntax-only":
        options.stage = "preprocess"
        options.clang.append(word)
    elif word in PREPROCESS_ONLY_FLAGS:
        options.stage = "preprocess"
        options.dependency.append(word)
    else:
        return False
    return True


def _code_generation(options: CcOptions, word: str) -> bool:
    if word in REFUSED:
        raise ToolError(f"'{word}' is not supported: {REFUSED[word]}")
    if word in LEVELS:
        options.level = LEVELS[word]
    elif word in ("-g0", "-g", "-g1", "-g2", "-g3", "-ggdb") or word.startswith("-gdwarf"):
        options.debug = word != "-g0"
    elif word in ("-flto", "-fno-lto"):
        options.lto = word == "-flto"
    elif word in ("-fverify-machine", "-fno-verify-machine"):
        options.verify = word == "-fverify-machine"
    elif word in ("-fstack-check", "-fno-stack-check"):
        options.stack_check = word == "-fstack-check"
    elif word in ("-mlarge-code", "-msmall-code"):
        options.large_code = word == "-mlarge-code"
    elif word in LARGE_DATA | SMALL_DATA:
        options.large_data = word in LARGE_DATA
    elif word == "-omf=elf" or word.startswith(IGNORED_PREFIXES):
        pass
    elif word.startswith("-omf="):
        raise ToolError(f"'{word}': the output format is ELF (-omf=elf)")
    elif word == "-fsingle-precision-constant":
        options.single_constants = True
    elif word.startswith(("-mcpu=", "-p")) and word not in ("-pedantic", "-pedantic-errors", "-pipe"):
        options.chip = device(word.split("=", 1)[1] if "=" in word else word[2:])
    elif word in IGNORED_FLAGS:
        pass
    else:
        return False
    return True


def _linking(options: CcOptions, word: str, words: _ArgumentCursor) -> bool:
    if word in ("-Map", "--Map"):
        options.map_file = Path(words.value(word))
    elif word.startswith("-Wl,"):
        _linker_words(options, word[4:].split(","))
    elif word == "-Xlinker":
        _linker_words(options, [words.value(word)])
    elif (script := _joined(word, "-T", words)) is not None:
        _linker_words(options, [f"--script={script}"])
    elif word.startswith("-Wa,"):
        pass
    elif (directory := _joined(word, "-L", words)) is not None:
        options.library_dirs.append(Path(directory))
    elif (name := _joined(word, "-l", words)) is not None:
        options.libraries.append(name)
    elif word == "-nostdlib":
        options.runtime = options.startup = False
    elif word == "-nostartfiles":
        options.startup = False
    elif word == "-nodefaultlibs":
        options.runtime = False
    else:
        return False
    return True


def _linker_words(options: CcOptions, parts: list[str]) -> None:
    """Options of -Wl and -Xlinker; -Map is handled by the driver, which writes all outputs atomically."""
    rest = iter(parts)
    for part in rest:
        if part.startswith(("-Map=", "--Map=")):
            options.map_file = Path(part.split("=", 1)[1])
        elif part in ("-Map", "--Map"):
            options.map_file = Path(next(rest, ""))
        else:
            options.linker.append(part)


def _front_end(options: CcOptions, word: str, words: _ArgumentCursor) -> bool:
    if word in DEPENDENCY_VALUE_FLAGS:
        options.dependency += [word, words.value(word)]
    elif word in DEPENDENCY_FLAGS:
        options.dependency.append(word)
    elif word in VALUE_FLAGS:
        options.clang += [word, words.value(word)]
    elif word in CLANG_FLAGS or word.startswith(CLANG_PREFIXES):
        options.clang.append(word)
    else:
        return False
    return True


def _session(options: CcOptions, word: str, words: _ArgumentCursor) -> bool:
    if (path := _joined(word, "-o", words)) is not None:
        options.output = Path(path)
    elif (jobs := _joined(word, "-j", words)) is not None:
        if not jobs.isdigit() or int(jobs) < 1:
            raise ToolError(f"-j needs a positive number, not '{jobs}'")
        options.jobs = int(jobs)
    elif word in ("-save-temps", "--save-temps"):
        options.save_temps = True
    elif word in ("-v", "--verbose"):
        options.verbose = True
    elif word in ("--help", "-h"):
        options.action = "help"
    elif word == "--version":
        options.action = "version"
    else:
        return False
    return True


def _check(options: CcOptions) -> None:
    if not options.inputs:
        raise ToolError("no input files (see --help)")
    for item in options.inputs:
        if not item.path.exists():
            raise ToolError(f"{item.path}: no such file")
        if item.path.is_dir():
            raise ToolError(f"{item.path}: is a directory")
    if options.output is not None and options.stage != "link" and len(options.inputs) > 1:
        raise ToolError("-o with -c, -S or -E takes exactly one input file")
    if options.output is not None and not options.output.resolve().parent.is_dir():
        raise ToolError(f"{options.output}: folder {options.output.resolve().parent} does not exist")
    if options.output is not None and any(options.output.resolve() == item.path.resolve() for item in options.inputs):
        raise ToolError(f"{options.output}: the output would overwrite an input file")
