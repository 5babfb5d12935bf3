"""Ports, change notification and external interrupts (dspic30f6014a.md §6, §5.5)."""

from __future__ import annotations

import random

import pytest

from emu.peripherals.pins import parse_pin

from .conftest import Rig


def test_output_pin_follows_the_latch_in_the_next_cycle(rig):
    """§18: an output pin changes in the cycle after the write of its latch."""
    changes = []
    rig.dev.pins.watch("RD5", lambda cycle, changed, levels: changes.append((cycle, changed, levels & changed)))
    rig.at(10).write("TRISD", 0xFFDF)
    rig.at(20).write("LATD", 0x20)
    assert changes == [(21, 0x20, 0x20)]


def test_port_read_right_behind_a_latch_write_sees_the_old_pin(rig):
    """§6: a port read in the cycle after a latch write reads the old pin; a NOP between them is needed."""
    rig.write("TRISD", 0)
    rig.at(20).write("LATD", 0x20)
    assert rig.at(21).read("PORTD") == 0
    assert rig.at(22).read("PORTD") == 0x20
    assert rig.read("LATD") == 0x20


def test_port_write_goes_to_the_latch_and_reads_come_from_the_pins(rig):
    """§6: a port write goes to the latch, and a port read returns the external levels of input pins."""
    rig.write("PORTF", 0x0AA)
    assert rig.read("LATF") == 0x0AA
    rig.dev.pins.set("RF1", 1)
    rig.dev.pins.set("RF8", 1)
    assert rig.at(5).read("PORTF") == 0x102


def test_byte_write_to_a_port_keeps_the_other_half_of_the_latch(rig):
    """§18: a byte write to a port keeps the other half of the latch."""
    rig.write("LATD", 0x1234)
    rig.write("PORTD", 0xAB00, lanes=0xFF00)
    assert rig.read("LATD") == 0xAB34


def test_read_modify_write_on_the_port_copies_pins_to_latches(rig):
    """§6: a read-modify-write on the port copies pin levels to latches: LATD bit 0 was 1 on an input pin that is
    low."""
    rig.write("LATD", 0x0001)
    rig.at(5).write("PORTD", rig.read("PORTD") | 0x0100)
    assert rig.read("LATD") == 0x0100


def test_unimplemented_port_bits_read_0(rig):
    """§6: unimplemented bits of a port read 0; port C has bits 1-4 and 13-15."""
    rig.dev.pins.set_port(2, 0xFFFF, 0xFFFF)
    assert rig.at(3).read("TRISC") == 0xE01E
    rig.write("LATC", 0xFFFF)
    assert rig.read("LATC") == 0xE01E


@pytest.mark.parametrize("name", ["RD16", "RH1", "D3", "RA"])
def test_bad_pin_names_are_refused(name):
    """Names of pins have the form RC14; others are refused."""
    with pytest.raises(ValueError, match="not a pin name"):
        parse_pin(name)


def test_change_notice_rises_one_cycle_behind_either_edge_of_an_enabled_input(rig):
    """§6.2: an edge on an enabled change notification input, here CN13 = RD4, sets the flag one cycle later."""
    rig.write("CNEN1", 1 << 13)
    rig.at(100).dev.pins.set("RD4", 1)
    assert not rig.at(100).flag("CNIF")
    assert rig.at(101).flag("CNIF")
    rig.clear_flags()
    rig.at(200).dev.pins.set("RD4", 0)
    assert rig.at(201).flag("CNIF")


def test_change_notice_ignores_outputs_and_disabled_pins(rig):
    """§6.2: change notification ignores outputs and disabled pins; enabling an input raises no flag."""
    rig.write("TRISD", 0xFFEF)
    rig.dev.pins.set("RD5", 1)
    rig.at(1).write("CNEN1", 0xFFFF & ~(1 << 14))
    rig.at(10).write("LATD", 0x10)
    rig.at(20).dev.pins.set("RD5", 0)
    assert not rig.at(100).flag("CNIF")


CN_PINS = "RC14 RC13 RB0 RB1 RB2 RB3 RB4 RB5 RG6 RG7 RG8 RG9 RB15 RD4 RD5 RD6 RD7 RF4 RF5 RD13 RD14 RD15 RA6 RA7"


@pytest.mark.parametrize(("number", "pin"), list(enumerate(CN_PINS.split())))
def test_every_change_notice_input_sits_on_its_pin(rig, number, pin):
    """§6.2: every change notification input is on the pin of the reference's table."""
    register, bit = ("CNEN1", number) if number < 16 else ("CNEN2", number - 16)
    rig.write("ADPCFG", 0xFFFF)
    rig.dev.pins.analog[1] = 0
    rig.write(register, 1 << bit)
    rig.at(10).dev.pins.set(pin, 1)
    assert rig.at(12).flag("CNIF")


def test_pull_up_lifts_a_pin_nothing_drives(rig):
    """§6.2: CNPU pulls up a pin that is not driven."""
    assert rig.at(2).read("PORTG") & 0x40 == 0
    rig.write("CNPU1", 1 << 8)
    assert rig.at(4).read("PORTG") & 0x40
    rig.dev.pins.set("RG6", 0)
    assert rig.at(5).read("PORTG") & 0x40 == 0
    rig.dev.pins.release("RG6")
    assert rig.at(6).read("PORTG") & 0x40


