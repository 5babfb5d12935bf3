"""`python -m toolchain cc`: C, assembly and objects in; object, ELF or Intel HEX out, used like gcc.

Stages: front end (clang, in parallel) → merge and optimise (whole program) → `pipeline.compile_module` → assembler →
linker. Heavy parts are imported when their stage runs, so that `-E` and error messages come at once.
"""

from __future__ import annotations

import os
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
    from toolchain.driver.link_stage import Program

FrontEnd = Callable[[CcOptions, Path], dict[Input, bytes]]
IR_SOURCES = {"c", "cpp-output", "c++", "c++-cpp-output"}
CXX_OF = {"c": "c++", "cpp-output": "c++-cpp-output"}
MAX_INVENTIONS = 4  # runs of the middle end; each forbids what the one before made up


def main(argv: list[str], cxx: bool = False, front: FrontEnd | None = None) -> int:
    """Run the compiler driver on `argv` (without program name); return the exit status, never raise on bad input.

    With `cxx` C sources are compiled as C++. `front` stands for `front_end` where files are compiled and linked at
    once: who builds the same sources in several ways can keep what it gave.
    """
    from toolchain.frontend.clang import CompileError

    try:
        options = parse(argv)
        if cxx:
            options.inputs = [Input(i.path, CXX_OF.get(i.language, i.language)) for i in options.inputs]
        if options.action == "help":
            sys.stdout.write(HELP)
        elif options.action == "version":
            _print_version()
        else:
            with tempfile.TemporaryDirectory(prefix="dspic-cc-") as scratch:
                try:
                    _run(options, Path(scratch), front or front_end)
                except ToolError as error:
                    raise _explained(options, error, Path(scratch)) from error
    except CompileError:
        return FAULT
    except RecursionError:
        print("error: types or expressions are nested too deeply", file=sys.stderr)
        return BAD_INPUT
    except ToolError as error:
        for finding in error.findings:
            print(finding if "error:" in finding else f"error: {finding}", file=sys.stderr)
        return BAD_INPUT
    return DONE


def _explained(options: CcOptions, error: ToolError, scratch: Path) -> ToolError:
    """`error` with source lines, found by compiling once more with debug information where it helps."""
    from toolchain.driver.source_places import concerns_generated_code, with_places

    if not concerns_generated_code(error) or not any(item.language in IR_SOURCES for item in options.inputs):
        return error
    again = replace(options, debug=True, clang=[*options.clang, "-w"], dependency=[], map_file=None, verbose=False)
    if not options.debug and options.stage != "compile":
        try:
            _run(replace(again, output=scratch / "again.elf", save_temps=False), scratch, front_end)
        except ToolError as found:
            error = found
    return with_places(error, lambda: (ir.decode() for ir in front_end(again, scratch).values()))


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
    """Unoptimised IR of every input that has any; all C files are compiled before an error ends the run."""
    from toolchain.abi.struct_alignment import mark
    from toolchain.driver.whole_program import is_bitcode
    from toolchain.frontend.clang import ir_job, repaired, run_jobs
    from toolchain.frontend.uninitialised import marked

    sources = [item for item in options.inputs if item.language in IR_SOURCES]
    targets = {item: scratch / f"{number}.front.ll" for number, item in enumerate(sources)}
    if targets:
        run_jobs([ir_job(options, item, target) for item, target in targets.items()], options.jobs, options.verbose)
    modules: dict[Input, bytes] = {}
    for item in options.inputs:
        if item in targets:
            layouts = targets[item].with_suffix(".layouts").read_text(errors="replace")
            modules[item] = mark(marked(repaired(targets[item].read_bytes())), layouts)
        elif item.language in ("ir", "object"):
            content = read_bytes(item.path)
            if item.language == "ir" or is_bitcode(content):
                modules[item] = content
    return modules


