"""The compile process: LLVM IR text in, object file out, so that translation never stops the machine.

llvmlite holds one global lock while it compiles; a process of its own keeps that lock away from the engine.
Messages on stdin: u32 ticket, u32 level, u32 length, IR text. On stdout: u32 ticket, u32 length, object
(length 0xFFFFFFFF: LLVM refused; then u32 length and its message).
"""

from __future__ import annotations

import os
import struct
import sys
from typing import Any, BinaryIO, Final

REQUEST: Final = struct.Struct("<III")
REPLY: Final = struct.Struct("<II")
REFUSED: Final = 0xFFFF_FFFF


class Backend:
    """LLVM set up for the host: one target machine per optimisation level of the code generator."""

    def __init__(self) -> None:
        import llvmlite.binding as llvm

        self._llvm: Any = llvm
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        self._machines: dict[int, Any] = {}

    def machine(self, level: int) -> Any:
        """The host's target machine; position-independent, as objects are loaded anywhere."""
        if level not in self._machines:
            llvm = self._llvm
            self._machines[level] = llvm.Target.from_default_triple().create_target_machine(
                cpu=llvm.get_host_cpu_name(),
                features=llvm.get_host_cpu_features().flatten(),
                opt=level,
                reloc="pic",
                codemodel="small",
            )
        return self._machines[level]

    def compile(self, text: str, level: int) -> bytes:
        """Object code for a module. Level 0 is for code that runs once; level 2 runs the short pass list."""
        code: bytes = self.machine(level).emit_object(self._optimised(text, level))
        return code

    def assembly(self, text: str, level: int) -> str:
        """The same as the host's assembly, blocks named in comments."""
        machine = self.machine(level)
        machine.set_asm_verbosity(True)
        code: str = machine.emit_assembly(self._optimised(text, level))
        return code

    def _optimised(self, text: str, level: int) -> Any:
        """The module behind the passes of `level`."""
        llvm = self._llvm
        module = llvm.parse_assembly(text)
        machine = self.machine(level)
        builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=level))
        passes = llvm.create_new_module_pass_manager()
        if level == 0:
            passes.add_sroa_pass()
            passes.add_simplify_cfg_pass()
        else:  # the design's measured choice: a quarter of the time of O2 for 7 % of its speed
            passes.add_sroa_pass()
            passes.add_instruction_combine_pass()
            passes.add_simplify_cfg_pass()
            passes.add_new_gvn_pass()
            passes.add_instruction_combine_pass()
            passes.add_simplify_cfg_pass()
            passes.add_sinking_pass()
            passes.add_aggressive_dce_pass()
        passes.run(module, builder)
        return module


def _exactly(stream: BinaryIO, count: int) -> bytes:
    data = stream.read(count)
    if len(data) != count:
        raise EOFError
    return data


def serve(source: BinaryIO, sink: BinaryIO) -> None:
    """Answer requests until the other end closes."""
    backend = Backend()
    while True:
        try:
            ticket, level, length = REQUEST.unpack(_exactly(source, REQUEST.size))
            text = _exactly(source, length).decode()
        except EOFError:
            return
        try:
            code = backend.compile(text, level)
            sink.write(REPLY.pack(ticket, len(code)) + code)
        except RuntimeError as error:
            message = str(error).encode()
            sink.write(REPLY.pack(ticket, REFUSED) + struct.pack("<I", len(message)) + message)
        sink.flush()


if __name__ == "__main__":
    os.nice(1)  # the machine itself comes first when cores are short
    try:
        serve(sys.stdin.buffer, sys.stdout.buffer)
    except BrokenPipeError:
        os._exit(0)  # the machine has ended and nobody waits for the object; do not flush it once more
