"""`python -m toolchain cc`: compiler driver with gcc's interface, from C, assembly and objects to object, ELF or HEX.

Stages: front end (clang, in parallel) → merge and optimise (whole program) → `pipeline.compile_module` → assembler →
linker. Modules with a long import time are imported by their stage, so that `-E` and error messages are fast.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from emu.host.exit_status import BAD_INPUT, DONE, FAULT
from toolchain.errors import ToolError
from toolchain.files import read_bytes, read_text, write_outputs
from toolchain.frontend.options import HELP, CcOptions, Input, parse

if TYPE_CHECKING:
    from toolchain.asm.state import Options as AssemblerOptions
    from toolchain.driver.link_stage import LinkInput
    from toolchain.frontend.clang import ClangJob

FrontEnd = Callable[[CcOptions, Path], dict[Input, bytes]]
IR_SOURCES = {"c", "cpp-output", "c++", "c++-cpp-output"}
CXX_OF = {"c": "c++", "cpp-output": "c++-cpp-output"}
MAX_MIDDLE_END_RUNS = 4  # each run forbids the missing library functions that the previous run introduced


def main(argv: list[str], cxx: bool = False, front: FrontEnd | None = None) -> int:
    """Run the compiler driver on `argv` (without program name); return its exit status, also for bad input.

    With `cxx`, C sources are compiled as C++. `front` replaces `front_end` when files are compiled and linked together;
    a caller that builds the same sources several times can use it to cache the IR.
    """
    from toolchain.frontend.clang import ClangError

    try:
        options = parse(argv)
        if cxx:
            options.inputs = [Input(i.path, CXX_OF.get(i.language, i.language)) for i in options.inputs]
        if options.action == "help":
            sys.stdout.write(HELP)
        elif options.action == "version":
            _print_version()
        elif options.action == "print":
            print(options.printed)
        else:
            with tempfile.TemporaryDirectory(prefix="dspic-cc-") as scratch:
                try:
                    _run(options, Path(scratch), front or front_end)
                except ToolError as error:
                    raise _with_source_positions(options, error, Path(scratch)) from error
    except ClangError:
        return FAULT
    except RecursionError:
        print("error: types or expressions are nested too deeply", file=sys.stderr)
        return BAD_INPUT
    except ToolError as error:
        for finding in error.findings:
            print(finding if "error:" in finding else f"error: {finding}", file=sys.stderr)
        return BAD_INPUT
    return DONE


def _with_source_positions(options: CcOptions, error: ToolError, scratch: Path) -> ToolError:
    """`error` with source positions; the sources are compiled again with debug information if it has none."""
    from toolchain.driver.source_positions import concerns_generated_code, with_positions

    if not concerns_generated_code(error) or not any(item.language in IR_SOURCES for item in options.inputs):
        return error
    again = replace(options, debug=True, clang=[*options.clang, "-w"], dependency=[], map_file=None, verbose=False)
    if not options.debug and options.stage != "compile":
        try:
            _run(replace(again, output=scratch / "again.elf", save_temps=False), scratch, front_end)
        except ToolError as found:
            error = found
    return with_positions(error, lambda: (ir.decode() for ir in front_end(again, scratch).values()))


def _print_version() -> None:
    from importlib.metadata import version

    import llvmlite

    from emu.chips import NAMES

    print(f"dspic cc (openswarm {version('openswarm')}), clang from ziglang {version('ziglang')}, "
          f"llvmlite {llvmlite.__version__}")  # fmt: skip
    print(f"Target: {NAMES[0]}")


def _run(options: CcOptions, scratch: Path, front: FrontEnd) -> None:
    if options.stage == "preprocess":
        _preprocess(options)
    elif options.stage == "link":
        from toolchain.driver.link_stage import link_program

        link_program(options, _compile_program(options, scratch, front))
    else:
        modules = front_end(options, scratch)
        outputs = [_translate(options, item, modules, scratch) for item in options.inputs]
        write_outputs(outputs)


def _preprocess(options: CcOptions) -> None:
    from toolchain.frontend.clang import preprocess_job, run_jobs

    jobs = [preprocess_job(options, item, options.output) for item in options.inputs
            if item.language in IR_SOURCES | {"assembler-with-cpp"}]  # fmt: skip
    run_jobs(jobs, options.jobs, options.verbose)


def front_end(options: CcOptions, scratch: Path) -> dict[Input, bytes]:
    """Unoptimised IR of every input except assembly and objects. All C files are compiled before an error is raised."""
    from toolchain.driver.whole_program import is_bitcode
    from toolchain.frontend.clang import ir_job

    sources = [item for item in options.inputs if item.language in IR_SOURCES]
    for item in sources:
        if item.path.is_fifo():
            raise ToolError(f"{item.path}: is a pipe; expected a file, because a source is read several times")
    jobs = {item: ir_job(options, item, scratch / f"{number}.front.ll") for number, item in enumerate(sources)}
    compiled = _compile(options, jobs)
    modules: dict[Input, bytes] = {}
    for item in options.inputs:
        if item in compiled:
            modules[item] = compiled[item]
        elif item.language in ("ir", "object"):
            content = read_bytes(item.path)
            if item.language == "ir" or is_bitcode(content):
                modules[item] = content
    return modules


def _compile(options: CcOptions, jobs: dict[Input, ClangJob]) -> dict[Input, bytes]:
    """IR of the sources of front-end jobs; with -fcache-ir, that of unchanged C files is read from the cache."""
    from toolchain.driver.ir_cache import IrCache, dependency_flags, is_cacheable
    from toolchain.frontend.clang import run_jobs

    if not jobs:
        return {}
    cached = {item: job for item, job in jobs.items() if is_cacheable(options, item)}
    if not cached:
        run_jobs(list(jobs.values()), options.jobs, options.verbose)
        return {item: _ir_of(options, job) for item, job in jobs.items()}
    cache = IrCache()
    found = {item: ir for item, job in cached.items() if (ir := cache.find(job)) is not None}
    rules = {item: job.output.with_suffix(".d") for item, job in cached.items()}
    missing = {item: job for item, job in jobs.items() if item not in found}
    described = [replace(job, arguments=[*dependency_flags(rules[item]), *job.arguments]) if item in cached else job
                 for item, job in missing.items()]  # fmt: skip
    quiet = run_jobs(described, options.jobs)
    for (item, job), is_quiet in zip(missing.items(), quiet, strict=True):
        found[item] = _ir_of(options, job)
        if item in cached and is_quiet:
            cache.add(job, os.fsdecode(rules[item].read_bytes()), found[item])
    return found


def _ir_of(options: CcOptions, job: ClangJob) -> bytes:
    """IR of the source of a front-end job that has run."""
    from toolchain.abi.struct_alignment import mark
    from toolchain.frontend import short_double
    from toolchain.frontend.clang import with_i32_levels
    from toolchain.frontend.externally_initialised import mark_externally_initialised

    layouts = job.output.with_suffix(".layouts").read_text(errors="replace")
    text = with_i32_levels(job.output.read_bytes())
    text = short_double.rename(text) if options.short_double else text
    return mark(mark_externally_initialised(text), layouts)


def optimise(options: CcOptions, ir: bytes, scratch: Path) -> str:
    """Run clang's middle end on a module (text or bitcode) and return the optimised IR text.

    The middle end may replace a loop by a library function. If the run-time library does not contain the function, the
    middle end runs again without it.
    """
    from toolchain.driver.whole_program import functions_declared, without_builtins
    from toolchain.frontend.clang import optimise_job, run_jobs

    for _ in range(MAX_MIDDLE_END_RUNS):
        handle, before = tempfile.mkstemp(suffix=".ll", dir=scratch)
        os.write(handle, ir)
        os.close(handle)
        after = Path(before).with_suffix(".opt.ll")
        run_jobs([optimise_job(options, Path(before), after)], 1, options.verbose)
        text = after.read_text()
        introduced = functions_declared(text) - functions_declared(ir.decode(errors="replace"))
        if not options.runtime or not introduced:
            break
        from toolchain.driver.runtime_archive import defined_names, library

        absent = introduced - {name[1:] for name in defined_names(library(object_of, options.jobs))}
        if not absent:
            break
        ir = without_builtins(ir, absent)
    return text


def _to_assembly(options: CcOptions, ir_text: str) -> str:
    from toolchain.abi.isr_names import check
    from toolchain.driver import pipeline
    from toolchain.ir.model import UnsupportedError

    check(ir_text, lambda ref: pipeline.position_in(ir_text, ref))
    try:
        return pipeline.compile_module(ir_text, options) + _formats(options) + _double_mark(options)
    except UnsupportedError as error:
        if re.search(r":\d+$", error.where):
            raise ToolError.of([f"{error.where}: error: not supported: {error.what}"]) from error
        raise ToolError(f"not supported: {error}") from error


def _double_mark(options: CcOptions) -> str:
    """Assembly of the symbol that marks objects whose double has 32 bits."""
    from toolchain.frontend.short_double import MARK

    return f"\t.weak {MARK}\n\t.set {MARK},1\n" if options.short_double else ""


def _formats(options: CcOptions) -> str:
    """Assembly of the formats of -msmart-io-format=, which the link stage reads like those of the program."""
    if not options.io_formats:
        return ""
    strings = [",".join(map(str, text.encode() + b"\0")) for text in options.io_formats]
    return "\t.section .smartio,psv,page\n" + "".join(f"\t.byte {text}\n" for text in strings)


def assembler_options(options: CcOptions, compiled: bool) -> AssemblerOptions:
    """Options of the assembler. Only branches of compiled code are relaxed (shortened), as in XC16 (abi-elf.md §5)."""
    from toolchain.arguments import definition
    from toolchain.asm.state import Options

    folders = [word[2:] for word in options.clang if word.startswith("-I") and len(word) > 2]
    folders += [b for a, b in zip(options.clang, options.clang[1:], strict=False) if a == "-I"]
    defined = dict(map(definition, options.asm_define))
    return Options(include=folders + options.asm_include, define=defined, relax=compiled, compiled=compiled,
                   debug=options.debug, chip=options.chip, prefix_map=options.prefix_map)  # fmt: skip


def _assemble(options: CcOptions, text: str, name: str, compiled: bool) -> bytes:
    """Assemble a text; return the content of the object file."""
    from toolchain.asm.assemble import assemble
    from toolchain.elf.write import object_bytes

    obj, messages = assemble(text, name, assembler_options(options, compiled))
    for message in messages:
        print(message, file=sys.stderr)
    return object_bytes(obj)


def _assembly_text(options: CcOptions, item: Input, scratch: Path) -> str:
    """Text of an assembly input; `.S` files are preprocessed."""
    if item.language == "assembler":
        return read_text(item.path)
    from toolchain.frontend.clang import preprocess_job, run_jobs

    target = scratch / f"{item.path.name}.i"
    run_jobs([preprocess_job(options, item, target)], 1)
    return target.read_text()


def object_of(options: CcOptions, item: Input, scratch: Path) -> bytes:
    """Object file of one C, IR or assembly input."""
    modules = front_end(replace(options, inputs=[item]), scratch)
    return _object(options, item, modules, scratch)


def _object(options: CcOptions, item: Input, modules: dict[Input, bytes], scratch: Path) -> bytes:
    if item in modules:
        text = _to_assembly(options, optimise(options, modules[item], scratch))
        return _assemble(options, text, item.path.name, compiled=True)
    if item.language == "object":
        return read_bytes(item.path)
    return _assemble(options, _assembly_text(options, item, scratch), str(item.path), compiled=False)


def _translate(options: CcOptions, item: Input, modules: dict[Input, bytes], scratch: Path) -> tuple[Path, bytes]:
    """Path and content of the output of one input for -c and -S."""
    if item.language in ("object", "archive"):
        raise ToolError(f"{item.path}: nothing to compile: -c and -S take sources")
    if options.stage == "assemble" and options.lto and item in modules:
        from toolchain.driver.whole_program import read_module

        return _output(options, item, ".o"), read_module(item.path, modules[item]).as_bitcode()
    if options.stage == "assemble":
        return _output(options, item, ".o"), _object(options, item, modules, scratch)
    if item not in modules:
        return _output(options, item, ".s"), _assembly_text(options, item, scratch).encode()
    ir_text = optimise(options, modules[item], scratch)
    if options.emit_llvm:
        return _output(options, item, ".ll"), ir_text.encode()
    return _output(options, item, ".s"), _to_assembly(options, ir_text).encode()


def _output(options: CcOptions, item: Input, suffix: str) -> Path:
    return options.output or Path(item.path.stem + suffix)


def _compile_program(options: CcOptions, scratch: Path, front: FrontEnd) -> LinkInput:
    """Input of the linker: objects in command line order, the object of the merged C files last, and archives."""
    from toolchain.driver.link_stage import LinkInput, find_library, output_path
    from toolchain.driver.runtime_archive import library, short_double_library
    from toolchain.frontend.short_double import MARK

    modules = front(options, scratch)
    program = LinkInput(runtime=library(object_of, options.jobs) if options.runtime or options.startup else b"")
    for item in options.inputs:
        if item.language == "archive":
            program.archives.append((str(item.path), read_bytes(item.path)))
        elif item not in modules or not options.whole_program:
            program.objects.append((str(item.path), _object(options, item, modules, scratch)))
    program.archives += [archive for name in options.libraries if (archive := find_library(options, name))]
    if modules and options.whole_program:
        merged = _merge(modules, program)
        if "-w" not in options.clang and options.level != "0":  # without optimisation, every access reads memory
            for finding in _polled_flags(options, merged, program, scratch):
                print(finding, file=sys.stderr)
        ir_text = optimise(options, merged, scratch)
        assembly = _to_assembly(options, ir_text)
        if options.save_temps:
            base = output_path(options)
            write_outputs([(base.with_suffix(".ll"), ir_text.encode()), (base.with_suffix(".s"), assembly.encode())])
        name = next(iter(modules)).path.name if len(modules) == 1 else "program.c"
        program.objects.append((name, _assemble(options, assembly, name, compiled=True)))
    if program.runtime and any(MARK.encode() in content for _, content in program.objects):
        program.runtime = short_double_library(program.runtime, object_of)
    return program


def _polled_flags(options: CcOptions, merged: bytes, program: LinkInput, scratch: Path) -> list[str]:
    """Warnings about polled flags with their positions; the sources are compiled again if they have no positions."""
    from toolchain.driver.pipeline import position_in
    from toolchain.frontend import polled_flags

    text = merged.decode()
    found = polled_flags.findings(text, lambda reference: position_in(text, reference))
    if not found or options.debug:
        return found
    again = replace(options, debug=True, clang=[*options.clang, "-w"], dependency=[], verbose=False)
    located = _merge(front_end(again, scratch), program).decode()
    return polled_flags.findings(located, lambda reference: position_in(located, reference))


def _merge(modules: dict[Input, bytes], program: LinkInput) -> bytes:
    """Merge all C inputs; symbols that assembly, archives and the library do not name become internal."""
    from toolchain.driver.runtime_archive import defined_names
    from toolchain.driver.whole_program import internalise, merge, names_used, read_module
    from toolchain.elf.archive import open_archive

    module = merge([(item.path, read_module(item.path, content)) for item, content in modules.items()])
    outside = names_used(program.objects)
    for name, content in program.archives:
        outside |= names_used([(member.name, member.data) for member in open_archive(content, name).members])
    if program.runtime:
        outside |= defined_names(program.runtime)
    internalise(module, outside)
    return str(module).encode()
