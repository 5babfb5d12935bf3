"""Command line of `python -m toolchain cc`: parses an argument list to CcOptions.

`option_table` says which options exist and what becomes of each. The parser reads no files except @response files.
"""

from __future__ import annotations

import os
import re
import shlex
import sys
from dataclasses import dataclass, field
from pathlib import Path

from emu.chips import chip_named
from emu.chips.chip import Chip
from emu.host.files import read_file
from toolchain.device_names import device
from toolchain.errors import ToolError
from toolchain.frontend.option_table import CLANG, IGNORED, REFUSED, OptionRow, row_of

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
  -fshort-double        double has 32 bits, as by default with XC16 (here: 64); long double, too
  --xc16-defaults       XC16's defaults: -fshort-double; also for the program under the name xc16-gcc
  -fsingle-precision-constant   unsuffixed floating constants are float
  -mlarge-code          two-word calls, which reach all of the flash (default -msmall-code: RCALL, +-32 K words)
  -ffile-prefix-map=OLD=NEW   paths that begin with OLD are recorded as NEW (debug information and __FILE__)
  -mlarge-data          only variables with attribute near are near (default -msmall-data: objects up to 64 bytes are
                        near); -mlarge-scalar and -mlarge-aggregate have the same effect
  -fno-omit-frame-pointer   LNK, ULNK and W14 in every function (default at -O0; -fomit-frame-pointer: where needed)
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
  -Wa,OPTION and -Xassembler OPTION pass options to the assembler
  -fcache-ir            keep the IR of each C file in the cache, and reuse it while file, headers and flags are the same
  -j N                  parallel front-end jobs (default: one per core)
  -save-temps           keep PROGRAM.ll and PROGRAM.s in the folder of the output
  -v  --version  --help

The options of gcc and XC16 that are not listed here are in docs/xc16-options.md, with the reason if one has no effect.

example: python -m toolchain cc -Os -g -Wall main.c switch.s -o firmware.elf
exit status: 0 done, 1 errors in the C source, 2 other errors; after an error there is no output file
"""

DEPENDENCY_VALUE_FLAGS = {"-MF", "-MT", "-MQ"}
DEPENDENCY_FLAGS = {"-MD", "-MMD", "-MP", "-MG"}
PREPROCESS_ONLY_FLAGS = {"-M", "-MM"}
LARGE_DATA = {"-mlarge-data", "-mlarge-scalar", "-mlarge-aggregate"}
SMALL_DATA = {"-msmall-data", "-msmall-scalar", "-msmall-aggregate"}
ASSEMBLER_IGNORED = re.compile(
    r"-a[a-z]*(?:=.*)?|-g|-v|-W|-L|--(?:no-)?relax|--keep-locals|--(?:no-|fatal-)?warn(?:ings)?|-omf=elf|-p=.*|-mdfp=.*"
)
"""Options of -Wa that do not change the object: listings, messages, and the form of branches in the user's assembly."""
LEVELS = {"-O": "1", "-O0": "0", "-O1": "1", "-O2": "2", "-O3": "2", "-Os": "s", "-Oz": "s", "-Og": "1", "-Ofast": "2"}
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
    keep_frame_pointer: bool | None = None  # -fno-omit-frame-pointer, -fomit-frame-pointer
    short_double: bool = False
    large_code: bool = False
    large_data: bool = False
    clang: list[str] = field(default_factory=list)
    dependency: list[str] = field(default_factory=list)
    linker: list[str] = field(default_factory=list)
    asm_define: list[str] = field(default_factory=list)  # NAME=VALUE, from -Wa,--defsym
    asm_include: list[str] = field(default_factory=list)
    io_formats: list[str] = field(default_factory=list)  # formats of -msmart-io-format=
    own_headers: bool = True
    map_file: Path | None = None
    library_dirs: list[Path] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)
    runtime: bool = True
    startup: bool = True
    jobs: int = 0
    cache_ir: bool = False
    save_temps: bool = False
    verbose: bool = False
    action: str = "compile"
    printed: str = ""  # text that the action "print" prints

    @property
    def prefix_map(self) -> list[tuple[str, str]]:
        """Replacements (old, new) of path prefixes in debug information; the last matching one applies."""
        maps = ("-ffile-prefix-map=", "-fdebug-prefix-map=")
        pairs = [word.partition("=")[2].partition("=") for word in self.clang if word.startswith(maps)]
        return [(old, new) for old, _, new in pairs]

    @property
    def frame_pointer(self) -> bool:
        """Whether every function has a frame with LNK and ULNK: at -O0 by default, as with XC16."""
        return self.level == "0" if self.keep_frame_pointer is None else self.keep_frame_pointer

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

    def insert(self, words: list[str]) -> None:
        """Insert `words` before the next argument."""
        self.words[self.at : self.at] = words

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
            text = read_file(word[1:]).decode()
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise ToolError(f"cannot read response file '{word[1:]}': {reason}") from error
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
        if not word.startswith("-"):
            options.inputs.append(_input(word, language))
            continue
        row = row_of(word)
        if row is None:
            raise ToolError(f"unknown option '{word}' (see --help)")
        if row.effect == REFUSED:
            raise ToolError(f"'{word}' is not supported: {row.note}")
        if row.effect == IGNORED:
            if row.takes_next_word or word == row.spelling.partition("[ ]<")[0] != row.spelling:
                words.value(word)
        elif (named := _joined(word, "-x", words)) is not None:
            language = named
            if language not in LANGUAGES:
                raise ToolError(f"unknown language '{language}' after -x (expected {', '.join(sorted(LANGUAGES))})")
        elif row.effect == CLANG:
            _front_end(options, word, words, row)
        elif not (
            _stage(options, word)
            or _code_generation(options, word)
            or _linking(options, word, words)
            or _tools(options, word, words)
            or _session(options, word, words)
        ):
            raise AssertionError(f"the table accepts {word}, but no function handles it")
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
    else:
        return False
    return True


