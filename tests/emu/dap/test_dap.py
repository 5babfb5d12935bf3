"""Tests of the Debug Adapter Protocol server over its standard streams."""

from __future__ import annotations

import base64
import json
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.emu.dap.client import ROOT, Client
from tests.watchdog import HANG
from toolchain.driver import driver

SOURCE = Path(__file__).parent / "program.c"


def line_of(text: str) -> int:
    """Return the number of the program's line that contains `text`."""
    return next(n for n, line in enumerate(SOURCE.read_text().splitlines(), 1) if text in line)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> str:
    image = tmp_path_factory.mktemp("dap") / "program.elf"
    assert driver.main(["-g", "-O0", str(SOURCE), "-o", str(image)]) == 0
    return str(image)


@pytest.fixture
def client() -> Iterator[Client]:
    made = Client()
    yield made
    made.close()


@pytest.fixture
def stopped(client: Client, program: str) -> Callable[..., Client]:
    """Return a client whose machine is paused at the first arrival at a line."""

    def stop(text: str, **more: Any) -> Client:
        client.start(program)
        wanted = [{"line": line_of(text), **more}]
        reply = client.ask("setBreakpoints", source={"path": str(SOURCE)}, breakpoints=wanted)["breakpoints"]
        assert reply[0]["verified"]
        client.ask("configurationDone")
        assert client.event("stopped")["reason"] == "breakpoint"
        return client

    return stop


def test_a_breakpoint_shows_stack_scopes_and_values(stopped: Callable[..., Client]) -> None:
    client = stopped("total = sum;", condition="a == 3 && b == 3")
    trace = client.ask("stackTrace", threadId=1)
    assert [frame["name"] for frame in trace["stackFrames"]] == ["add", "twice", "main", "_resetPRI"]
    assert trace["stackFrames"][0]["line"] == line_of("total = sum;")
    assert trace["stackFrames"][0]["source"]["path"] == str(SOURCE)
    assert trace["stackFrames"][1]["line"] == line_of("return add(once, n);")
    assert client.ask("stackTrace", threadId=1, startFrame=4, levels=16)["stackFrames"] == []
    frame = trace["stackFrames"][0]["id"]
    scopes = {scope["name"]: scope for scope in client.ask("scopes", frameId=frame)["scopes"]}
    assert scopes["SFRs"]["expensive"]
    values = client.ask("variables", variablesReference=scopes["Locals"]["variablesReference"])["variables"]
    assert {one["name"]: one["value"] for one in values} == {"a": "3", "b": "3", "sum": "6"}
    outer = client.ask("scopes", frameId=trace["stackFrames"][2]["id"])["scopes"][0]["variablesReference"]
    assert {one["name"]: one["value"] for one in client.ask("variables", variablesReference=outer)["variables"]} == {
        "i": "3"
    }
    statics = client.ask("variables", variablesReference=scopes["Statics"]["variablesReference"])["variables"]
    pairs = next(one for one in statics if one["name"] == "pairs")
    assert pairs["indexedVariables"] == 3
    second = client.ask("variables", variablesReference=pairs["variablesReference"], start=1, count=1)["variables"]
    assert [one["name"] for one in second] == ["[1]"]
    members = client.ask("variables", variablesReference=second[0]["variablesReference"])["variables"]
    assert {one["name"]: one["value"] for one in members} == {"first": "2", "second": "20"}
    assert [one["evaluateName"] for one in members] == ["pairs[1].first", "pairs[1].second"]
    for whole, part in (
        ("*(struct pair *)&pairs[2]", "second"), ("(struct pair *)&pairs[2]", "*"), ("pairs[1 + 1]", "second"),
        ("*(struct pair (*)[2])&pairs[1]", "[1]"),
    ):  # fmt: skip
        shown = client.ask("evaluate", expression=whole, context="watch", frameId=frame)
        one = client.ask("variables", variablesReference=shown["variablesReference"])["variables"][-1]
        assert one["name"] == part
        assert client.evaluate(one["evaluateName"]) == one["value"]
        assert "30" in one["value"]
    sfrs = client.ask("variables", variablesReference=scopes["SFRs"]["variablesReference"])["variables"]
    sr = next(one for one in sfrs if one["name"] == "U1MODE")
    fields = client.ask("variables", variablesReference=sr["variablesReference"])["variables"]
    assert {"UARTEN", "PDSEL"} <= {one["name"] for one in fields}
    assert client.evaluate("pairs[2].second + sum") == "36"
    assert client.evaluate("4611686018427387905 / 1") == "4611686018427387905", "no float between"
    towards_zero = {"-7 / 2": "-3", "-7 % 2": "-1", "7 / -2": "-3", "7 % -2": "1"}
    assert {text: client.evaluate(text) for text in towards_zero} == towards_zero
    decided = {
        "0 && nonsense": "0", "1 || 1 / 0": "1", "1 ? sum : pairs[99].first": "6",
        "0 ? 1 / 0 : 0 ? nonsense.x : 5": "5", "sum && (0 || *nonsense == 1 || 1) || 1": "refused",
        "0 && (1 / 0 || &nonsense->x) || sum": "1",
    }  # fmt: skip
    for text, value in decided.items():
        reply = client.asked("evaluate", expression=text, context="watch", frameId=frame)
        assert reply["body"].get("result", "refused") == value, text
    for text, said in (
        ("~1.5", "~ needs whole numbers"), ("1.5 | 1", "| needs whole"), ("1 << 1.0", "<< needs whole"),
        ("pairs[0.5]", "[] needs whole"), ("0 && (", "ends too early"), ("1 ? 2", "expected ':'"),
        ("1 << 99999999999", "a shift by 99999999999 bits; expected 0 to 63"), ("sum >> -1", "a shift by -1 bits"),
        ("(" * 5000, "more than 50 brackets"), ("-" * 5000 + "1", "more than 50 brackets"), ("7 % 0", "zero"),
    ):  # fmt: skip
        bad = client.asked("evaluate", expression=text, context="watch", frameId=frame)
        assert not bad["success"]
        assert said in bad["message"]
    refused = client.asked("evaluate", expression="nonsense", context="watch", frameId=frame)
    assert not refused["success"]
    assert "nothing called 'nonsense'" in refused["message"]


