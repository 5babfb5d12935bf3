"""`emu run`: output, ends of runs, exit statuses, input, traces."""

from __future__ import annotations

import json
import os
import pty
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from emu.cli import main
from tests.emu.cli.programs import ECHO, HELLO, SPIN, executable
from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def build(tmp_path):
    """Return a function that writes a program and returns its path."""

    def write(source, vectors=None):
        path = tmp_path / "program.elf"
        path.write_bytes(executable(source, vectors))
        return str(path)

    return write


def emu(*arguments, **options):
    """Run `python -m emu` in a separate process, without input by default."""
    options.setdefault("stdin", subprocess.DEVNULL)
    if "input" in options:
        del options["stdin"]
    return subprocess.run(
        [sys.executable, "-m", "emu", *arguments], capture_output=True, cwd=ROOT, timeout=HANG, check=False, **options
    )


def test_uart1_goes_to_standard_output_and_the_last_line_says_why_and_where(build):
    done = emu("run", build(HELLO))
    assert done.stdout == b"hi!\n"
    assert done.returncode == 0
    last = done.stderr.decode().splitlines()[-1]
    assert last.startswith("halt at 0x00011e (_forever) after 5,253 cycles, 0.000356 s simulated, ")
    assert last.endswith(" x real time")


def test_json_is_one_object_with_the_uart_text(build, capfd):
    assert main(["run", build(HELLO), "--json"]) == 0
    facts = json.loads(capfd.readouterr().out)
    assert facts["reason"] == "halt"
    assert facts["uart1"] == "hi!\n"
    assert (facts["pc"], facts["symbol"], facts["cycles"], facts["status"]) == (0x11E, "_forever", 5253, 0)


def test_exit_code_is_the_status_stored_by_start_up_code(build):
    assert emu("run", build(HELLO), "--exit-code").returncode == 5


def test_a_debugger_word_ends_the_run_with_w0_as_status(build):
    """engines.md §10: a debugger word ends the run with W0 as status; an XC16 image returns from main into DA4000."""
    path = build("main:\nmov #7, w0\n.pword 0xDA4000\nreset\n")
    assert emu("run", path).returncode == 0
    done = emu("run", path, "--exit-code")
    assert done.returncode == 7
    assert b"breakpoint at 0x000102 (_main+0x2) after 4 cycles" in done.stderr


@pytest.mark.parametrize(
    ("source", "cause"),
    [
        ("main:\nmov #0x801, w1\nmov [w1], w2\nnop\n", "address error trap"),
        ("main:\nclr w2\nclr w3\nrepeat #17\ndiv.u w3, w2\nnop\n", "math error trap"),
        (
            "main:\nmov #0x400, w15\npush w0\nnop\nnop\nnop\n",
            "stack underflow: W15 is 0x0400, below RAM (stack error trap, no handler), at 0x000102",
        ),
        (
            "main:\nmov #0x900, w0\nmov w0, {SPLIM}\nmov w0, w15\npush w0\npush w0\nnop\nnop\n",
            "stack overflow: W15 is 0x0904, the limit 0x0900",
        ),
        ("main:\nmov [w1], w2\n", "W1 is used as an address pointer before it was written"),
        ("main:\n.pword 0xDB0000\n", "illegal opcode DB0000"),
        ("main:\nbset {IEC0}, #3\nbset {IFS0}, #3\nnop\nnop\nnop\n", "T1Interrupt, no handler,"),
        ("main:\nreset\n", "reset loop: RESET instruction"),
    ],
)
def test_faults_end_with_status_1_and_name_cause_and_place(build, capfd, source, cause):
    """engines.md §10; isa.md §14.4, §14.6: a fault ends the run with status 1, and the message names cause and
    address."""
    path = build(source)
    assert main(["run", path, "--cycles", "100000"]) == 1
    captured = capfd.readouterr().err
    assert f"firmware fault: {cause}" in captured
    assert captured.splitlines()[-1].startswith("fault at ")
    assert main(["run", path, "--cycles", "100000", "--exit-code"]) == 125


def test_a_fault_is_placed_at_the_instruction_that_made_it(build, capfd):
    """isa.md §14.4: the fault is reported at the faulting instruction, although an address error stacks the address
    after it."""
    assert main(["run", build("main:\nmov #0x801, w1\nmov [w1], w2\nnop\n"), "--json"]) == 1
    fault = json.loads(capfd.readouterr().out)["fault"]
    assert (fault["pc"], fault["symbol"]) == (0x102, "_main+0x2")