@pytest.mark.parametrize(("number", "pin"), list(enumerate(["RF6", "RA12", "RA13", "RA14", "RA15"])))
def test_external_interrupt_takes_the_edge_intcon2_chooses(rig, number, pin):
    """§5.5: INTCON2 selects the edge of an external interrupt, 0 for rising and 1 for falling; the flag rises one
    cycle after the edge."""
    name = f"INT{number}IF"
    rig.at(10).dev.pins.set(pin, 1)
    assert rig.at(11).flag(name)
    rig.clear_flags()
    rig.at(20).dev.pins.set(pin, 0)
    assert not rig.at(25).flag(name)
    rig.write("INTCON2", 1 << number)
    rig.at(30).dev.pins.set(pin, 1)
    assert not rig.at(35).flag(name)
    rig.at(40).dev.pins.set(pin, 0)
    assert rig.at(41).flag(name)


def test_external_interrupt_detects_edges_driven_by_the_chip(rig):
    """§5.5: external interrupts also detect edges that the chip itself drives on the pin."""
    rig.write("TRISA", 0)
    rig.at(10).write("LATA", 1 << 12)
    assert not rig.at(11).flag("INT1IF")
    assert rig.at(12).flag("INT1IF")


def test_uart_owns_its_pins_while_enabled(rig):
    """§6: while UARTEN and UTXEN are set, the UART drives TX instead of LAT and TRIS."""
    rig.write("TRISF", 0)
    rig.at(5)
    assert rig.dev.pins.get("RF3") == 0
    rig.write_all(U1MODE=0x8000, U1STA=0x400)
    assert rig.at(7).dev.pins.get("RF3") == 1
    rig.write("U1MODE", 0)
    assert rig.at(9).dev.pins.get("RF3") == 0


def native_latch_write(rig, letter, value):
    """Apply a native LATx write to the record fields. Return False if native code would call Python."""
    index = "ABCDEFG".index(letter)
    record, fields = rig.record, rig.record.fields
    view = {"H": record.u16, "Q": record.u64, "B": record.u8}

    def field(name, offset=0):
        return view[fields[name].kind], fields[name].index + offset

    def get(name, offset=0):
        table, place = field(name, offset)
        return table[place]

    def put(name, number, offset=0):
        table, place = field(name, offset)
        table[place] = number

    address = rig.address("LAT" + letter) >> 1
    mask = rig.bus.writable[address]
    own, level, drive = get(f"port{letter}.owned"), get("pins.level", index), get("pins.drive", index)
    out = get("pins.output", index) & own | value & ~own & mask
    new = level & ~drive | out & drive & ~get("pins.analog", index)
    changed, lazy = level ^ new, get("pins.lazy", index)
    count = get("pins.ring_count")
    if changed & get("pins.eager", index) or (changed & lazy and count == 256):
        return False
    record.u16[address] = value & mask
    put("pins.output", out, index)
    cycle = rig.events.now + 1
    if get("pins.changed", index) != cycle:
        put("pins.before", level, index)
        put("pins.changed", cycle, index)
    put("pins.level", new, index)
    if changed & lazy:
        put("pins.ring", cycle << 24 | index << 16 | new, count)
        put("pins.ring_count", count + 1)
    return True


def test_native_latch_writes_give_the_same_state_and_edges():
    """README: native and Python paths give the same state and edges for any sequence of latch writes, with TRIS
    writes between them."""
    rigs, seen = [Rig(), Rig()], [[], []]
    for rig, edges in zip(rigs, seen, strict=True):
        rig.dev.pins.watch_port(3, 0x00FF, lambda *edge, edges=edges: edges.append(edge), lazy=True)
    draw = random.Random(7)
    for step in range(600):
        value = draw.randrange(0x10000) if step % 50 else 0x0F0F
        tris = draw.choice((0, 0, 0, 0x00F0, 0xFFFF))
        for number, rig in enumerate(rigs):
            rig.at(10 * step)
            if step % 10 == 0:
                rig.write("TRISD", tris)
            rig.at(10 * step + 3)
            if number == 0 or not native_latch_write(rig, "D", value):
                rig.write("LATD", value)
        reads = [[rig.at(10 * step + later).read("PORTD") for later in (4, 5)] for rig in rigs]
        assert reads[0] == reads[1]
    for rig in rigs:
        rig.dev.pins.flush()
    assert seen[0] == seen[1]
    assert len(seen[0]) > 200
    assert rigs[0].dev.pins.level[3] == rigs[1].dev.pins.level[3]


def test_edge_log_sees_every_change_while_it_is_on(rig):
    """While edges are logged, all pins are eager, so native code leaves latch writes to Python and the log has every
    change."""
    rig.write("TRISD", 0)
    rig.dev.pins.edges = []
    assert rig.dev.pins.eager[3] == 0xFFFF
    rig.at(10).write("LATD", 1)
    assert rig.dev.pins.edges == [(11, 3, 1)]
    rig.dev.pins.edges = None
    assert rig.dev.pins.eager[3] & 0xFF == 0


def test_host_code_handles_edges_of_pins_that_only_replaced_watchers_watch(rig):
    """Host code handles edges of a pin for native code until a watcher that it does not replace watches the pin, and
    while edges are not logged. The interpreter always calls the watchers."""
    pins, edges = rig.dev.pins, []

    def replaced(*edge):
        edges.append(edge)

    for pin in ("RD1", "RD2"):
        pins.watch(pin, replaced)
    pins.handle_natively(3, 0x06, [replaced], 0x1000, 0x2000)
    first = pins.native_cell(3).index
    words = rig.record.u64[first : first + 3]
    assert words.tolist() == [0x06, 0x1000, 0x2000]
    rig.write("TRISD", 0)
    rig.at(10).write("LATD", 0x06)
    assert edges == [(11, 0x02, 0x06), (11, 0x04, 0x06)]
    pins.edges = []
    assert words[0] == 0
    pins.edges = None
    assert words[0] == 0x06
    pins.watch("RD1", lambda *_edge: None)
    assert words[0] == 0x04
    words[0] = 0
    pins.resume_native(3)
    assert words[0] == 0x04