def test_steps_go_over_into_and_out(stopped: Callable[..., Client]) -> None:
    client = stopped("int once = add(n, 0);")

    def step(how: str, **more: Any) -> tuple[str, int]:
        client.ask(how, threadId=1, **more)
        assert client.event("stopped")["reason"] == "step"
        top = client.top()
        return top["name"], top["line"]

    assert step("next") == ("twice", line_of("return add(once, n);"))
    assert step("stepIn") == ("add", line_of("int sum = a + b;"))
    assert step("next") == ("add", line_of("total = sum;"))
    assert step("stepOut") == ("twice", line_of("return add(once, n);"))
    pc = int(client.top()["instructionPointerReference"], 16)
    step("next", granularity="instruction")
    assert int(client.top()["instructionPointerReference"], 16) == pc + 2


def test_back_by_line_instruction_and_breakpoint(stopped: Callable[..., Client]) -> None:
    client = stopped("total = sum;", hitCondition="4")
    totals = client.evaluate("total"), client.evaluate("a"), client.evaluate("cycle")
    here = client.top()["instructionPointerReference"]
    client.ask("stepBack", threadId=1)
    client.event("stopped")
    assert client.top()["line"] == line_of("int sum = a + b;")
    client.ask("next", threadId=1)
    client.event("stopped")
    assert (client.evaluate("total"), client.evaluate("a"), client.evaluate("cycle")) == totals
    for _ in range(5):
        client.ask("stepBack", threadId=1, granularity="instruction")
        client.event("stopped")
    for _ in range(5):
        client.ask("next", threadId=1, granularity="instruction")
        client.event("stopped")
    assert client.top()["instructionPointerReference"] == here
    assert client.evaluate("cycle") == totals[2]
    client.ask("setBreakpoints", source={"path": str(SOURCE)}, breakpoints=[{"line": line_of("total = sum;")}])
    seen = []
    while True:
        client.ask("reverseContinue", threadId=1)
        event = client.event("stopped")
        if event["reason"] == "entry":
            break
        assert event["reason"] == "breakpoint"
        seen.append((client.evaluate("a"), client.evaluate("b"), client.evaluate("total")))
    assert seen == [("1", "0", "0"), ("0", "0", "0"), ("0", "0", "0")]
    assert event["description"] == "start of recording"