def test_a_trap_with_a_handler_is_no_fault(build, capfd):
    path = build(
        "main:\nmov #0x801, w1\nmov [w1], w2\nnop\npwrsav #1\nhandler:\nbclr {INTCON1}, #3\nretfie\n",
        {"AddressError": "handler"},
    )
    assert main(["run", path]) == 0
    assert "halt" in capfd.readouterr().err


def test_a_firmware_that_sleeps_in_a_trap_handler_is_a_fault(build, capfd):
    path = build(
        "main:\nmov #0x801, w1\nmov [w1], w2\nnop\nhandler:\nbclr {INTCON1}, #3\npwrsav #1\nforever:\nbra @forever\n",
        {"AddressError": "handler"},
    )
    assert main(["run", path]) == 1
    err = capfd.readouterr().err
    assert (
        "reading 2 bytes at 0x0801, an odd address, in whose handler the firmware went to sleep, at 0x000102 (main"
        in err
    )


@pytest.mark.parametrize(
    ("limit", "cycles"),
    [(["--cycles", "1000"], 1000), (["--seconds", "0.01"], 147456), (["--seconds", "1/100"], 147456)],
)
def test_limits_end_the_run_at_the_first_boundary_behind_them(build, capfd, limit, cycles):
    """--cycles and --seconds end the run at the first instruction boundary after the limit; an e-puck second is
    14,745,600 Tcy (dspic30f6014a.md §3)."""
    assert main(["run", build(SPIN), *limit, "--json"]) == 0
    facts = json.loads(capfd.readouterr().out)
    assert facts["reason"] == "limit"
    assert cycles <= facts["cycles"] <= cycles + 1


def test_a_limit_with_exit_code_is_status_124(build):
    assert main(["run", build(SPIN), "--cycles", "100", "--exit-code"]) == 124


@pytest.mark.parametrize("place", ["spin", "0x102"])
def test_a_breakpoint_stops_before_its_instruction(build, capfd, place):
    assert main(["run", build(SPIN), "--break", place, "--json"]) == 0
    facts = json.loads(capfd.readouterr().out)
    assert (facts["reason"], facts["pc"], facts["cycles"]) == ("breakpoint", 0x102, 3)


def test_a_trace_lists_cycles_words_and_changed_registers(build, tmp_path):
    trace = tmp_path / "trace.txt"
    assert main(["run", build(SPIN), "--cycles", "6", "--trace", str(trace)]) == 0
    lines = [line.split() for line in trace.read_text().splitlines()[1:]]
    assert lines == [
        ["0", "0x000000", "goto", "_main"],
        ["2", "0x000100", "clr.w", "w0"],
        ["3", "0x000102", "inc.w", "w0,", "w0", "W0=0001"],
        ["4", "0x000104", "mov.w", "w0,", "_counter"],
        ["5", "0x000106", "bra", "_spin"],
    ]


def test_a_trace_shows_exceptions_and_sleep(build, tmp_path, capfd):
    trace = tmp_path / "trace.txt"
    path = build(ECHO, {"U1RXInterrupt": "receive"})
    stamps = tmp_path / "stamps"
    stamps.write_text("100 1 48\n")
    assert main(["run", path, "--trace", str(trace), "--replay", str(stamps)]) == 0
    text = trace.read_text()
    assert "-- exception: _receive" in text
    assert "mov.w U1RXREG, w1                             W1=0048" in text
    assert "nothing executed for" in text
    assert capfd.readouterr().out == "I"


def test_a_trace_does_not_affect_the_run(build, tmp_path, capfd):
    path = build(HELLO)
    main(["run", path, "--json"])
    plain = json.loads(capfd.readouterr().out)
    main(["run", path, "--json", "--trace", str(tmp_path / "t")])
    traced = json.loads(capfd.readouterr().out)
    assert [plain[key] for key in ("reason", "pc", "cycles", "uart1")] == [
        traced[key] for key in ("reason", "pc", "cycles", "uart1")
    ]


def test_standard_input_reaches_uart1_and_its_end_ends_a_sleeping_firmware(build):
    done = emu("run", build(ECHO, {"U1RXInterrupt": "receive"}), input=b"HAL")
    assert done.stdout == b"IBM"
    assert done.stderr.splitlines()[-1].startswith(b"halt")