def _code_generation(options: CcOptions, word: str) -> bool:
    if word.startswith("-O"):
        if word not in LEVELS:
            raise ToolError(f"unknown level '{word}' (expected {', '.join(LEVELS)})")
        options.level = LEVELS[word]
        if word == "-Ofast":
            options.clang.append("-ffast-math")
    elif word in ("-g0", "-g", "-g1", "-g2", "-g3", "-ggdb") or word.startswith("-gdwarf"):
        options.debug = word != "-g0"
    elif word.startswith("-g"):
        raise ToolError(f"unknown debug level '{word}' (expected -g, -g0 to -g3, -ggdb or -gdwarf)")
    elif word.startswith(("-flto", "-fno-lto")):
        options.lto = word.startswith("-flto")
    elif word in ("-fcache-ir", "-fno-cache-ir"):
        options.cache_ir = word == "-fcache-ir"
    elif word in ("-fverify-machine", "-fno-verify-machine"):
        options.verify = word == "-fverify-machine"
    elif word in ("-fshort-double", "-fno-short-double"):
        options.short_double = word == "-fshort-double"
    elif word == "--xc16-defaults":
        options.short_double = True
    elif word in ("-fomit-frame-pointer", "-fno-omit-frame-pointer"):
        options.keep_frame_pointer = word == "-fno-omit-frame-pointer"
    elif word in ("-fstack-check", "-fno-stack-check"):
        options.stack_check = word == "-fstack-check"
    elif word in ("-mlarge-code", "-msmall-code"):
        options.large_code = word == "-mlarge-code"
    elif word in LARGE_DATA | SMALL_DATA:
        options.large_data = word in LARGE_DATA
    elif word.startswith("-msmart-io-format="):
        options.io_formats.append(word.partition("=")[2].strip('"'))
    elif word in ("-ext=cci", "-mcci"):
        options.clang.append("-D__CCI__=1")
    elif word == "-nostdinc":
        options.own_headers = False
    elif word == "-fsingle-precision-constant":
        options.single_constants = True
    elif word.startswith("-mcpu=") or (word.startswith("-p") and not word.startswith("-print-")):
        options.chip = device(word.split("=", 1)[1] if "=" in word else word[2:])
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
    elif word == "-u":
        options.linker += [word, words.value(word)]
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
        if not part:  # MPLAB X writes -Wl,,,--defsym=...
            continue
        if part.startswith(("-Map=", "--Map=")):
            options.map_file = Path(part.split("=", 1)[1])
        elif part in ("-Map", "--Map"):
            options.map_file = Path(next(rest, ""))
        elif part.startswith("-L"):
            options.library_dirs.append(Path(part[2:] or next(rest, "")))
        elif part.startswith("-l"):
            options.libraries.append(part[2:] or next(rest, ""))
        else:
            options.linker.append(part)