def test_data_breakpoints_and_the_last_write(stopped: Callable[..., Client]) -> None:
    client = stopped('printf("total')
    info = client.ask("dataBreakpointInfo", name="pairs[1].second", frameId=client.top()["id"])
    assert info["accessTypes"] == ["read", "write", "readWrite"]
    client.ask("setDataBreakpoints", breakpoints=[{"dataId": info["dataId"], "accessType": "write"}])
    client.ask("continue", threadId=1)
    event = client.event("stopped")
    assert event["reason"] == "data breakpoint"
    assert client.evaluate("(unsigned char)pairs[1].second") == "8"
    client.ask("setDataBreakpoints", breakpoints=[])
    client.ask("evaluate", expression="/lastwrite total", context="repl")
    event = client.event("stopped")
    assert "0400 -> 0800" in event["description"]
    assert (client.top()["name"], client.top()["line"]) == ("add", line_of("total = sum;"))
    assert client.evaluate("total") == "4"
    assert "before the present" in client.evaluate("/time", "repl")


def test_a_fault_is_an_exception_with_its_report(client: Client, program: str) -> None:
    client.start(program)
    client.ask("setExceptionBreakpoints", filters=["fault"])
    client.ask("configurationDone")
    event = client.event("stopped")
    assert event["reason"] == "exception"
    assert "reading 2 bytes at 0x3009, an odd address" in event["text"]
    assert "#0 main at" in client.ask("exceptionInfo", threadId=1)["description"]
    assert "total 8\n" in client.said()


def test_memory_registers_and_variables_are_set(stopped: Callable[..., Client]) -> None:
    client = stopped("total = sum;")
    frame = client.top()["id"]
    assert client.evaluate("sum = 77", "repl") == "77"
    assert client.ask("setExpression", expression="pairs[0].first", value="-5", frameId=frame)["value"] == "-5"
    scopes = client.ask("scopes", frameId=frame)["scopes"]
    local = next(scope["variablesReference"] for scope in scopes if scope["name"] == "Locals")
    assert client.ask("setVariable", variablesReference=local, name="a", value="b + 9")["value"] == "9"
    refused = client.asked("setVariable", variablesReference=local, name="a", value="70000")
    assert "does not fit" in refused["message"]
    registers = next(scope["variablesReference"] for scope in scopes if scope["name"] == "Registers")
    for number in ("3", "4"):
        assert client.ask("setVariable", variablesReference=registers, name="W9", value=number)["value"] == number
        assert client.ask("evaluate", expression="W9", context="watch", frameId=frame)["result"] == number
    place = client.ask("evaluate", expression="pairs", context="watch", frameId=frame)["memoryReference"]
    data = client.ask("readMemory", memoryReference=place, offset=0, count=6)
    assert base64.b64decode(data["data"]) == b"\xfb\xff\x0a\0\0\0"
    client.ask("writeMemory", memoryReference=place, offset=2, data=base64.b64encode(b"\x01\x02").decode())
    assert client.evaluate("pairs[0].second") == str(0x0201)
    assert client.ask("readMemory", memoryReference="0x27fe", count=8)["unreadableBytes"] == 6
    client.ask("next", threadId=1)
    client.event("stopped")
    assert client.evaluate("total") == "77"


def test_disassembly_has_exactly_the_rows_asked_for(stopped: Callable[..., Client]) -> None:
    client = stopped("total = sum;")
    reference = client.top()["instructionPointerReference"]
    rows = client.ask("disassemble", memoryReference=reference, instructionOffset=-200, instructionCount=400)[
        "instructions"
    ]
    assert len(rows) == 400
    assert int(rows[200]["address"], 16) == int(reference, 16)
    assert rows[200]["line"] == line_of("total = sum;")
    before = client.ask("disassemble", memoryReference="0x000004", instructionOffset=-6, instructionCount=8)[
        "instructions"
    ]
    assert [row.get("presentationHint") for row in before] == ["invalid"] * 4 + [None] * 4
    client.ask("setInstructionBreakpoints", breakpoints=[{"instructionReference": reference, "offset": -4}])
    client.ask("setBreakpoints", source={"path": str(SOURCE)}, breakpoints=[])
    client.ask("continue", threadId=1)
    client.event("stopped")
    assert int(client.top()["instructionPointerReference"], 16) == int(reference, 16) - 4