def test_an_open_input_keeps_a_sleeping_firmware_alive_until_it_is_closed(build):
    """engines.md §10: a sleeping firmware runs on while its input is open; end of file ends the run."""
    process = subprocess.Popen(
        [sys.executable, "-m", "emu", "run", build(ECHO, {"U1RXInterrupt": "receive"})],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT,
    )  # fmt: skip
    for letter, answer in (b"A", b"B"), (b"x", b"y"):
        process.stdin.write(letter)
        process.stdin.flush()
        assert process.stdout.read(1) == answer
    assert process.poll() is None
    out, err = process.communicate(timeout=HANG)
    assert out == b""
    assert err.splitlines()[-1].startswith(b"halt")
    assert process.returncode == 0


def test_an_open_input_does_not_keep_a_limited_run_waiting(build):
    reader, writer = os.pipe()
    done = emu("run", build(ECHO, {"U1RXInterrupt": "receive"}), "--seconds", "2", stdin=reader)
    os.close(writer)
    os.close(reader)
    last = done.stderr.splitlines()[-1]
    assert last.startswith(b"limit")
    assert b"29,491,200 cycles, 2.000000 s" in last


def test_a_recorded_session_replays_to_the_same_bytes_at_the_same_cycles(build, tmp_path, capfd):
    path = build(ECHO, {"U1RXInterrupt": "receive"})
    record = tmp_path / "record"
    process = subprocess.Popen(
        [sys.executable, "-m", "emu", "run", path, "--record", str(record), "--pace", "realtime", "--json"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT,
    )  # fmt: skip
    for letters in (b"A", b"hello", b"z"):
        process.stdin.write(letters)
        process.stdin.flush()
        time.sleep(0.15)
    live = json.loads(process.communicate(timeout=HANG)[0])
    assert live["uart1"] == "Bifmmp{"
    assert main(["run", path, "--replay", str(record), "--json"]) == 0
    again = json.loads(capfd.readouterr().out)
    assert [again[key] for key in ("uart1", "cycles", "pc")] == [live[key] for key in ("uart1", "cycles", "pc")]


def test_ctrl_c_ends_a_run_cleanly(build, tmp_path):
    trace = tmp_path / "trace.txt"
    process = subprocess.Popen(
        [sys.executable, "-m", "emu", "run", build(SPIN), "--trace", str(trace)],
        stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=ROOT,
    )  # fmt: skip
    deadline = time.monotonic() + HANG
    while not any(file.stat().st_size > 1000 for file in tmp_path.glob("trace.txt*")):  # the program loops
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    err = process.communicate(timeout=HANG)[1].decode()
    assert process.returncode == 0
    assert err.splitlines()[-1].startswith("interrupted at 0x0001")
    assert "inc.w w0, w0" in trace.read_text()


def test_a_closed_output_pipe_is_not_an_error(build):
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, "-m", "emu", "run", build(HELLO)],
        stdin=subprocess.DEVNULL, stdout=writer, stderr=subprocess.PIPE, cwd=ROOT, timeout=HANG, check=False,
    )  # fmt: skip
    os.close(writer)
    assert b"Traceback" not in done.stderr
    assert done.returncode == 0


def test_uarts_can_be_files(build, tmp_path):
    log = tmp_path / "log"
    done = emu("run", build(HELLO), "--uart1", str(log), "--uart2", "-")
    assert done.stdout == b""
    assert log.read_bytes() == b"hi!\n"


def test_a_tcp_client_talks_to_the_firmware(build):
    path = build(ECHO, {"U1RXInterrupt": "receive"})
    process = subprocess.Popen(
        [sys.executable, "-m", "emu", "run", path, "--uart1", "tcp:0"],
        stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=ROOT,
    )  # fmt: skip
    port = int(process.stderr.readline().rsplit(b":", 1)[1])
    with socket.create_connection(("127.0.0.1", port), timeout=HANG) as client:
        client.sendall(b"AB")
        assert client.recv(1, socket.MSG_WAITALL) == b"B"
        assert client.recv(1) == b"C"
    assert process.communicate(timeout=HANG)[1].splitlines()[-1].startswith(b"halt")


def test_a_terminal_talks_to_the_firmware(build):
    path = build(ECHO, {"U1RXInterrupt": "receive"})
    process = subprocess.Popen(
        [sys.executable, "-m", "emu", "run", path, "--uart1", "pty"],
        stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=ROOT,
    )  # fmt: skip
    name = process.stderr.readline().split()[-1].decode()
    terminal = os.open(name, os.O_RDWR | os.O_NOCTTY)
    os.write(terminal, b"A")
    assert os.read(terminal, 1) == b"B"
    os.close(terminal)
    process.send_signal(signal.SIGTERM)
    assert process.communicate(timeout=HANG)[1].splitlines()[-1].startswith(b"interrupted")
    assert process.returncode == 0


