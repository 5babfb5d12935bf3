"""The compile process: reads LLVM IR and writes object files, so that compilation never stops the machine.

llvmlite holds a global lock while it compiles. A separate process keeps that lock away from the engine.
Messages on stdin: u32 ticket, u32 level, u32 length, IR text. Messages on stdout: u32 ticket, u32 length, object. If
LLVM rejects the IR, the length is 0xFFFFFFFF, followed by u32 length and an error message.
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
    """LLVM for the host, with one target machine for each optimisation level of the code generator."""

    def __init__(self) -> None:
        import llvmlite.binding as llvm

        self._llvm: Any = llvm
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        self._machines: dict[int, Any] = {}

    def machine(self, level: int) -> Any:
        """Return the host's target machine.

        Its code is position-independent, because objects are loaded at any address.
        """
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
        """Return a module's object code. Levels 0 and 1 run a short list of passes, the others all of LLVM's."""
        code: bytes = self.machine(level).emit_object(self._optimised(text, level))
        return code

    def assembly(self, text: str, level: int) -> str:
        """Return a module's host assembly, with block names in comments."""
        machine = self.machine(level)
        machine.set_asm_verbosity(True)
        code: str = machine.emit_assembly(self._optimised(text, level))
        return code

    def _optimised(self, text: str, level: int) -> Any:
        """Return the module after the optimisation passes of `level`."""
        llvm = self._llvm
        module = llvm.parse_assembly(text)
        machine = self.machine(level)
        builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=level))
        if level > 1:
            builder.getModulePassManager().run(module, builder)
            return module
        passes = llvm.create_new_module_pass_manager()
        passes.add_sroa_pass()
        if level == 1:
            passes.add_instruction_combine_pass()
        passes.add_simplify_cfg_pass()
        passes.run(module, builder)
        return module


def _exactly(stream: BinaryIO, count: int) -> bytes:
    data = stream.read(count)
    if len(data) != count:
        raise EOFError
    return data


def serve(source: BinaryIO, sink: BinaryIO) -> None:
    """Answer compile requests until the input ends."""
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
    os.nice(1)  # give the machine's process priority when cores are scarce
    try:
        serve(sys.stdin.buffer, sys.stdout.buffer)
    except BrokenPipeError:
        os._exit(0)  # the machine's process has ended; exit without flushing the output object