def test_function_breakpoints_logpoints_pause_restart_and_terminate(client: Client, program: str) -> None:
    client.start(program, stopOnEntry=True)
    log = [{"line": line_of("total = sum;"), "logMessage": "sum is {sum}, {nothing}"}]
    client.ask("setBreakpoints", source={"path": str(SOURCE)}, breakpoints=log)
    set_ = client.ask("setFunctionBreakpoints", breakpoints=[{"name": "printf"}, {"name": "missing"}])["breakpoints"]
    assert [one["verified"] for one in set_] == [True, False]
    client.ask("configurationDone")
    assert client.event("stopped")["reason"] == "entry"
    assert client.ask("threads")["threads"] == [{"id": 1, "name": "main"}]
    client.ask("continue", threadId=1)
    assert client.event("stopped")["hitBreakpointIds"] == [set_[0]["id"]]
    said = client.said()
    assert "sum is 8, <there is nothing called 'nothing' here>\n" in said
    assert said.count("sum is ") == 10
    client.ask("restart")
    assert client.event("stopped")["reason"] == "entry"
    assert client.evaluate("cycle") == "0"
    assert not client.asked("launchMissiles")["success"]
    client.ask("terminate")
    client.event("terminated")


def test_a_run_is_paused_and_breakpoints_change_while_it_runs(client: Client, tmp_path: Path) -> None:
    source, image = tmp_path / "spin.c", tmp_path / "spin.elf"
    source.write_text("volatile int n;\nint main(void) {\n    for (;;) {\n        n++;\n        n += 2;\n    }\n}\n")
    assert driver.main(["-g", "-O0", str(source), "-o", str(image)]) == 0
    client.start(str(image))
    client.ask("configurationDone")
    client.ask("pause", threadId=1)
    assert client.event("stopped")["reason"] == "pause"
    client.ask("continue", threadId=1)
    client.ask("setBreakpoints", source={"path": str(source)}, breakpoints=[{"line": 5}])
    assert client.event("stopped")["reason"] == "breakpoint"
    assert client.top()["line"] == 5


INVALID_LAUNCHES: list[tuple[dict[str, Any], str]] = [
    ({"program": None}, "needs `program`"),
    ({"program": "/nowhere.elf"}, "cannot be read"),
    ({"program": 5}, "`program` must be the path of an ELF file, not 5"),
    ({"selector": "x"}, '`selector` must be a whole number, not "x"'),
    ({"selector": 2.5}, "`selector` must be a whole number, not 2.5"),
    ({"selector": True}, "`selector` must be a whole number, not true"),
    ({"board": "none", "selector": 3}, "`selector` needs the board epuck, not none"),
    ({"board": "none", "camera": "x.png"}, "`camera` needs the board epuck, not none"),
    ({"board": ["none"]}, "`board` must be the name of a board"),
    ({"stopOnEntry": "false"}, '`stopOnEntry` must be true or false, not "false"'),
    ({"strict": 0}, "`strict` must be true or false, not 0"),
    ({"sourceRoots": "src"}, '`sourceRoots` must be a list of folders, not "src"'),
    ({"sourceRoots": [5]}, "`sourceRoots` must be a list of folders, not [5]"),
]


def test_invalid_launch_arguments_are_named(client: Client) -> None:
    client.ask("initialize", adapterID="emu")
    for arguments, words in INVALID_LAUNCHES:
        reply = client.asked("launch", **({"program": "a.elf"} | arguments))
        assert not reply["success"]
        assert words in reply["message"]
    assert not client.asked("continue", threadId=1)["success"]


