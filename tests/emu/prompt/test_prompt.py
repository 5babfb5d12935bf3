"""Tests of the debugger prompt: scripts, a pseudo terminal, and the commands of the server's console."""

from __future__ import annotations

import io
import os
import pty
import re
import select
import subprocess
import sys
import termios
import time
from pathlib import Path

import pytest

import emu
from emu.cli import main
from emu.dap.server import Server
from emu.debug.history import History
from emu.prompt.command_table import TABLE
from emu.prompt.reader import Prompt, candidates, execute
from emu.prompt.state_commands import TOPICS
from tests.emu.dap.test_dap import SOURCE, line_of
from tests.watchdog import cpu_of
from toolchain.driver import driver

ROOT = Path(__file__).resolve().parents[3]
PATIENCE = 3600


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> str:
    image = tmp_path_factory.mktemp("prompt") / "program.elf"
    assert driver.main(["-g", "-O0", str(SOURCE), "-o", str(image)]) == 0
    return str(image)


@pytest.fixture
def play(program: str, capsys: pytest.CaptureFixture[str]) -> type:
    """Return a function that runs a script in this process: `play(*lines)` has output, errors and exit status."""

    class Played:
        def __init__(self, *lines: str) -> None:
            machine = emu.load(program)
            prompt = Prompt("emu debug", lambda client: Server(client, lambda _launch: machine))
            self.status = prompt.serve({}, io.StringIO("\n".join(lines)))
            self.out, self.err = capsys.readouterr()

    return Played


def test_a_script_stops_inspects_and_goes_back(play: type) -> None:
    total = line_of("total = sum;")
    played = play(
        "# a comment", "", f"break program.c:{total} if a == 3 && b == 3", "run", "bt", "p sum", "up", "p/x once",
        "info locals", f"tb {line_of('for (i = 0; i < 500')}", "info breakpoints", "delete 1", "c", "lastwrite total",
        "time", "reverse-finish", "info b",
    )  # fmt: skip
    assert played.status == 0, played.err
    out = played.out
    assert "breakpoint 1\nadd at program.c:13, cycle " in out
    assert f">{total:5} " in out
    assert "* #0 add at program.c:13\n  #1 twice at program.c:20\n  #2 main at program.c:27\n" in out
    assert "sum = 6\n" in out
    assert "once = 0x3\n" in out
    assert "n = 3\nonce = 3\n" in out
    assert "1: program.c:13, if a == 3 && b == 3\n2: 30, once\n" in out
    assert "last write: 0400 -> 0800 at " in out
    assert re.search(r"before the present\ntwice at program.c:20, cycle [\d,]+", out)
    assert out.endswith("no breakpoints\n")


def test_a_breakpoint_at_a_function_is_after_the_prologue(play: type) -> None:
    """A breakpoint at a function is after its prologue, where its parameters are stored; before it they are shown as
    not set. This holds for conditions too."""
    played = play("break add if a == 3", "run", "info locals", "reverse-stepi", "info locals", "delete",
                  f"break {line_of('int twice(int n)') + 1} if n == 2", "restart", "run", "info locals", "step",
                  "backtrace", "info locals")  # fmt: skip
    assert played.status == 0, played.err
    out = played.out
    assert f"breakpoint 1\nadd at program.c:{line_of('int sum = a + b;')}, cycle " in out
    assert "\na = 3\nb = 0\nsum = " in out
    assert out.count(" = <not set yet: the function is being entered>\n") == 3
    assert f"breakpoint 2\ntwice at program.c:{line_of('int once')}, cycle " in out
    assert "\nn = 2\nonce = " in out
    assert f"* #0 add at program.c:{line_of('int sum')}\n  #1 twice" in out
    assert re.search(r"\na = 2\nb = 0\nsum = -?\d+\n$", out)


