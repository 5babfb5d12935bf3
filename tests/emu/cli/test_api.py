"""Tests of the Python interface."""

from __future__ import annotations

import math
import pydoc

import pytest

import emu
from emu.boards.epuck.board import Epuck
from tests.emu.cli.programs import ECHO, HELLO, SPIN, executable

WORDS = """
main:
    mov #0x5678, w0
    mov w0, 0x800
    mov #0x1234, w0
    mov w0, 0x802
    pwrsav #1
"""


@pytest.fixture
def load(tmp_path):
    """Return a function that assembles a program and loads it into a machine."""

    def make(source, vectors=None, **options):
        path = tmp_path / "program.elf"
        path.write_bytes(executable(source, vectors))
        return emu.load(path, **options)

    return make


def test_peek_and_poke_take_any_size(load):
    machine = load(WORDS)
    machine.run()
    assert machine.peek("counter", 4) == 0x12345678
    assert [machine.peek(0x800 + at, 1) for at in range(4)] == [0x78, 0x56, 0x34, 0x12]
    assert machine.peek(0x801, 2) == 0x3456
    assert machine.peek_bytes("counter", 3) == b"\x78\x56\x34"
    machine.poke("counter", 0x89ABCDEF, 4)
    assert machine.peek("counter", 4) == 0x89ABCDEF
    machine.poke(0x801, -2, 3)
    assert machine.peek(0x800, 8) == 0xFFFFFEEF


def test_peek_of_registers_by_size(load):
    machine = load(HELLO)
    machine.run()
    whole = machine.peek("U1MODE", 4)
    assert whole == machine.peek("U1MODE") | machine.peek("U1STA") << 16
    assert machine.peek("W0", 1) == machine.w[0] & 0xFF


@pytest.mark.parametrize(("place", "size"), [(0x27FF, 2), (0x2800, 1), (-2, 2), (0x800, 0), (0xFFFF, 2)])
def test_unimplemented_memory_is_refused(load, place, size):
    machine = load(WORDS)
    with pytest.raises(ValueError, match="data space"):
        machine.peek(place, size)
    with pytest.raises(ValueError, match="data space"):
        machine.poke(place, 0, size)


@pytest.mark.parametrize(("place", "size"), [(0x800, 4), (0x801, 2)])
def test_read_and_write_accept_what_an_instruction_can_access(load, place, size):
    machine = load(WORDS)
    with pytest.raises(ValueError, match="an instruction accesses"):
        machine.read(place, size)
    with pytest.raises(ValueError, match="an instruction accesses"):
        machine.write(place, 1, size)


def test_hooks_and_runs_accept_names(load):
    machine = load(SPIN)
    seen = []
    remove = machine.hook_pc("spin", lambda: seen.append(machine.cycle))
    stop = machine.run(until="spin")
    assert (stop.reason, stop.pc, stop.cycle) == ("until", 0x102, 3)
    machine.run(cycles=9)
    remove()
    remove()
    machine.run(cycles=100)
    assert seen == [3, 7, 11]


@pytest.mark.parametrize("place", ["nothing", "counter"])
def test_a_hook_at_no_instruction_is_refused(load, place):
    machine = load(SPIN)
    with pytest.raises(KeyError, match=place):
        machine.hook_pc(place, lambda: None)
    with pytest.raises(KeyError, match=place):
        machine.run(until=place)
    for address in (0x103, -2, 0x800000):
        with pytest.raises(ValueError, match="no program address"):
            machine.hook_pc(address, lambda: None)


@pytest.mark.parametrize("board", ["epuck", "none"])
def test_every_listener_receives_the_bytes(load, board):
    """Every listener of a UART receives its bytes; on an e-puck the Bluetooth radio is a listener too."""
    machine = load(HELLO, board=board)
    said: list[tuple[str, int]] = []
    removed = machine.uart[1].listen(lambda byte, _cycle: said.append(("removed", byte)))
    machine.uart[1].listen(lambda byte, _cycle: said.append(("listener", byte)))
    machine.uart[1].on_byte = lambda byte, _cycle: said.append(("replaced", byte))
    machine.uart[1].on_byte = lambda byte, _cycle: said.append(("assigned", byte))
    if machine.board is not None:
        machine.board.bluetooth.listen(lambda byte, _cycle: said.append(("radio", byte)))
    removed()
    machine.run()
    expected = {"listener", "assigned"} | ({"radio"} if board == "epuck" else set())
    assert {who for who, _ in said} == expected
    for who in expected:
        assert bytes(byte for name, byte in said if name == who) == b"hi!\n"


