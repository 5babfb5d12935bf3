"""One debugging session: requests of a client become acts of the debuggee, its halts become events.

What enters: a channel to the client, what makes a machine from launch arguments. What leaves: nothing but messages.
Between two slices of a run the inbox is looked at, so everything but what needs a standing machine is answered while it
runs.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from emu.dap.debuggee import Debuggee, Halt
from emu.dap.launch import checked
from emu.dap.rewind import Returning
from emu.dap.state_requests import Refused
from emu.dap.variables import Row, Sights, Sources
from emu.dap.wire import Channel, Message
from emu.debug.dwarf.location import Unavailable
from emu.debug.environment import WokenError
from emu.debug.expressions.expression import ExpressionError
from emu.debug.history import History

if TYPE_CHECKING:
    from emu.machine.machine import Machine

CAPABILITIES: Final = {
    f"supports{name}": True
    for name in (
        "ConfigurationDoneRequest", "ConditionalBreakpoints", "HitConditionalBreakpoints", "LogPoints",
        "FunctionBreakpoints", "InstructionBreakpoints", "DisassembleRequest", "SteppingGranularity", "DataBreakpoints",
        "DataBreakpointBytes", "StepBack", "ReadMemoryRequest", "WriteMemoryRequest", "SetVariable", "SetExpression",
        "EvaluateForHovers", "ExceptionInfoRequest", "RestartRequest", "TerminateRequest",
        "DelayedStackTraceLoading", "BreakpointLocationsRequest", "CancelRequest", "CompletionsRequest",
        "LoadedSourcesRequest",
    )
} | {
    "supportTerminateDebuggee": True,
    "exceptionBreakpointFilters": [{"filter": "fault", "label": "Firmware faults", "default": True}],
}  # fmt: skip
ENDING: Final = ("pause", "disconnect", "terminate", "cancel")
"""Requests that make a running machine stand."""
WHILE_RUNNING: Final = (
    "threads", "setBreakpoints", "setFunctionBreakpoints", "setInstructionBreakpoints", "setDataBreakpoints",
    "setExceptionBreakpoints",
)  # fmt: skip
"""Those that are answered while it runs; the others wait until it stands."""
MISTAKES: Final = (
    Refused, ExpressionError, Unavailable, ValueError, LookupError, ArithmeticError, TypeError, AttributeError,
    RecursionError, OSError,
)  # fmt: skip
"""What a request with arguments of the wrong kind, size or meaning can end in."""


class Server(Returning):
    """Serves one client to the end. `make(arguments)` gives a machine; it raises ValueError or OSError for bad ones.
    `record` makes the recording by which it goes back."""

    def __init__(
        self, wire: Channel, make: Callable[[Row], Machine], record: Callable[[Machine], History] = History
    ) -> None:
        super().__init__()
        self._wire: Final = wire
        self._make: Final = make
        self._record = record
        self.ends_all = False
        """The client wants what is debugged to end, not only to be left alone."""
        self._target: Debuggee | None = None
        self._views: tuple[Sights, Sources] | None = None
        self._launch: Row = {}
        self._client: Row = {}
        """What the client said of itself."""
        self._configured = self._over = False
        self._halt = Halt("entry")
        self._pause = False
        self._waiting: list[Message] = []
        self._said: dict[int, bytearray] = {}
        self._thread = 1

    def serve(self) -> None:
        """Answer until the client leaves."""
        woken: WokenError | None = None
        while not self._over:
            try:
                if woken is not None:
                    left, woken = woken.left, None
                    self._take_over(left)
                    continue
                if self._configured:
                    self._pass_by()
                message = self._waiting.pop(0) if self._waiting else self._wire.inbox.get()
                if message is None:
                    break
                if message.get("type") == "request":
                    self.answer(message)
            except WokenError as error:
                woken = error
        self.leave()

    @property
    def is_over(self) -> bool:
        """The client has left."""
        return self._over

    def leave(self) -> None:
        """Give back what was debugged."""
        if self._target is not None:
            self._target.leave()

    def answer(self, message: Message) -> None:
        """Respond to one request. Whatever is wrong with it, the session goes on."""
        command = str(message.get("command"))
        arguments = message.get("arguments") or {}
        method = getattr(self, f"_do_{command}", None)
        after: Callable[[], None] | None = None
        was_past = self._is_past
        try:
            if method is None:
                raise Refused(f"{command} is not supported")
            if not isinstance(arguments, dict):
                raise Refused(f"{command}: arguments must be an object")
            result = method(arguments)
            body, after = result if isinstance(result, tuple) else (result, None)
            self._respond(message, True, body or {})
        except MISTAKES as error:
            text = _told(command, error)
            self._respond(message, False, {"error": {"id": 1, "format": text}}, text)
        if after is not None:
            after()
        elif was_past and not self._is_past and self._client.get("supportsInvalidatedEvent"):
            self._event("invalidated", {"areas": ["variables"]})

    @property
    def _is_past(self) -> bool:
        """Whether the machine stands before its present. That ends where it stands when the past is changed, or what
        is around it was brought there."""
        return self._target is not None and self._target.history.is_past

    def _respond(self, message: Message, success: bool, body: Row, text: str = "") -> None:
        reply = {"type": "response", "request_seq": message.get("seq", 0), "success": success}
        reply["command"] = str(message.get("command"))
        self._wire.send(reply | {"body": body} | ({"message": text} if text else {}))

    def _event(self, name: str, body: Row | None = None) -> None:
        self._wire.send({"type": "event", "event": name, "body": body or {}})

    def _say(self, text: str, category: str = "console") -> None:
        self._event("output", {"category": category, "output": text})

    # Life

    def _do_initialize(self, arguments: Row) -> Row:
        self._client = arguments
        return CAPABILITIES

    def _do_launch(self, arguments: Row) -> Any:
        arguments = checked(arguments)
        machine = self._make(arguments)
        if machine.image is None:
            raise Refused("no program")
        self._launch = arguments
        program = Path(machine.image.path).resolve()
        roots = [Path(root) for root in arguments.get("sourceRoots", [])] + [Path.cwd(), *program.parents]
        self._target = Debuggee(machine, self._wanted, self._say, self._record(machine))
        sources = Sources(self._target.inspector, roots)
        world = self._world if self._target.history.around is not None else None
        self._views = Sights(self._target.inspector, sources, world), sources
        self._listen(machine)
        return {}, lambda: self._event("initialized")

    _do_attach = _do_launch

    def _listen(self, machine: Machine) -> None:
        for number in machine.uart:
            machine.uart[number].listen(partial(self._heard, number))

    def _heard(self, number: int, byte: int, _cycle: int) -> None:
        if self._is_muted:
            return
        text = self._said.setdefault(number, bytearray())
        text.append(byte & 0xFF)
        if byte == 0x0A or len(text) >= 256:
            self._flush()

    def _flush(self) -> None:
        for number, text in self._said.items():
            if text:
                prefix = "" if number == 1 else f"UART{number}: "
                self._say(prefix + text.decode("latin-1"), "stdout")
                text.clear()

    def _do_configurationDone(self, _arguments: Row) -> Any:
        target = self._debuggee
        self._configured = True
        if self._launch.get("stopOnEntry"):
            return {}, lambda: self._stopped(Halt("entry"))
        return {}, lambda: self._go(target.go_on)

    def _do_disconnect(self, arguments: Row) -> Any:
        self.ends_all = self.ends_all or bool(arguments.get("terminateDebuggee"))
        return {}, self._end

    def _end(self) -> None:
        self._over = True

    def _do_terminate(self, _arguments: Row) -> Any:
        self.ends_all = True
        return {}, lambda: self._event("terminated")

    def _do_cancel(self, _arguments: Row) -> Row:
        self._pause = True
        return {}

    def _do_restart(self, _arguments: Row) -> Any:
        target = self._debuggee
        return {}, lambda: self._go(target.restart)

    # Going

    def _wanted(self) -> bool:
        """Whether the client wants the machine to stand; messages that came meanwhile are answered or wait."""
        self._flush()
        self._pass_by()
        while not self._wire.inbox.empty():
            message = self._wire.inbox.get()
            if message is None:
                self._over = self._pause = True
            elif message.get("type") == "request" and message.get("command") in (*ENDING, *WHILE_RUNNING):
                self._pause = self._pause or message["command"] in ENDING
                self.answer(message)
            else:
                self._waiting.append(message)
        return self._pause

    def _do_pause(self, _arguments: Row) -> Row:
        self._pause = True
        return {}

    def _go(self, act: Callable[[], Halt]) -> None:
        self._sights.forget()
        self._pause = False
        halt = self._followed(act())
        if not self._over:
            self._stopped(halt)

    def _stopped(self, halt: Halt) -> None:
        self._flush()
        self._halt = halt
        self._thread = self._current_thread()
        body: Row = {"reason": halt.reason, "threadId": self._thread, "allThreadsStopped": True}
        if halt.description:
            body |= {"description": halt.description, "text": halt.description}
        if halt.breakpoints:
            body["hitBreakpointIds"] = list(halt.breakpoints)
        self._event("stopped", body)

    def _doer(self, act: Callable[[], Halt]) -> Any:
        target = self._debuggee
        if not self._configured:
            raise Refused(f"{target.machine.pc:#x}: the configuration is not done")
        return {"allThreadsContinued": True}, lambda: self._go(act)

    def _do_continue(self, _arguments: Row) -> Any:
        return self._doer(self._debuggee.go_on)

    def _do_next(self, arguments: Row) -> Any:
        fine = arguments.get("granularity") == "instruction"
        return self._doer(self._debuggee.step_over if fine else lambda: self._debuggee.step_line(into=False))

    def _do_stepIn(self, arguments: Row) -> Any:
        fine = arguments.get("granularity") == "instruction"
        return self._doer(self._debuggee.step_instruction if fine else lambda: self._debuggee.step_line(into=True))

    def _do_stepOut(self, _arguments: Row) -> Any:
        return self._doer(self._debuggee.step_out)

    def _do_stepBack(self, arguments: Row) -> Any:
        fine = arguments.get("granularity") == "instruction"
        return self._doer(self._debuggee.back_instruction if fine else self._debuggee.back_line)

    def _do_reverseContinue(self, _arguments: Row) -> Any:
        return self._doer(self._debuggee.back)

    # What it stands at

    def _do_threads(self, _arguments: Row) -> Row:
        threads = self._debuggee.threads() if self._configured else []
        rows = [{"id": one.pid + 1, "name": f"{one.pid} {one.name} ({one.state})"} for one in threads]
        return {"threads": rows or [{"id": 1, "name": "main"}]}

    def _current_thread(self) -> int:
        running = [one for one in self._debuggee.threads() if one.state == "running"]
        return running[0].pid + 1 if running else 1

    def _do_stackTrace(self, arguments: Row) -> Row:
        wanted = int(arguments["threadId"])
        frames = self._debuggee.frames()
        if wanted != self._thread:
            others = [list(one.frames) for one in self._debuggee.threads() if one.pid + 1 == wanted]
            if not others:
                raise Refused(f"there is no thread {wanted} here")
            frames = others[0]
        first = int(arguments.get("startFrame") or 0)
        levels = int(arguments.get("levels") or 0) or len(frames)
        return {"stackFrames": self._sights.stack(frames[first : first + levels]), "totalFrames": len(frames)}

    def _do_exceptionInfo(self, _arguments: Row) -> Row:
        stop = self._halt.stop
        if stop is None or stop.fault is None:
            raise Refused("it did not stop at a fault")
        details = {"message": stop.fault.cause, "stackTrace": stop.fault.report()}
        return {"exceptionId": "fault", "description": stop.fault.report(), "breakMode": "always", "details": details}


def _told(command: str, error: BaseException) -> str:
    """Why a request is refused, for the user. A name alone is that of an argument that is missing."""
    if isinstance(error, KeyError) and error.args:
        text = str(error.args[0])
        return f"{command} needs `{text}`" if text.isidentifier() else text
    return str(error)
