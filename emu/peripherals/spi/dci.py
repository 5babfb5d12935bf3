"""Data converter interface (§14): bit clock, frames, word slots, buffering, interrupts, as far as a codec needs them.

The environment exchanges words, left-aligned in 16 bits as in TXBUF and RXBUF: `on_word(word, slot, cycle)` receives
each transmitted word, `source(slot, cycle)` returns each received one. As clock slave (CSCKD = 1) the module transfers
nothing, because there is no external clock. AC-Link modes are framed like the multichannel mode. UNVERIFIED: TXBUF is
copied to the shadow registers when DCIEN is set, without an interrupt.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

from emu.chips.chip import DciSite
from emu.peripherals.base import ChipContext, Peripheral
from emu.peripherals.interrupt_lines import Interrupts
from emu.peripherals.pins import parse_pin
from emu.peripherals.ports.ports import Port
from emu.system.device import Register
from emu.system.events import NEVER

_BUFFERS: Final = 4


class Dci(Peripheral):
    """The codec port. A frame is (COFSG + 1) slots of (WS + 1) bits; a bit is 2 (BCG + 1) Tcy."""

    def __init__(self, site: DciSite, context: ChipContext, interrupts: Interrupts, ports: dict[int, Port]) -> None:
        super().__init__("dci", context)
        self._line: Final = interrupts.line(site.irq)
        self.con1, self.con2, self.con3 = (self.register(f"DCICON{number}") for number in (1, 2, 3))
        self.stat: Final = self.register("DCISTAT")
        self.tscon: Final = self.register("TSCON")
        self.rscon: Final = self.register("RSCON")
        self.idle_bit = (self.con1, "DCISIDL")
        self._rxbuf: Final = [self.register(f"RXBUF{index}") for index in range(_BUFFERS)]
        self._txbuf: Final = [self.register(f"TXBUF{index}") for index in range(_BUFFERS)]
        self.con1.written_by(self._con1_written)
        for register in (self.con2, self.con3, self.tscon, self.rscon):
            register.written_by(lambda _old, _new, _lanes: self._settings_written())
        self.stat.computed(self._read_stat)
        for register in self._rxbuf:
            register.read_by(partial(self._rx_read, register))
        for register in self._txbuf:
            register.written_by(self._tx_written)
        self.on_word: Callable[[int, int, int], None] | None = None
        self.source: Callable[[int, int], int] | None = None
        self._pins: Final = {role: parse_pin(getattr(site, f"{role}_pin")) for role in ("csdi", "csdo", "csck", "cofs")}
        self._ports: Final = ports
        self._tx_shadow: Final = self.array("tx_shadow", "H", _BUFFERS)
        self._rx_shadow: Final = self.array("rx_shadow", "H", _BUFFERS)
        self._place: Final = self.cell("place", "B")
        """Number of words transferred since the last buffer exchange."""
        self._slot: Final = self.cell("slot", "B")
        """Slot whose word will be complete at the posted event."""
        self._frame: Final = self.timestamp("frame", NEVER)
        """First cycle of the frame that contains the posted event."""
        self._stop: Final = self.timestamp("stop", NEVER)
        """Cycle after the last frame, once DCIEN has been cleared."""
        self._word_event: Final = self.slot("word", self._word_done)

    # -- time --------------------------------------------------------------------------------------------------------

    @property
    def bit_time(self) -> int:
        """Bit clock period in Tcy; 0 while the generator is stopped (BCG = 0 or external clock selected)."""
        return 0 if self.con1["CSCKD"] or not self.con3["BCG"] else 2 * (self.con3["BCG"] + 1)

    @property
    def _slot_time(self) -> int:
        return self.bit_time * (self.con2["WS"] + 1)

    @property
    def frame_time(self) -> int:
        """Length of a frame in Tcy."""
        return self._slot_time * (self.con2["COFSG"] + 1)

    def _post(self, frame: int, first: int) -> None:
        """Post the end of the first enabled slot numbered `first` or above in the frame that began at cycle `frame`."""
        enabled = self.tscon.value | self.rscon.value
        slots = self.con2["COFSG"] + 1
        if not self.frame_time or not enabled & (1 << slots) - 1:
            self._frame.value = NEVER
            self.events.cancel(self._word_event)
            return
        slot = first
        while slot >= slots or not enabled >> slot & 1:
            slot += 1
            if slot >= slots:
                slot, frame = 0, frame + self.frame_time
        if frame >= self._stop.value:
            self._frame.value = NEVER
            self._release()
            return
        self._slot.value = slot
        self._frame.value = frame
        self.events.set(self._word_event, max(frame + (slot + 1) * self._slot_time, self.now + 1))

    def _word_done(self, due: int) -> None:
        """Handle the end of a slot, in which one word was sent and one received."""
        slot, place = self._slot.value, self._place.value
        mask = ~((1 << 15 - self.con2["WS"]) - 1) & 0xFFFF
        out = self._tx_shadow[place] & mask
        if self.tscon.value >> slot & 1 and self.on_word is not None:
            self.on_word(out, slot, due)
        received = self.source(slot, due) if self.source is not None else 0
        word = out if self.con1["DLOOP"] else received
        self._rx_shadow[place] = word & mask
        self._place.value = place + 1
        if place >= self.con2["BLEN"]:
            self._exchange()
        self._post(self._frame.value, slot + 1)

    def _exchange(self) -> None:
        """Exchange shadow registers and buffers after BLEN + 1 words (§14)."""
        self._place.value = 0
        if self.stat["RFUL"]:
            self.stat["ROV"] = 1
        for index in range(_BUFFERS):
            self._rxbuf[index].value = self._rx_shadow[index]
        self.stat["RFUL"] = 1
        self._load()
        self._line.request()

    def _load(self) -> None:
        """Copy TXBUF to the shadow registers.

        If there is no new data, this is an underflow: send zeros or repeat (UNFM).
        """
        if self.stat["TMPTY"]:
            self.stat["TUNF"] = 1
            if not self.con1["UNFM"]:
                for index in range(_BUFFERS):
                    self._tx_shadow[index] = 0
            return
        for index in range(_BUFFERS):
            self._tx_shadow[index] = self._txbuf[index].value
        self.stat["TMPTY"] = 1

    # -- registers ---------------------------------------------------------------------------------------------------

    def _rx_read(self, register: Register) -> int:
        self.stat["RFUL"] = self.stat["ROV"] = 0
        return register.value

    def _tx_written(self, _old: int, _new: int, _lanes: int) -> None:
        self.stat["TMPTY"] = self.stat["TUNF"] = 0

    def _read_stat(self) -> int:
        """Read DCISTAT; SLOT is the slot being transferred."""
        stored = self.stat.value & 0xFF
        if self._frame.value == NEVER or not self.frame_time:
            return stored
        passed = (self.now - self._frame.value) % self.frame_time
        return stored | passed // self._slot_time << 8

    def _con1_written(self, old: int, new: int, _lanes: int) -> None:
        enable = 1 << self.context.chip.sfrs["DCICON1"].fields["DCIEN"][0]
        if new & enable and self.con1["CSCKD"]:
            self.bus.report_unmodelled("DCICON1.CSCKD: no external clock exists, the codec port transfers nothing")
        if new & enable and self.con1["COFSM"] & 2:
            self.bus.report_unmodelled("DCICON1.COFSM: AC-Link frames are sent as multichannel frames")
        if new & ~old & enable:
            self._start()
        elif old & ~new & enable:
            self._finish_frame()
        else:
            self._settings_written()

    def _settings_written(self) -> None:
        """Apply new clock or slot settings: start or stop transfers. Other changes apply from the next word on."""
        if not self.con1["DCIEN"]:
            return
        if self._frame.value == NEVER:
            self._post(self.now + 1, 0)
        elif not self.frame_time:
            self._frame.value = NEVER
            self.events.cancel(self._word_event)

    def _start(self) -> None:
        self._stop.value = NEVER
        self._place.value = 0
        self._load()
        self.stat["TUNF"] = 0
        for role, drive in (("csdi", False), ("csdo", True), ("csck", not self.con1["CSCKD"])):
            port, pin = self._pins[role]
            self._ports[port].claim(pin, drive, 0)
        port, pin = self._pins["cofs"]
        self._ports[port].claim(pin, not self.con1["COFSD"], 0)
        self._post(self.now + 1, 0)

    def _finish_frame(self) -> None:
        """Handle DCIEN = 0: the current frame is the last one (§14); without a clock it ends immediately."""
        if not self.frame_time or self._frame.value == NEVER:
            self._frame.value = NEVER
            self._release()
            return
        behind = max(self.now + 1 - self._frame.value, 0)
        self._stop.value = self._frame.value + -(-behind // self.frame_time) * self.frame_time
        if self._frame.value >= self.now + 1:  # the posted word belongs to a frame that will not be sent
            self._frame.value = NEVER
            self.events.cancel(self._word_event)
            self._release()

    def release_pins(self) -> None:
        """Release all four pins to LAT and TRIS."""
        self._release()

    def _release(self) -> None:
        self.events.cancel(self._word_event)
        for port, pin in self._pins.values():
            self._ports[port].release(pin)

    def reset(self, power_on: bool) -> None:
        """Reset to off. The flags have already been reset with DCISTAT."""
        self._frame.value = self._stop.value = NEVER
        self._place.value = 0
