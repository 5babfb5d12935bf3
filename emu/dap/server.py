"""One debugging session: executes a client's requests on the debuggee and reports its stops as events.

Inputs: a channel to the client, and a factory that makes a machine from launch arguments. Outputs: messages only. The
server reads its inbox between two slices of a run. While the machine runs, it answers all requests that do not need a
paused machine.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from emu.dap.debuggee import Debuggee, StopEvent
from emu.dap.launch import validated
from emu.dap.rewind import RewindingSession
from emu.dap.state_requests import RequestRefusedError
from emu.dap.variables import ReferenceTable, Row, SourceFiles
from emu.dap.wire import Channel, Message
from emu.debug.dwarf.location import Unavailable
from emu.debug.environment import CheckpointResumedError
from emu.debug.expressions.expression import ExpressionError
from emu.debug.history import History
from emu.host.sources import SourceFinder

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
STOPPING_REQUESTS: Final = ("pause", "disconnect", "terminate", "cancel")
"""Requests that pause a running machine."""
REQUESTS_WHILE_RUNNING: Final = (
    "threads", "setBreakpoints", "setFunctionBreakpoints", "setInstructionBreakpoints", "setDataBreakpoints",
    "setExceptionBreakpoints",
)  # fmt: skip
"""Requests that the server answers while the machine runs. It defers all others until the machine is paused."""
REQUEST_ERRORS: Final = (
    RequestRefusedError, ExpressionError, Unavailable, ValueError, LookupError, ArithmeticError, TypeError,
    AttributeError, RecursionError, OSError,
)  # fmt: skip
"""Exceptions that a request with invalid arguments can cause."""


class Server(RewindingSession):
    """Serves one client until it disconnects.

    `make(arguments)` returns a machine, or raises ValueError or OSError for invalid arguments. `record` creates the
    recording of the machine.
    """

    def __init__(
        self, wire: Channel, make: Callable[[Row], Machine], record: Callable[[Machine], History] = History
    ) -> None:
        super().__init__()
        self._wire: Final = wire
        self._make: Final = make
        self._record = record
        self.terminate_debuggee = False
        """Whether the client has requested to end the debuggee, not only the session."""
        self._target: Debuggee | None = None
        self._views: tuple[ReferenceTable, SourceFiles] | None = None
        self._launch: Row = {}
        self._client: Row = {}
        """Capabilities and name that the client has sent."""
        self._configured = self._is_over = False
        self._last_stop = StopEvent("entry")
        self._pause = False
        self._deferred: list[Message] = []
        self._output: dict[int, bytearray] = {}
        self._thread = 1

    def serve(self) -> None:
        """Handle requests until the client disconnects."""
        resumed: CheckpointResumedError | None = None
        while not self._is_over:
            try:
                if resumed is not None:
                    session_state, resumed = resumed.session_state, None
                    self._resume_session(session_state)
                    continue
                if self._configured:
                    self._offer_checkpoint()
                message = self._deferred.pop(0) if self._deferred else self._wire.inbox.get()
                if message is None:
                    break
                if message.get("type") == "request":
                    self.handle_request(message)
            except CheckpointResumedError as error:
                resumed = error
        self.release()

    @property
    def is_over(self) -> bool:
        """Whether the client has disconnected."""
        return self._is_over

    def release(self) -> None:
        """Detach from the debuggee."""
        if self._target is not None:
            self._target.release()

    def handle_request(self, message: Message) -> None:
        """Respond to one request. An error is reported to the client and does not end the session."""
        command = str(message.get("command"))
        arguments = message.get("arguments") or {}
        method = getattr(self, f"_do_{command}", None)
        after: Callable[[], None] | None = None
        was_past = self._is_past
        try:
            if method is None:
                raise RequestRefusedError(f"{command} is not supported")
            if not isinstance(arguments, dict):
                raise RequestRefusedError(f"{command}: arguments must be an object")
            result = method(arguments)
            body, after = result if isinstance(result, tuple) else (result, None)
            self._respond(message, True, body or {})
        except REQUEST_ERRORS as error:
            text = _error_text(command, error)
            self._respond(message, False, {"error": {"id": 1, "format": text}}, text)
        if after is not None:
            after()
        elif was_past and not self._is_past and self._client.get("supportsInvalidatedEvent"):
            self._event("invalidated", {"areas": ["variables"]})

    @property
    def _is_past(self) -> bool:
        """Whether the machine has been rewound to a time before the present.

        A change there, or a rewind of the environment, makes that time the present.
        """
        return self._target is not None and self._target.history.is_past

    def _respond(self, message: Message, success: bool, body: Row, text: str = "") -> None:
        reply = {"type": "response", "request_seq": message.get("seq", 0), "success": success}
        reply["command"] = str(message.get("command"))
        self._wire.send(reply | {"body": body} | ({"message": text} if text else {}))

    def _event(self, name: str, body: Row | None = None) -> None:
        self._wire.send({"type": "event", "event": name, "body": body or {}})

    def _write_output(self, text: str, category: str = "console") -> None:
        self._event("output", {"category": category, "output": text})

    # Session

    def _do_initialize(self, arguments: Row) -> Row:
        self._client = arguments
        return CAPABILITIES

    def _do_launch(self, arguments: Row) -> Any:
        arguments = validated(arguments)
        machine = self._make(arguments)
        if machine.image is None:
            raise RequestRefusedError("the machine has no program")
        self._launch = arguments
        finder = SourceFinder(machine.image.path, *arguments.get("sourceRoots", []), ".")
        self._target = Debuggee(machine, self._is_stop_requested, self._write_output, self._record(machine))
        sources = SourceFiles(self._target.inspector, finder)
        world = self._environment_state if self._target.history.environment is not None else None
        self._views = ReferenceTable(self._target.inspector, sources, world), sources
        self._attach_output(machine)
        return {}, lambda: self._event("initialized")

    _do_attach = _do_launch

    def _attach_output(self, machine: Machine) -> None:
        for number in machine.uart:
            machine.uart[number].listen(partial(self._on_byte, number))

    def _on_byte(self, number: int, byte: int, _cycle: int) -> None:
        if self._is_muted:
            return
        text = self._output.setdefault(number, bytearray())
        text.append(byte & 0xFF)
        if byte == 0x0A or len(text) >= 256:
            self._flush()

    def _flush(self) -> None:
        for number, text in self._output.items():
            if text:
                prefix = "" if number == 1 else f"UART{number}: "
                self._write_output(prefix + text.decode("latin-1"), "stdout")
                text.clear()

    def _do_configurationDone(self, _arguments: Row) -> Any:
        target = self._debuggee
        self._configured = True
        if self._launch.get("stopOnEntry"):
            return {}, lambda: self._report_stop(StopEvent("entry"))
        return {}, lambda: self._run_action(target.resume)

    def _do_disconnect(self, arguments: Row) -> Any:
        self.terminate_debuggee = self.terminate_debuggee or bool(arguments.get("terminateDebuggee"))
        return {}, self._end

    def _end(self) -> None:
        self._is_over = True

    def _do_terminate(self, _arguments: Row) -> Any:
        self.terminate_debuggee = True
        return {}, lambda: self._event("terminated")

    def _do_cancel(self, _arguments: Row) -> Row:
        self._pause = True
        return {}

    def _do_restart(self, _arguments: Row) -> Any:
        target = self._debuggee
        return {}, lambda: self._run_action(target.restart)

    # Execution

    def _is_stop_requested(self) -> bool:
        """Whether the client has requested a pause. Before that, answer or defer the new messages."""
        self._flush()
        self._offer_checkpoint()
        while not self._wire.inbox.empty():
            message = self._wire.inbox.get()
            if message is None:
                self._is_over = self._pause = True
            elif message.get("type") == "request" and message.get("command") in (
                *STOPPING_REQUESTS,
                *REQUESTS_WHILE_RUNNING,
            ):
                self._pause = self._pause or message["command"] in STOPPING_REQUESTS
                self.handle_request(message)
            else:
                self._deferred.append(message)
        return self._pause

    def _do_pause(self, _arguments: Row) -> Row:
        self._pause = True
        return {}

    def _run_action(self, action: Callable[[], StopEvent]) -> None:
        self._references.clear()
        self._pause = False
        try:
            event = self._rewind_if_followed(action())
        except REQUEST_ERRORS as error:  # the stop reports the failure, because the response has been sent
            event = StopEvent("pause", f"the request failed: {error}")
        if not self._is_over:
            self._report_stop(event)

    def _report_stop(self, event: StopEvent) -> None:
        self._flush()
        self._last_stop = event
        self._thread = self._current_thread()
        body: Row = {"reason": event.reason, "threadId": self._thread, "allThreadsStopped": True}
        if event.description:
            body |= {"description": event.description, "text": event.description}
        if event.breakpoints:
            body["hitBreakpointIds"] = list(event.breakpoints)
        self._event("stopped", body)

    def _resuming(self, action: Callable[[], StopEvent]) -> Any:
        target = self._debuggee
        if not self._configured:
            raise RequestRefusedError(f"{target.machine.pc:#x}: the configuration is not done")
        return {"allThreadsContinued": True}, lambda: self._run_action(action)

    def _do_continue(self, _arguments: Row) -> Any:
        return self._resuming(self._debuggee.resume)

    def _do_next(self, arguments: Row) -> Any:
        fine = arguments.get("granularity") == "instruction"
        return self._resuming(self._debuggee.step_over if fine else lambda: self._debuggee.step_line(into=False))

    def _do_stepIn(self, arguments: Row) -> Any:
        fine = arguments.get("granularity") == "instruction"
        return self._resuming(self._debuggee.step_instruction if fine else lambda: self._debuggee.step_line(into=True))

    def _do_stepOut(self, _arguments: Row) -> Any:
        return self._resuming(self._debuggee.step_out)

    def _do_stepBack(self, arguments: Row) -> Any:
        fine = arguments.get("granularity") == "instruction"
        return self._resuming(self._debuggee.reverse_step_instruction if fine else self._debuggee.reverse_step_line)

    def _do_reverseContinue(self, _arguments: Row) -> Any:
        return self._resuming(self._debuggee.reverse_continue)

    # State

    def _do_threads(self, _arguments: Row) -> Row:
        threads = self._debuggee.threads() if self._configured else []
        rows = [{"id": one.pid + 1, "name": f"{one.pid} {one.name} ({one.state})"} for one in threads]
        return {"threads": rows or [{"id": 1, "name": "main"}]}

    def _current_thread(self) -> int:
        running = [one for one in self._debuggee.threads() if one.state == "running"]
        return running[0].pid + 1 if running else 1

    def _do_stackTrace(self, arguments: Row) -> Row:
        thread = int(arguments["threadId"])
        frames = self._debuggee.frames()
        if thread != self._thread:
            others = [list(one.frames) for one in self._debuggee.threads() if one.pid + 1 == thread]
            if not others:
                raise RequestRefusedError(f"there is no thread {thread} here")
            frames = others[0]
        first = int(arguments.get("startFrame") or 0)
        levels = int(arguments.get("levels") or 0) or len(frames)
        return {"stackFrames": self._references.stack(frames[first : first + levels]), "totalFrames": len(frames)}

    def _do_exceptionInfo(self, _arguments: Row) -> Row:
        stop = self._last_stop.stop
        if stop is None or stop.fault is None:
            raise RequestRefusedError("the machine is not at a fault")
        details = {"message": stop.fault.cause, "stackTrace": stop.fault.report()}
        return {"exceptionId": "fault", "description": stop.fault.report(), "breakMode": "always", "details": details}


def _error_text(command: str, error: BaseException) -> str:
    """Return the error message for a failed request. A KeyError for an identifier means that an argument is missing."""
    if isinstance(error, KeyError) and error.args:
        text = str(error.args[0])
        return f"{command} needs `{text}`" if text.isidentifier() else text
    return str(error)