def test_registers_are_listed_by_peripheral_and_bit_field(stopped: Callable[..., Client]) -> None:
    """The custom request `sfrs` lists registers by peripheral and bit field. Every path is an expression, and reading
    has no side effect."""
    client = stopped("total = sum;")
    groups = {one["name"]: one["parts"] for one in client.ask("sfrs")["groups"]}
    assert {"CPU core", "UART 1", "Timer 1", "I/O ports", "CAN 2"} <= set(groups)
    uart = {one["name"]: one for one in groups["UART 1"]}
    assert uart["U1MODE"]["address"] == "0x020c"
    assert [one["name"] for one in groups["Timer 1"]] == ["TMR1", "PR1", "T1CON"]
    client.evaluate("T1CON.TCKPS = 2", context="repl")
    groups = {one["name"]: one["parts"] for one in client.ask("sfrs")["groups"]}
    control = groups["Timer 1"][2]
    assert control["value"] == "0x0020"
    prescaler = next(one for one in control["parts"] if one["name"] == "TCKPS")
    assert (prescaler["value"], client.evaluate(prescaler["path"])) == ("2", "2")


def test_a_valid_breakpoint_has_no_message(client: Client, program: str) -> None:
    client.start(program)
    made = client.ask("setFunctionBreakpoints", breakpoints=[{"name": "twice"}, {"name": "thrice"}])["breakpoints"]
    assert made[0] == {"id": 1, "verified": True}
    assert "thrice" in made[1]["message"]


INVALID_REQUESTS: list[tuple[str, dict[str, Any], str]] = [
    ("scopes", {}, "scopes needs `frameId`"),
    ("scopes", {"frameId": 4242}, "frame 4242 is not valid at this stop"),
    ("evaluate", {"expression": "total", "frameId": 4242}, "frame 4242 is not valid"),
    ("variables", {"variablesReference": 4242}, "reference 4242 is not valid"),
    ("stackTrace", {"threadId": 99}, "there is no thread 99 here"),
    ("setBreakpoints", {"source": {"path": "program.c"}, "breakpoints": [{}]}, "setBreakpoints needs `line`"),
    ("setFunctionBreakpoints", {}, "setFunctionBreakpoints needs `breakpoints`"),
    ("writeMemory", {"memoryReference": "0x800", "data": "!!!"}, "base64"),
    ("setVariable", {"variablesReference": 4242, "name": "a", "value": "1"}, "reference 4242 is not valid"),
]


def test_invalid_requests_are_refused_with_a_reason(stopped: Callable[..., Client]) -> None:
    """Invalid requests are refused with a reason; a variable reference of an earlier stop does not denote the
    innermost frame."""
    client = stopped("total = sum;")
    frame = client.top()["id"]
    for command, arguments, words in INVALID_REQUESTS:
        reply = client.asked(command, **arguments)
        assert not reply["success"]
        assert words in reply["message"]
    sources = ["http://x", "//", "file:///a/b", "\0", f"file://{SOURCE}"]
    made = [
        client.ask("setBreakpoints", source={"path": path}, breakpoints=[{"line": line_of("total = sum;")}])
        for path in sources
    ]
    assert [one["breakpoints"][0]["verified"] for one in made] == [False] * 4 + [True]
    for one in ({"dataId": "2800/2"}, {"dataId": "0800/-2"}, {"dataId": "0800/2", "accessType": "dance"}):
        assert not client.ask("setDataBreakpoints", breakpoints=[one])["breakpoints"][0]["verified"]
    assert client.ask("dataBreakpointInfo", name="0x99999", asAddress=True)["dataId"] is None
    stays = [client.ask("dataBreakpointInfo", name=name, frameId=frame)["canPersist"] for name in ("sum", "total")]
    assert stays == [False, True]
    client.ask("next", threadId=1)
    client.event("stopped")
    assert not client.asked("evaluate", expression="sum", frameId=frame)["success"]