@pytest.mark.parametrize("engine", ["plain", "jit"])
def test_register_hooks_are_many_and_can_be_removed(load, engine):
    machine = load(SPIN.replace("0x800", "{LATB}"), engine=engine, board=None)
    first, second = [], []
    remove_first = machine.hook_sfr("LATB", lambda write, word: first.append((write, word)))
    remove_second = machine.hook_sfr("LATB", lambda write, word: second.append((write, word)))
    machine.run(until="spin")
    machine.run(cycles=8)
    assert first == second == [(True, 1), (True, 2)]
    remove_first()
    remove_first()
    machine.run(cycles=4)
    assert (len(first), len(second)) == (2, 3)
    remove_second()
    machine.run(cycles=4000)
    assert (len(first), len(second)) == (2, 3)
    assert not machine.bus.watched
    with pytest.raises(ValueError, match="no register"):
        machine.hook_sfr("counter", lambda _write, _word: None)


@pytest.mark.parametrize("name", ["SR", "ACCAL", "ACCAU", "RCOUNT", "CORCON"])
def test_a_register_hook_hears_reads_of_the_core_registers_in_native_code(load, name):
    """Hooks on core registers are called, although native code keeps some of these registers in variables."""
    heard = {}
    for engine in ("plain", "jit"):
        machine = load(SPIN.replace("mov w0, 0x800", f"mov {{{name}}}, w1"), engine=engine, board=None)
        if engine == "jit":
            machine.runner.wait, machine.runner.threshold = True, 1
        calls = heard[engine] = []
        machine.hook_sfr(name, lambda *access, calls=calls: calls.append(access))
        machine.run(cycles=2000)
    assert len(heard["plain"]) > 50
    assert heard["plain"] == heard["jit"]


def test_times_are_seconds_or_cycles(load):
    machine = load(SPIN)
    stop = machine.run(seconds=0.001)
    assert 14_745 <= stop.cycle <= 14_747
    assert machine.seconds == pytest.approx(0.001, rel=1e-3)
    assert machine.hz == emu.FCY_HZ
    assert machine.cycles_in(2) == 29_491_200
    with pytest.raises(ValueError, match="not both"):
        machine.run(cycles=1, seconds=1)


@pytest.mark.parametrize(
    "limit",
    [{"seconds": -1}, {"seconds": math.nan}, {"seconds": math.inf}, {"seconds": "1"}, {"cycles": -5}, {"cycles": 2.5},
     {"cycles": math.nan}, {"cycles": "10"}, {"seconds": 0}, {"seconds": 0.0}, {"cycles": 0}],
)  # fmt: skip
def test_limits_that_are_no_time_are_refused(load, limit):
    """The message names the limit, and no instruction runs."""
    machine = load(SPIN)
    machine.run(cycles=100)
    before = machine.cycle
    with pytest.raises(ValueError, match=f"{next(iter(limit))} = .*: expected"):
        machine.run(**limit)
    assert machine.cycle == before


def test_the_shortest_time_runs_an_instruction(load):
    machine = load(SPIN)
    machine.run(seconds=1e-9)
    assert machine.cycle > 0


def test_the_default_board_is_that_of_the_command_line(load):
    assert isinstance(load(SPIN).board, Epuck)
    assert load(SPIN, board="none").board is None
    assert load(SPIN, board=None).board is None
    with pytest.raises(ValueError, match="there is no board 'khepera'"):
        load(SPIN, board="khepera")


def test_a_byte_reaches_a_program_through_either_end_of_the_radio(load):
    machine = load(ECHO, {"U1RXInterrupt": "receive"})
    heard = bytearray()
    machine.board.bluetooth.listen(lambda byte, _cycle: heard.append(byte))
    machine.board.bluetooth.feed(b"a")
    machine.uart[1].feed(b"b")
    machine.run(seconds=0.01)
    assert heard == b"bc"


def test_help_lists_the_interface_in_short_lines():
    text = pydoc.plain(pydoc.render_doc(emu))
    for name in ("load(", "class Machine", "class Stop", "watch(", "FCY_HZ"):
        assert name in text
    assert max(map(len, text.splitlines())) < 300
    text = pydoc.plain(pydoc.render_doc(emu.Machine))
    assert max(map(len, text.splitlines())) < 300
    for name, thing in vars(emu.Machine).items():
        if callable(thing) and not name.startswith("_"):
            assert thing.__doc__, name
