"""CAN1/2 (§15): modes, transmit buffers, filters and masks, receive buffers, interrupts, loopback.

The environment exchanges frames: `on_frame(frame, cycle)` returns True to acknowledge a sent frame; `receive(frame)`
delivers a frame to the node. Without a listener no frame is acknowledged, as for a node alone on the bus: TXERR is set,
TEC rises to 128, and the message stays pending until the next write to the module's registers. Not modelled:
arbitration with other nodes, error frames, bus-off.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.chips.chip import CanSite
from emu.peripherals.base import ChipContext, Peripheral
from emu.peripherals.can.frame import CanFrame
from emu.peripherals.interrupt_lines import Interrupts
from emu.peripherals.pins import parse_pin
from emu.peripherals.ports.ports import Port
from emu.system.events import NEVER

_NORMAL, _DISABLE, _LOOPBACK, _LISTEN, _CONFIGURE, _LISTEN_ALL = 0, 1, 2, 3, 4, 7
"""Values of REQOP and OPMODE (§15)."""
_MODE_DELAY: Final = 4  # UNVERIFIED: "a few Tcy" (§15)
_ALONE_TEC: Final = 128
"""Transmit error count of a node whose frames no other node acknowledges; it stays error-passive."""
_ICODES: Final = (("ERRIF", 1), ("WAKIF", 7), ("TXB0IF", 4), ("TXB1IF", 3), ("TXB2IF", 2), ("RXB0IF", 6), ("RXB1IF", 5))
"""ICODE values by pending interrupt, highest priority first. UNVERIFIED order."""
_FILTERS: Final = {0: (0, 1), 1: (2, 3, 4, 5)}
"""Numbers of the filters of each receive buffer; mask n belongs to buffer n (§15)."""


class Can(Peripheral):
    """One CAN module."""

    def __init__(self, site: CanSite, context: ChipContext, interrupts: Interrupts, ports: dict[int, Port]) -> None:
        super().__init__(f"can{site.number}", context)
        self._line: Final = interrupts.line(site.irq)
        self._prefix: Final = f"C{site.number}"
        prefix = self._prefix
        registers = [name for name, sfr in context.chip.sfrs.items() if name.startswith(prefix) and sfr.size == 2]
        self._r: Final = {name[len(prefix) :]: self.register(name) for name in registers}
        self.ctrl, self.intf, self.inte, self.ec = (self._r[name] for name in ("CTRL", "INTF", "INTE", "EC"))
        self.idle_bit = (self.ctrl, "CANSIDL")
        self.ctrl.written_by(self._ctrl_written)
        self.inte.written_by(lambda _old, _new, _lanes: self._enables_written())
        self.intf.written_by(lambda _old, _new, _lanes: self._show_icode())
        for number in range(3):
            self._r[f"TX{number}CON"].written_by(lambda _old, _new, _lanes: self._requested())
        self.on_frame: Callable[[CanFrame, int], bool] | None = None
        port, self._tx_pin = parse_pin(site.tx_pin)
        self._tx_port: Final = ports[port]
        self._sending: Final = self.cell("sending", "B")
        """1 + number of the transmit buffer that is being sent; 0 if none is."""
        self._wire: Final = self.slot("wire", self._sent)
        self._mode: Final = self.slot("mode", self._mode_changed)

    # -- modes and time ----------------------------------------------------------------------------------------------

    @property
    def bit_time(self) -> float:
        """Bit time in Tcy. Fcan is Fcy if CANCKS = 1, else 4 Fcy (§15)."""
        cfg1, cfg2 = self._r["CFG1"], self._r["CFG2"]
        quantum = 2 * (cfg1["BRP"] + 1) / (1 if self.ctrl["CANCKS"] else 4)
        return quantum * (1 + cfg2["PRSEG"] + 1 + cfg2["SEG1PH"] + 1 + cfg2["SEG2PH"] + 1)

    def _ctrl_written(self, old: int, new: int, _lanes: int) -> None:
        if self.ctrl["CANCAP"]:
            self.bus.report_unmodelled(f"{self.ctrl.name}.CANCAP: capture of received frames by a timer")
        if self.ctrl["ABAT"]:
            self._abort_all()
        if self.ctrl["REQOP"] != self.ctrl["OPMODE"] and self.events.due(self._mode) == NEVER:
            self.events.set(self._mode, self.now + 1 + _MODE_DELAY)

    def _mode_changed(self, due: int) -> None:
        """Enter the requested mode after the current frame has been sent."""
        if self._sending.value:
            self.events.set(self._mode, self.events.due(self._wire) + _MODE_DELAY)
            return
        mode = self.ctrl["REQOP"]
        self.ctrl["OPMODE"] = mode
        if mode in (_NORMAL, _LOOPBACK):  # the module drives CiTX; the idle level is recessive
            self._tx_port.claim_now(self._tx_pin, drive=True, level=1)
        else:
            self._tx_port.release_now(self._tx_pin)
        self._start_next(due)

    # -- transmit ----------------------------------------------------------------------------------------------------

    def _requested(self) -> None:
        if not self._sending.value:
            self._start_next(self.now + 1)

    def _start_next(self, cycle: int) -> None:
        """Start to send the pending buffer with the highest TXPRI; among equal ones, the highest number."""
        if self.ctrl["OPMODE"] not in (_NORMAL, _LOOPBACK) or self.is_frozen:
            return
        pending = [number for number in range(3) if self._r[f"TX{number}CON"]["TXREQ"]]
        if not pending:
            return
        number = max(pending, key=lambda n: (self._r[f"TX{n}CON"]["TXPRI"], n))
        con = self._r[f"TX{number}CON"]
        con["TXABT"] = con["TXLARB"] = con["TXERR"] = 0
        self._sending.value = number + 1
        self.events.set(self._wire, cycle + round(self.frame(number).wire_bits() * self.bit_time))

    def frame(self, number: int) -> CanFrame:
        """Return the message in transmit buffer 0..2."""
        sid, eid, dlc = (self._r[f"TX{number}{part}"] for part in ("SID", "EID", "DLC"))
        identifier = sid["SID10_6"] << 6 | sid["SID5_0"]
        extended = bool(sid["TXIDE"])
        if extended:
            low = eid["EID17_14"] << 14 | eid["EID13_6"] << 6 | dlc["EID5_0"]
            identifier = identifier << 18 | low
        remote = bool(dlc["TXRTR"] if extended else sid["SRR"])
        length = dlc["DLC"]
        words = b"".join(self._r[f"TX{number}B{word}"].value.to_bytes(2, "little") for word in range(1, 5))
        return CanFrame(identifier, extended, remote, length, b"" if remote else words[: min(length, 8)])

    def _sent(self, due: int) -> None:
        number = self._sending.value - 1
        self._sending.value = 0
        con = self._r[f"TX{number}CON"]
        frame = self.frame(number)
        if self.ctrl["OPMODE"] == _LOOPBACK:
            acknowledged = True
            self._accept(frame)
        else:
            acknowledged = self.on_frame is not None and self.on_frame(frame, due)
        if acknowledged:
            con["TXREQ"] = 0
            self.ec.value = max((self.ec.value >> 8) - 1, 0) << 8 | self.ec.value & 0xFF
            self._raise(f"TXB{number}IF")
            self._start_next(due)
        else:
            con["TXERR"] = 1
            self.ec.value = _ALONE_TEC << 8 | self.ec.value & 0xFF
            for flag in ("EWARN", "TXWARN", "TXBP"):
                self.intf[flag] = 1
            self._raise("ERRIF")

    def _abort_all(self) -> None:
        """Handle ABAT: discard the pending messages except the one that is being sent."""
        for number in range(3):
            con = self._r[f"TX{number}CON"]
            if con["TXREQ"] and self._sending.value != number + 1:
                con["TXREQ"] = 0
                con["TXABT"] = 1
        self.ctrl["ABAT"] = 0

    # -- receive -----------------------------------------------------------------------------------------------------

    def receive(self, frame: CanFrame) -> bool:
        """Receive a frame from another node. Return whether this node acknowledged it."""
        mode = self.ctrl["OPMODE"]
        if mode not in (_NORMAL, _LISTEN, _LISTEN_ALL) or self.is_frozen:
            return False
        self._accept(frame)
        return mode == _NORMAL

    def _accept(self, frame: CanFrame) -> None:
        for buffer, filters in _FILTERS.items():
            for number in filters:
                if self.ctrl["OPMODE"] == _LISTEN_ALL or self._passes(frame, number, buffer):
                    self._store(frame, buffer, number)
                    return

    def _passes(self, frame: CanFrame, number: int, mask: int) -> bool:
        filter_sid, mask_sid = self._r[f"RXF{number}SID"], self._r[f"RXM{mask}SID"]
        if mask_sid["MIDE"] and bool(filter_sid["EXIDE"]) != frame.extended:
            return False
        sid = frame.identifier >> 18 if frame.extended else frame.identifier
        if (sid ^ filter_sid["SID"]) & mask_sid["SID"]:
            return False
        return not (frame.extended and (frame.identifier ^ self._eid(f"RXF{number}")) & self._eid(f"RXM{mask}"))

    def _eid(self, name: str) -> int:
        """Return bits 17:0 of the extended identifier of a filter or mask."""
        return self._r[name + "EIDH"].value << 6 | self._r[name + "EIDL"]["EID5_0"]

    def _store(self, frame: CanFrame, buffer: int, number: int) -> None:
        con = self._r[f"RX{buffer}CON"]
        if buffer == 0 and con["RXFUL"] and con["DBEN"] and not self._r["RX1CON"]["RXFUL"]:
            buffer, con = 1, self._r["RX1CON"]
            self._r["RX0CON"]["JTOFF"] = 1
        if con["RXFUL"]:
            self.intf[f"RXB{buffer}OVFL"] = 1
            self._raise("ERRIF")
            return
        sid, eid, dlc = (self._r[f"RX{buffer}{part}"] for part in ("SID", "EID", "DLC"))
        sid["SID"] = frame.identifier >> 18 if frame.extended else frame.identifier
        sid["RXIDE"] = frame.extended
        sid["SRR"] = frame.extended or frame.remote
        eid.value = frame.identifier >> 6 & 0xFFF if frame.extended else 0
        dlc["EID5_0"] = frame.identifier & 0x3F if frame.extended else 0
        dlc["DLC"] = frame.length
        dlc["RXRTR"] = frame.remote
        padded = frame.data.ljust(8, b"\0")
        for word in range(4):
            self._r[f"RX{buffer}B{word + 1}"].value = int.from_bytes(padded[2 * word : 2 * word + 2], "little")
        con["RXRTRRO"] = frame.remote
        con["FILHIT0" if buffer == 0 else "FILHIT"] = number
        con["RXFUL"] = 1
        self._raise(f"RXB{buffer}IF")

    # -- interrupts --------------------------------------------------------------------------------------------------

    def _enables_written(self) -> None:
        if self.inte["WAKIE"]:
            self.bus.report_unmodelled(f"{self.inte.name}.WAKIE: wake-up by activity on the bus")
        self._signal(self.intf.value & 0xFF)

    def _raise(self, flag: str) -> None:
        self.intf[flag] = 1
        self._signal(1 << self.context.chip.sfrs[self.intf.name].fields[flag][0])

    def _signal(self, flags: int) -> None:
        """Set CiIF for those `flags` whose enable bit is set (§15)."""
        self._show_icode()
        if flags & self.inte.value:
            self._line.request()

    def _show_icode(self) -> None:
        pending = (code for flag, code in _ICODES if self.intf[flag] and self.inte[flag[:-1] + "E"])
        self.ctrl["ICODE"] = next(pending, 0)

    def release_pins(self) -> None:
        """Release the CiTX pin to LAT and TRIS."""
        self._tx_port.release(self._tx_pin)

    def reset(self, power_on: bool) -> None:
        """Reset to configuration mode (CiCTRL = 0x0480)."""
        self._sending.value = 0