def framed(command: str, **arguments: Any) -> bytes:
    """Return a request as bytes with its header."""
    body = json.dumps({"seq": 1, "type": "request", "command": command, "arguments": arguments}).encode()
    return b"Content-Length: %d\r\n\r\n%s" % (len(body), body)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sent", "replies", "words"),
    [
        (b"", 0, ""),
        (framed("restart") + framed("terminate"), 3, ""),  # the event "terminated" ends the session
        (b"GET / HTTP/1.1\r\nHost: x\r\n\r\n", 0, "an HTTP request, perhaps from a web page; this port is for editors"),
        (b"POST /content-length:71 HTTP/1.1\r\nHost: x\r\nContent-Length: 71\r\n\r\n" + framed("initialize")[-71:],
         0, "an HTTP request"),
        (b"GET /" + b"x" * 9000, 0, "an HTTP request"),
        (b"X-Content-Length: 71\r\n\r\n" + framed("initialize")[-71:], 0, "expected `Content-Length: N`"),
        (b"Origin: http://x\r\n" + framed("initialize"), 0, "expected `Content-Length: N`"),
        (b"Content-Length: 71\r\n" + framed("initialize"), 0, "expected `Content-Length: N`"),
        (b"Content-Type: application/json\r\n" + framed("initialize"), 1, ""),
        (b" " * 9000, 0, "4096 bytes without the end of a message header"),
        (framed("initialize") + b"Content-Length: 9999999999\r\n\r\n", 1, "a message of 9999999999 bytes"),
        (framed("initialize") + b"Content-Length: 0\r\n\r\n", 1, "a message of 0 bytes; expected 1 to 16777216"),
        (framed("initialize")[:-5], 0, "the input ends after 66 of 71 bytes of a message"),
        (framed("initialize") + b"Content-Length: 5\r\n\r\n{nope", 1, "a message is not valid JSON: '{nope'"),
        (b"Content-Length: 6\r\n\r\n[1, 2]", 0, "a message is no JSON object: '[1, 2]'"),
        (b"Content-Length: 90000\r\n\r\n" + b"[" * 90000, 0, "not valid JSON: '[[[["),
        (framed("initialize").replace(b"\r\n", b"\n"), 0, "the input ends in a message header"),
    ],
)  # fmt: skip
def test_a_protocol_error_ends_the_server_with_a_message(sent: bytes, replies: int, words: str) -> None:
    """A protocol error ends the server with status 2 and a message; valid input ends with status 0 and no error text.
    A restart before the launch is refused."""
    done = subprocess.run([sys.executable, "-m", "emu", "debug"], input=sent, capture_output=True, timeout=HANG)
    assert done.stdout.count(b"Content-Length") == replies
    assert done.returncode == (2 if words else 0), done.stderr
    errors = done.stderr.decode()
    assert (words in errors and errors.count("\n") == 1) if words else not errors


def test_after_a_lost_connection_the_port_serves_the_next_client(program: str, tmp_path: Path) -> None:
    source, image = tmp_path / "talk.c", tmp_path / "talk.elf"
    source.write_text(
        "#include <p30F6014A.h>\nint main(void) { U1BRG = 7; U1MODE = 0x8000; U1STA = 0x400;"
        " for (;;) if (!U1STAbits.UTXBF) U1TXREG = 10; }"
    )
    assert driver.main(["-g", "-O0", str(source), "-o", str(image)]) == 0
    server = subprocess.Popen(
        [sys.executable, "-m", "emu", "debug", "--port", "0"], stderr=subprocess.PIPE, text=True, cwd=ROOT
    )
    assert server.stderr is not None
    try:
        port = int(server.stderr.readline().rsplit(":", 1)[1])
        for reset in (b"\1\0\0\0\0\0\0\0", b"\0" * 8):  # SO_LINGER, with and without discarding unread data
            with socket.create_connection(("127.0.0.1", port), timeout=HANG) as gone:
                gone.sendall(framed("launch", program=str(image)) + framed("configurationDone"))
                seen = b""
                while seen.count(b'"stdout"') < 5:
                    seen += gone.recv(1 << 16)
                gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, reset)
        with socket.create_connection(("127.0.0.1", port), timeout=HANG) as last:
            last.sendall(framed("initialize"))
            assert b"supportsStepBack" in last.recv(1 << 16)
        assert server.poll() is None
    finally:
        server.kill()
        server.wait()
        server.stderr.close()