def optimise(options: CcOptions, ir: bytes, scratch: Path) -> str:
    """Clang's middle end over a module (text or bitcode).

    It may recognise a loop as a library function. When the run-time library has no such function, it must not, and
    runs once more.
    """
    from toolchain.driver.whole_program import functions_declared, without_builtins
    from toolchain.frontend.clang import optimise_job, run_jobs

    for _ in range(MAX_INVENTIONS):
        handle, before = tempfile.mkstemp(suffix=".ll", dir=scratch)
        os.write(handle, ir)
        os.close(handle)
        after = Path(before).with_suffix(".opt.ll")
        run_jobs([optimise_job(options, Path(before), after)], 1, options.verbose)
        text = after.read_text()
        invented = functions_declared(text) - functions_declared(ir.decode(errors="replace"))
        if not options.runtime or not invented:
            break
        from toolchain.driver.runtime_archive import defined_names, library

        absent = invented - {name[1:] for name in defined_names(library(object_of, options.jobs))}
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
        return pipeline.compile_module(ir_text, options)
    except UnsupportedError as error:
        raise ToolError(f"not supported: {error}") from error


def assembler_options(options: CcOptions, compiled: bool) -> AssemblerOptions:
    """What the assembler gets. Branch shortening only for compiled code, as XC16's driver does (abi-elf.md §5)."""
    from toolchain.asm.state import Options

    folders = [word[2:] for word in options.clang if word.startswith("-I") and len(word) > 2]
    folders += [b for a, b in zip(options.clang, options.clang[1:], strict=False) if a == "-I"]
    return Options(include=folders, relax=compiled, compiled=compiled, debug=options.debug, chip=options.chip,
                   prefix_map=options.prefix_map)  # fmt: skip


def _assemble(options: CcOptions, text: str, name: str, compiled: bool) -> bytes:
    """Object bytes."""
    from toolchain.asm.assemble import assemble
    from toolchain.elf.write import object_bytes

    obj, messages = assemble(text, name, assembler_options(options, compiled))
    for message in messages:
        print(message, file=sys.stderr)
    return object_bytes(obj)


def _assembly_text(options: CcOptions, item: Input, scratch: Path) -> str:
    """Text of an assembly input, preprocessed when it is one of the `.S` kind."""
    if item.language == "assembler":
        return read_text(item.path)
    from toolchain.frontend.clang import preprocess_job, run_jobs

    target = scratch / f"{item.path.name}.i"
    run_jobs([preprocess_job(options, item, target)], 1)
    return target.read_text()


def object_of(options: CcOptions, item: Input, scratch: Path) -> bytes:
    """Native object of one C, IR or assembly input."""
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
    """Output file of one input for -c and -S."""
    if item.language in ("object", "archive"):
        raise ToolError(f"{item.path}: nothing to compile here (-c and -S take sources)")
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


def _compile_program(options: CcOptions, scratch: Path, front: FrontEnd) -> Program:
    """Everything the linker needs: native objects in command-line order, merged C code last, archives."""
    from toolchain.driver.link_stage import Program, find_library, output_path
    from toolchain.driver.runtime_archive import library
    from toolchain.frontend import polled_flags

    modules = front(options, scratch)
    program = Program(runtime=library(object_of, options.jobs) if options.runtime or options.startup else b"")
    for item in options.inputs:
        if item.language == "archive":
            program.archives.append((str(item.path), read_bytes(item.path)))
        elif item not in modules or not options.whole_program:
            program.objects.append((str(item.path), _object(options, item, modules, scratch)))
    program.archives += [archive for name in options.libraries if (archive := find_library(options, name))]
    if modules and options.whole_program:
        merged = _merge(modules, program)
        if "-w" not in options.clang:
            for finding in polled_flags.findings(merged.decode()):
                print(finding, file=sys.stderr)
        ir_text = optimise(options, merged, scratch)
        assembly = _to_assembly(options, ir_text)
        if options.save_temps:
            base = output_path(options)
            write_outputs([(base.with_suffix(".ll"), ir_text.encode()), (base.with_suffix(".s"), assembly.encode())])
        name = next(iter(modules)).path.name if len(modules) == 1 else "program.c"
        program.objects.append((name, _assemble(options, assembly, name, compiled=True)))
    return program


def _merge(modules: dict[Input, bytes], program: Program) -> bytes:
    """One module of all C inputs, with everything internal that assembly, archives and the library do not name."""
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