def test_a_run_on_a_terminal_takes_typed_input(build):
    master, slave = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "emu", "run", build(ECHO, {"U1RXInterrupt": "receive"})],
        stdin=slave, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT,
    )  # fmt: skip
    os.write(master, b"A\n")
    assert process.stdout.read(2) == b"B\x0b"
    os.write(master, b"\x04")
    assert process.communicate(timeout=HANG)[1].splitlines()[-1].startswith(b"halt")
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--uart2", "-"], "only one of the UARTs, --trace, --record and --json can use standard output"),
        (["--uart1", "tcp:x"], "expected tcp:PORT"),
        (["--uart1", "/nowhere/log"], "/nowhere/log: No such file or directory"),
        (["--break", "nowhere"], "'nowhere': not in the program"),
        (["--break", "counter"], "not code"),
        (["--break", "0x101"], "0x101 is not a program address; expected an even number, 0 to 0x7ffffe"),
        (["--break", "-2"], "-2 is not a program address"),
        (["--break", "99999999999"], "99999999999 is not a program address"),
        (["--replay", "/nowhere/stamps"], "/nowhere/stamps: No such file or directory"),
        (["--trace", "/nowhere/trace"], "No such file or directory"),
        (["--engine", "steam"], "there is no engine 'steam'"),
    ],
)
def test_bad_requests_are_one_line_and_status_2_or_126(build, capfd, arguments, expected):
    path = build(HELLO)
    assert main(["run", path, *arguments]) == 2
    err = capfd.readouterr().err
    assert expected in err
    assert err.count("\n") == 1
    assert main(["run", path, *arguments, "--exit-code"]) == 126


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--seconds", "0"], "expected seconds above 0, like 5 or 0.25, not '0'"),
        (["--seconds", "x"], "expected seconds above 0"),
        (["--seconds", "1/0"], "expected seconds above 0"),
        (["--seconds", "1e999999999"], "expected seconds above 0"),
        (["--cycles=-1"], "expected a number of cycles above 0, not '-1'"),
        (["--cycles", "0"], "expected a number of cycles above 0"),
        (["--cycles", "1", "--seconds", "1"], "not allowed with argument"),
    ],
)
def test_bad_limits_are_usage_mistakes(build, capfd, arguments, expected):
    with pytest.raises(SystemExit) as caught:
        main(["run", build(HELLO), *arguments])
    assert caught.value.code == 2
    err = capfd.readouterr().err
    assert expected in err
    assert err.count("\n") == 1


def test_an_incomplete_trace_file_is_removed(build, tmp_path, capfd):
    target = tmp_path / "out"
    target.mkdir()
    assert main(["run", build(HELLO), "--uart1", str(target), "--trace", str(tmp_path / "trace")]) == 2
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["out", "program.elf"]


@pytest.mark.parametrize("engine", ["plain", "jit"])
def test_a_register_without_a_model_is_named_once(build, capfd, engine):
    """An access to a register without a model is reported once; BSRAM and SSRAM are in docs/plain-registers.md."""
    source = "main:\nmov #1, w0\nmov w0, {BSRAM}\nmov {SSRAM}, w1\nmov w0, {BSRAM}\npwrsav #1\n"
    main(["run", build(source), "--engine", engine])
    notes = [line for line in capfd.readouterr().err.splitlines() if "note:" in line]
    assert len(notes) == 2
    assert "BSRAM is written at 0x000102 (_main+0x2) but has no model" in notes[0]
    assert "SSRAM is read at 0x000104 (_main+0x4) but has no model" in notes[1]


@pytest.mark.parametrize("engine", ["plain", "jit"])
def test_a_setting_without_a_model_is_named_once(build, capfd, engine):
    """A setting without a model is reported once; frame sync of SPI1 is in docs/accuracy.md."""
    source = "main:\nmov #0x4020, w0\nmov w0, {SPI1CON}\nmov w0, {SPI1CON}\npwrsav #1\n"
    main(["run", build(source), "--engine", engine])
    (note,) = [line for line in capfd.readouterr().err.splitlines() if "note:" in line]
    assert "at 0x000102 (_main+0x2) for an unmodelled function: SPI1CON.FRMEN" in note