def test_a_function_that_was_inlined_everywhere_stops_at_each_copy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A breakpoint at it has one address for each copy; `emu run --break` says where it was inlined."""
    source, image = tmp_path / "inlined.c", str(tmp_path / "inlined.elf")
    source.write_text(
        "volatile int total;\nstatic inline __attribute__((always_inline)) void add(int n)\n{\n    total += n;\n}\n"
        "int main(void)\n{\n    add(3);\n    total = 9;\n    add(4);\n    return 0;\n}\n"
    )
    assert driver.main(["-g", "-Os", str(source), "-o", image]) == 0
    script = io.StringIO("break add\nrun\nprint total\nbt\ncontinue\nprint total\nreverse-continue\nprint total\n")
    assert Prompt("emu debug", lambda client: Server(client, lambda _launch: emu.load(image))).serve({}, script) == 0
    said = capsys.readouterr().out
    assert re.findall(r"(?m)^total = (\d)$", said) == ["0", "9", "0"]
    assert "* #0 add at inlined.c:4\n  #1 main at inlined.c:8\n" in said
    assert main(["run", image, "--break", "add"]) == 2
    assert capsys.readouterr().err.count("'add': inlined into main; add __attribute__((noinline))") == 1


@pytest.mark.parametrize("command", ["next", "step"])
def test_next_steps_over_inlined_functions(tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str) -> None:
    """`next` stays in the caller and counts the copy as part of its line; `step` enters it. Backwards alike."""
    source, image = tmp_path / "inlined.c", str(tmp_path / "inlined.elf")
    source.write_text(
        "volatile int total, last, seen;\nstatic inline __attribute__((always_inline)) void add(int n)\n{\n"
        "    total += n;\n    last = total;\n}\n"
        "int main(void)\n{\n    total = 1;\n    add(seen);\n    total = 9;\n    last = 8;\n    return 0;\n}\n"
    )
    assert driver.main(["-g", "-Os", str(source), "-o", image]) == 0
    commands = ["break inlined.c:9", "run", *3 * [command, "bt"], *2 * [f"reverse-{command}", "bt"]]
    script = io.StringIO("\n".join(commands) + "\n")
    assert Prompt("emu debug", lambda client: Server(client, lambda _launch: emu.load(image))).serve({}, script) == 0
    places = re.findall(r"(?m)^\* #0 (\w+) at inlined.c:(\d+)$", capsys.readouterr().out)
    if command == "next":
        assert places == [("main", "10"), ("main", "11"), ("main", "12"), ("main", "11"), ("main", "10")]
    else:
        assert places == [("main", "10"), ("add", "4"), ("add", "5"), ("add", "4"), ("main", "10")]


def test_a_script_ends_with_the_first_command_that_fails(play: type) -> None:
    played = play("break main", "run", "print nonsense", "print total")
    assert played.status == 2
    assert played.err == "emu debug: line 3, print nonsense: there is nothing called 'nonsense' here\n"
    assert "total" not in played.out


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("frobnicate", "there is no command frobnicate: try help"), ("re", "re is ambiguous: "),
        ("break nowhere", "there is no function nowhere"),
        ("break other.c:3", "no code of this program comes from other.c"),
        ("break", "expected FUNCTION, LINE, FILE:LINE or *ADDRESS"),
        ("break 3", "there is no source here: say FILE:LINE"), ("delete 7", "there is no breakpoint 7"),
        ("watch 3 + 4", "the object is not in memory"),
        ("step many", "expected a number of repetitions, not 'many'"),
        ("print/q total", "the formats are /x /d /u /t /c /a, not /q"), ("x/8zz total", "/zz is no format"),
        ("frame 99", "the frames are 0 to 0, not 99"), ("thread 9", "there is no thread 9: main"),
        ("goto tomorrow", "expected a number of cycles, not 'tomorrow'"),
        ("info", "info breakpoints: all breakpoints by number; frame: "),
        ("info sfr NOSUCH", "no register and no peripheral is called NOSUCH"),
        ("set total", "expected PLACE = EXPRESSION"), ("list 9", "there is no source here"),
    ],
)  # fmt: skip
def test_a_refused_command_prints_one_line(play: type, line: str, message: str) -> None:
    played = play(line)
    assert played.status == 2
    assert message in played.err
    assert played.err.count("\n") == 1


@pytest.mark.parametrize(
    "words", ["debug --port 99999", "profile x --top -1", "footprint x --symbols -1", "inject x --campaign x --only -1"]
)
def test_numbers_out_of_range_are_refused(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words.split())
    assert ended.value.code == 2
    assert re.search(r"expected a (port|number)\D", capsys.readouterr().err)


def test_a_script_that_ends_at_a_fault_has_its_status(play: type) -> None:
    played = play("run")
    assert played.status == 1
    assert "reading 2 bytes at 0x3009, an odd address" in played.out
    assert "#0 main at" in played.out
    assert play("run", "reverse-stepi").status == 0


def test_breakpoints_are_numbered_and_can_be_changed(play: type) -> None:
    """Breakpoints are numbered, and conditions, hit counts and states can be changed; a breakpoint keeps its hit
    count when another one is set."""
    total = line_of("total = sum;")
    played = play(
        f"b program.c:{total}", "hits 1 4", "log program.c:12 a is {a}", "disable 2", "run", "p a + b", "hits 1",
        "cond 1 a == 4 && b == 4", "c", "p sum", "disable", "enable 2", "watch pairs[1].second", "c", "info b",
    )  # fmt: skip
    assert played.status == 0, played.err
    assert "a + b = 2\n" in played.out
    assert "sum = 8\n" in played.out
    assert "a is 0" not in played.out
    assert "data breakpoint 3: write at" in played.out
    assert "1: program.c:13, if a == 4 && b == 4, off\n2: program.c:12, log a is {a}\n3: pairs[1].sec" in played.out
    more = f"b {line_of('return sum;')}"
    counted = play(f"b program.c:{total}", "hits 1 ==6", "run", more, "delete 2", "restart", "c")
    assert counted.out.count("breakpoint 1\nadd") == 1  # the sixth hit is in the past


def test_memory_registers_instructions_sources(play: type) -> None:
    played = play(
        "b add", "run", "x/8xb pairs", "x/2dh pairs", "x/s pairs", "x/2i PC", "dis add 3", "info registers",
        "info sfr U1STA", "info sfr timer 1", "list main", "list", "set pairs[0].second = -5",
        "p pairs[0]", "set U1BRG = 7", "p U1BRG", "nexti", "stepi 2", "cycle 3", "time", "delete", "goto 400",
        "time", "finish",
    )  # fmt: skip
    assert played.status == 0, played.err
    out = played.out
    assert ": 0x01 0x00 0x0a 0x00 0x00 0x00 0x02 0x00\n" in out
    assert ": 1 10\n" in out
    assert ": '\\x01'\n" in out
    assert re.search(r"> 0x0001\w\w  \w{6}  mov.d \[w14\], w6", out)
    frame, stack = (int(re.search(rf"{name} *= *0x(\w+)", out)[1], 16) for name in ("W14", "W15"))
    assert stack - frame == 6  # lnk #6
    assert "U1STA     0x020e  0x0110  UTXISEL=0" in out
    assert "T1CON" in out
    assert f" {line_of('int main'):5} int main(void)" in out
    assert "pairs[0] = {first = 1, second = -5}\n" in out
    assert "U1BRG = 7\n" in out
    assert "cycle 401, " in out  # 400 is in the middle of an instruction
    assert out.rstrip().splitlines()[-1].startswith(">")


def test_reverse_finish_goes_to_the_call(program: str) -> None:
    machine = emu.load(program)
    history = History(machine)
    output: list[str] = []
    prompt = Prompt("test", lambda client: Server(client, lambda _launch: machine, lambda _machine: history))
    prompt.session.write = lambda text, *_: output.append(text)  # type: ignore[method-assign]
    prompt.session.start({})
    for line in ("break add if b == 2", "run", "next", "next", "reverse-finish"):
        execute(prompt.session, line)
    calls = machine.pc
    assert prompt.session.frames[0]["name"] == "twice"
    execute(prompt.session, "stepi")
    assert machine.pc == machine.program_address("add") != calls


def test_reverse_step_goes_into_functions(play: type) -> None:
    """`reverse-step` from the second call of `add` goes through the end of the first call into its caller."""
    last = line_of("return add(once, n);")
    played = play(f"break program.c:{last} if n == 2", "run", *["reverse-step"] * 7)
    assert played.status == 0, played.err
    places = [line.split(",")[0] for line in played.out.splitlines() if " at program.c:" in line]
    first = line_of("int add(int a, int b)") + 1
    assert places[-7:] == [f"add at program.c:{first + n}" for n in (3, 2, 1, 0)] + [
        f"{name} at program.c:{line_of(text) + more}"
        for name, text, more in (("twice", "int once", 0), ("twice", "int twice", 1), ("main", "twice(i)", 0))
    ]


TICKING = """
extern volatile unsigned T1CON, PR1, IFS0, IEC0;
volatile unsigned ticks, n;
void more(void)
{
    ticks++;
}
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void)
{
    IFS0 = 0;
    more();
}
int main(void)
{
    PR1 = 150;
    IEC0 = 8;
    T1CON = 0x8000;
    for (;;) {
        n += 1;
        n ^= 3;
        n -= 2;
    }
}
"""


def test_reverse_step_skips_interrupts(tmp_path: Path) -> None:
    source, image = tmp_path / "ticking.c", tmp_path / "ticking.elf"
    source.write_text(TICKING)
    assert driver.main(["-g", "-O0", str(source), "-o", str(image)]) == 0
    machine = emu.load(image)
    prompt = Prompt("test", lambda client: Server(client, lambda _launch: machine))
    prompt.session.write = lambda *_: None  # type: ignore[method-assign]
    prompt.session.start({})
    for line in ("break ticking.c:19 if ticks == 3", "run"):
        execute(prompt.session, line)
    lines = []
    for _ in range(90):
        execute(prompt.session, "reverse-step")
        frame = prompt.session.frames[0]
        assert frame["name"] == "main"
        lines.append(frame["line"])
    assert machine.var("ticks") == 1
    assert lines == [18, 21, 20, 19] * 22 + [18, 21]


def test_names_are_completed(program: str) -> None:
    prompt = Prompt("test", lambda client: Server(client, lambda _launch: emu.load(program)))
    prompt.session.write = lambda *_: None  # type: ignore[method-assign]
    prompt.session.start({})

    def names(text: str) -> set[str]:
        return {text[: len(text) - replaced] + name for name, replaced, _ in candidates(prompt.session, text)}

    assert {"tbreak", "threads", "thread", "time"} <= names("t")
    assert names("break tw") == {"break twice"}
    assert names("list prog") == {"list program.c:"}
    assert {"print total", "print twice"} <= names("print t")
    assert names("print pairs[1].s") == {"print pairs[1].second"}
    assert names("p U1STA.TR") == {"p U1STA.TRMT"}
    assert names("p U1ST") == {"p U1STA", "p U1STAbits"}
    assert names("info l") == {"info locals"}
    assert names("help rev") == {f"help reverse-{how}" for how in ("continue", "finish", "next", "step", "stepi")}
    assert names("print nothing.x") == set()


def test_help_names_every_command_and_the_guide_every_kind(play: type) -> None:
    out = play("help", "help break").out
    for one in TABLE:
        assert one.usage in out
    guide = (ROOT / "docs" / "debugging.md").read_text(encoding="utf-8")
    for one in TABLE:
        assert f"`{one.name}`" in guide, one.name
    assert all(topic in guide for topic in TOPICS)


class Terminal:
    """A process on a pseudo terminal."""

    def __init__(self, folder: Path, *words: str) -> None:
        main, side = pty.openpty()
        termios.tcsetwinsize(side, (40, 120))
        environment = os.environ | {"TERM": "xterm", "PROMPT_TOOLKIT_NO_CPR": "1", "XDG_STATE_HOME": str(folder)}
        self.process = subprocess.Popen(
            [sys.executable, "-m", *words], stdin=side, stdout=side, stderr=side, cwd=ROOT, env=environment,
            start_new_session=True, preexec_fn=lambda: os.close(os.open(os.ttyname(0), os.O_RDWR)),
        )  # fmt: skip
        os.close(side)
        self._main = main
        self._seen = ""

    def expect(self, text: str) -> str:
        """Wait for `text` and return the output up to its end, without control sequences."""
        end = time.monotonic() + PATIENCE
        while text not in self._seen:
            assert time.monotonic() < end, self._seen
            if select.select([self._main], [], [], 1)[0]:
                try:
                    data = os.read(self._main, 4096)
                except OSError:
                    data = b""
                assert data, self._seen
                self._seen += re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", data.decode()).replace("\r", "")
        shown, self._seen = self._seen.split(text, 1)
        return shown + text

    def wait_until_busy(self) -> None:
        """Wait until the program has used half a second of CPU: a prompt that waits for a line uses almost none."""
        before, end = cpu_of([self.process.pid]), time.monotonic() + PATIENCE
        while cpu_of([self.process.pid]) < before + 0.5:
            assert time.monotonic() < end, self._seen
            time.sleep(0.05)

    def type(self, text: str) -> None:
        os.write(self._main, text.encode())

    def close(self) -> int:
        status = self.process.wait(timeout=PATIENCE)
        os.close(self._main)
        return status


def test_at_a_terminal(program: str, tmp_path: Path) -> None:
    """At a terminal the prompt has completion, repetition by an empty line, error and fault messages, and a history
    file."""
    terminal = Terminal(tmp_path, "emu", "debug", "--tui", program)
    terminal.expect("(emu)")
    terminal.type("break twi\t")
    terminal.expect("break twice")
    terminal.type("\r")
    terminal.expect("breakpoint 1: twice\n")
    terminal.type("run\r")
    terminal.expect(f"twice at program.c:{line_of('int once')}")
    terminal.type("print nonsense\r")
    terminal.expect("there is nothing called 'nonsense' here")
    terminal.type("stepi\r")
    terminal.expect("cycle 285")
    terminal.type("\r")
    terminal.expect("cycle 286")
    terminal.type("delete\r")
    terminal.type("set total = 0\r")
    terminal.expect("total = 0")
    terminal.type("log program.c:31 round\r")
    terminal.expect("breakpoint 2: program.c:31")
    terminal.type("goto 100000000000\r")
    terminal.expect("total 8")
    terminal.expect("odd address")
    terminal.type("q\r")
    assert terminal.close() == 0
    assert "break twice" in (tmp_path / "openswarm" / "debug-history").read_text()


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="only Linux's /proc tells whether a program runs")
def test_ctrl_c_pauses_a_running_machine(tmp_path: Path) -> None:
    source = tmp_path / "loop.c"
    source.write_text("volatile unsigned n;\nint main(void)\n{\n    for (;;)\n        n++;\n}\n")
    image = tmp_path / "loop.elf"
    assert driver.main(["-g", "-O0", str(source), "-o", str(image)]) == 0
    terminal = Terminal(tmp_path, "emu", "debug", "--tui", str(image))
    terminal.expect("(emu)")
    terminal.type("run\r")
    terminal.expect("run")
    terminal.wait_until_busy()
    terminal.type("\x03")
    assert "main at loop.c:" in terminal.expect("cycle ")
    terminal.expect("(emu)")
    terminal.type("\x04")
    assert terminal.close() == 0