def _tools(options: CcOptions, word: str, words: _ArgumentCursor) -> bool:
    """Options for the preprocessor and the assembler, and queries: -print-... and -dump..."""
    if word.startswith("-Wp,"):
        inside = word[4:].split(",")
        words.insert([*inside[:1], "-MF", *inside[1:]] if inside[0] in ("-MD", "-MMD") and inside[1:] else inside)
    elif word == "-Xpreprocessor":
        words.insert([words.value(word)])
    elif word.startswith("-Wa,"):
        _assembler_words(options, word[4:].split(","))
    elif word == "-Xassembler":
        _assembler_words(options, [words.value(word)])
    elif word.startswith(("-print-", "-dump")):
        options.action, options.printed = "print", _answer(word)
    else:
        return False
    return True


def _assembler_words(options: CcOptions, parts: list[str]) -> None:
    """Options of -Wa. Raise ToolError for one that is unknown."""
    rest = iter(parts)
    for part in rest:
        if part in ("--defsym", "-I", "-MD"):
            value = next(rest, "")
            part = f"{part}={value}" if part == "--defsym" else part + value
        if part.startswith("--defsym="):
            options.asm_define.append(part.partition("=")[2])
        elif part.startswith("-I"):
            options.asm_include.append(part[2:])
        elif part and not part.startswith("-MD") and not ASSEMBLER_IGNORED.fullmatch(part):
            raise ToolError(f"unknown option '{part}' of the assembler (-Wa): see `python -m toolchain as --help`")


def _answer(word: str) -> str:
    """The text that a question such as -print-prog-name=as prints, as gcc answers it."""
    name, _, value = word.partition("=")
    programs, package = Path(sys.executable).parent, Path(__file__).parents[1]
    if name == "-print-prog-name":
        program = programs / f"dspic-{'cc' if value in ('gcc', 'cc1', 'cc') else value}"
        return str(program) if program.exists() else value
    if name == "-print-file-name":
        found = [path for folder in ("include", "runtime") if (path := package / folder / value).exists()]
        return str(found[0]) if found else value
    if name == "-print-search-dirs":
        return f"install: {package}\nprograms: ={programs}\nlibraries: ={package / 'runtime'}"
    answers = {"-print-libgcc-file-name": "libdspic.a", "-print-multi-lib": ".;", "-dumpmachine": "pic30-elf"}
    if name in answers:
        return answers[name]
    from importlib.metadata import version  # imported only here: it takes as long as a short run

    return version("openswarm")


def _front_end(options: CcOptions, word: str, words: _ArgumentCursor, row: OptionRow) -> None:
    """An option for clang, with its value if that is the next argument."""
    values = row.takes_next_word or word == row.spelling.partition("[ ]<")[0] != row.spelling
    parts = [word, words.value(word)] if values else [word]
    if word in PREPROCESS_ONLY_FLAGS:
        options.stage = "preprocess"
    if word in DEPENDENCY_VALUE_FLAGS | DEPENDENCY_FLAGS | PREPROCESS_ONLY_FLAGS:
        options.dependency += parts
    else:
        options.clang += parts


def _session(options: CcOptions, word: str, words: _ArgumentCursor) -> bool:
    if (path := _joined(word, "-o", words)) is not None:
        options.output = Path(path)
    elif (jobs := _joined(word, "-j", words)) is not None:
        if not jobs.isdigit() or int(jobs) < 1:
            raise ToolError(f"-j needs a positive number, not '{jobs}'")
        options.jobs = int(jobs)
    elif word.startswith(("-save-temps", "--save-temps")):
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
