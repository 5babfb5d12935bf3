"""12-bit ADC (§13): sampling, conversion in TAD, scan, alternating inputs, SMPI, buffer halves, triggers.

Times are kept in half Tcy, because TAD is (ADCS + 1) half Tcy. Conversions between two interrupts are not events: they
are caught up when a register is read, an input is about to change, or the interrupt falls due. Analog levels are
ratiometric: 0..65535 of AVDD, so a level of `code << 4` converts to `code`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

from emu.chips.chip import AdcSite
from emu.device import Register
from emu.events import NEVER
from emu.peripherals.interrupts import Interrupts
from emu.peripherals.kit import SLEEP, Kit, Peripheral
from emu.peripherals.pins import parse_pin
from emu.peripherals.timers import Timer

FULL_SCALE: Final = 0x10000
"""AVDD in units of analog level."""
_CONVERSION_TAD: Final = 14
_RC_TAD_SECONDS: Final = 1.5e-6  # UNVERIFIED: 1.2 to 1.5 us (§13)

_OFF, _WAITING, _SAMPLING, _CONVERTING = range(4)
"""States: ADON = 0; nothing connected; SAMP = 1; SAMP = 0 and the converter at work."""

_MANUAL, _INT0, _TIMER3, _AUTO = 0, 1, 2, 7
"""SSRC: what ends sampling (§13)."""

AnalogSource = Callable[[int], int]
"""Analog level 0..65535 as a function of the cycle."""


class Adc(Peripheral):
    """One sample-and-hold behind two input multiplexers."""

    def __init__(self, site: AdcSite, kit: Kit, interrupts: Interrupts, timers: dict[int, Timer]) -> None:
        super().__init__("adc", kit)
        self.site: Final = site
        self._line: Final = interrupts.line(site.irq)
        self._timers: Final = timers
        self.con1, self.con2, self.con3 = (self.register(f"ADCON{number}") for number in (1, 2, 3))
        self.chs: Final = self.register("ADCHS")
        self.pcfg: Final = self.register("ADPCFG")
        self.cssl: Final = self.register("ADCSSL")
        self.idle_bit = (self.con1, "ADSIDL")
        self._buffers: Final = [self.register(f"ADCBUF{index:X}") for index in range(16)]
        for register in (*self._buffers, self.con1, self.con2):
            register.computed(partial(self._read, register))
        self.con1.written_by(self._con1_written)
        for register in (self.con2, self.con3, self.chs, self.cssl):
            register.written_by(partial(self._setting_written, register))
        self.pcfg.written_by(lambda _old, _new, _lanes: self._route(self.now + 1))
        self._port: Final = parse_pin(site.pins[0])[0]
        self.input: Final = self.array("input", "H", len(site.pins))
        """Analog level of each channel; change it through `set_input`."""
        self.source: Final[list[AnalogSource | None]] = [None] * len(site.pins)
        """A function of the cycle that replaces a channel's level; call `catch_up` before it changes its course."""
        self._vref_high: Final = self.cell("vref_high", "I", FULL_SCALE)
        self._vref_low: Final = self.cell("vref_low", "I", 0)
        self._state: Final = self.cell("state", "B")
        self._mark: Final = self.moment("mark")
        """Cycle the present state began at or before (plus `half` half Tcy)."""
        self._half: Final = self.cell("half", "B")
        self._held: Final = self.cell("held", "H")
        self._scan: Final = self.cell("scan", "B")
        self._use_b: Final = self.cell("use_b", "B")
        self._next: Final = self.cell("next", "B")
        self._count: Final = self.cell("count", "B")
        self._step: Final = self.slot("step", self._due)

    # -- inputs ------------------------------------------------------------------------------------------------------

    def set_input(self, channel: int, level: int) -> None:
        """Apply an analog level (0..65535 of AVDD) to a channel from the next cycle on."""
        self.catch_up(self.now)
        self.input[channel] = level

    def set_references(self, low: int, high: int) -> None:
        """Levels on VREF- and VREF+ (0..65536 of AVDD), used when VCFG selects them."""
        self.catch_up(self.now)
        self._vref_low.value, self._vref_high.value = low, high

    def _level(self, channel: int, cycle: int) -> int:
        source = self.source[channel]
        return source(cycle) if source is not None else self.input[channel]

    def _references(self) -> tuple[int, int]:
        """VCFG (§13): bit 0 selects VREF+, bit 1 VREF-; 1xx are the supplies."""
        vcfg = self.con2["VCFG"]
        if vcfg & 4:
            return 0, FULL_SCALE
        return self._vref_low.value if vcfg & 2 else 0, self._vref_high.value if vcfg & 1 else FULL_SCALE

    def _sample(self, cycle: int) -> int:
        """Code of the input selected for this sample, 0..4095; the selection moves on."""
        use_b = bool(self._use_b.value)
        low, high = self._references()
        if not use_b and self.con2["CSCNA"] and self.cssl.value:
            scanned = [number for number in range(16) if self.cssl.value >> number & 1]
            place = self._scan.value % len(scanned)
            channel, negative = scanned[place], self.chs["CH0NA"]
            self._scan.value = (place + 1) % len(scanned)
        else:
            channel, negative = (self.chs["CH0SB"], self.chs["CH0NB"]) if use_b else (
                self.chs["CH0SA"],
                self.chs["CH0NA"],
            )  # fmt: skip
        self._use_b.value = self.con2["ALTS"] and not use_b
        zero = self._level(1, cycle) if negative else low
        span = max(high - low, 1)
        return min(max((self._level(channel, cycle) - zero) * 4096 // span, 0), 4095)

    # -- time --------------------------------------------------------------------------------------------------------

    @property
    def _tad_halves(self) -> int:
        """TAD in half Tcy."""
        if self.con3["ADRC"]:
            return round(2 * _RC_TAD_SECONDS * self.kit.fcy())
        return self.con3["ADCS"] + 1

    def _end_of_state(self) -> int:
        """Half cycle the present state ends by itself, or NEVER."""
        begun = 2 * self._mark.value + self._half.value
        if self._state.value == _CONVERTING:
            return begun + _CONVERSION_TAD * self._tad_halves
        if self._state.value == _SAMPLING and self.con1["SSRC"] == _AUTO:
            return begun + self.con3["SAMC"] * self._tad_halves
        return NEVER

    def _enter(self, state: int, halves: int) -> None:
        self._state.value = state
        self._mark.value = halves >> 1
        self._half.value = halves & 1
        self.con1["SAMP"] = state == _SAMPLING
        if state == _CONVERTING:
            self.con1["DONE"] = 0
            self._held.value = self._sample(halves + 1 >> 1)

    def catch_up(self, cycle: int) -> bool:
        """Carry out every conversion that ends at or before `cycle`. True if one of them raised the interrupt."""
        interrupted = False
        while True:
            end = self._end_of_state()
            if end == NEVER or end + 1 >> 1 > cycle:
                return interrupted
            if self._state.value == _SAMPLING:
                self._enter(_CONVERTING, end)
            else:
                interrupted |= self._store()
                self._enter(_SAMPLING if self.con1["ASAM"] else _WAITING, end)

    def _store(self) -> bool:
        """A conversion is complete: buffer, pointer, halves; True at every SMPI + 1 results."""
        code = self._held.value
        form = self.con1["FORM"]
        value = code - 2048 if form & 1 else code
        self._buffers[self._next.value].value = (value << 4 if form & 2 else value) & 0xFFFF
        self.con1["DONE"] = 1
        self._count.value += 1
        self._next.value = (self._next.value + 1) % 16
        if self._count.value <= self.con2["SMPI"]:
            return False
        self._count.value = 0
        if self.con2["BUFM"]:
            self.con2["BUFS"] = 1 - self.con2["BUFS"]
            self._next.value = 8 * self.con2["BUFS"]
        else:
            self._next.value = 0
        return True

    def _plan(self) -> None:
        """Post the next interrupt, or the end of the state if what follows depends on somebody else."""
        end = self._end_of_state()
        if end == NEVER:
            self.events.cancel(self._step)
            return
        if self._state.value == _SAMPLING:
            end += _CONVERSION_TAD * self._tad_halves
        if self.con1["ASAM"] and self.con1["SSRC"] == _AUTO:
            missing = max(self.con2["SMPI"] - self._count.value, 0)
            end += missing * (self.con3["SAMC"] + _CONVERSION_TAD) * self._tad_halves
        self.events.set(self._step, max(end + 1 >> 1, self.now + 1))  # a shorter setting may end it in the past

    def _due(self, due: int) -> None:
        if self.catch_up(due):
            self._line.request()
        self._plan()

    def _read(self, register: Register) -> int:
        self._catch_up_now()
        return register.value

    def _catch_up_now(self) -> None:
        """Bring the registers to the current cycle; an interrupt cannot fall due here before its event."""
        if not self.is_frozen and self._state.value > _WAITING:
            self.catch_up(self.now)

    # -- control -----------------------------------------------------------------------------------------------------

    def _con1_written(self, old: int, new: int, _lanes: int) -> None:
        fields = self.kit.chip.sfrs["ADCON1"].fields
        adon, samp = (1 << fields[name][0] for name in ("ADON", "SAMP"))
        self._settle(self.con1, old, new)
        start = 2 * (self.now + 1)
        if not new & adon:
            self._switch_off()
        elif not old & adon:
            self._scan.value = self._use_b.value = self._next.value = self._count.value = 0
            self.con2["BUFS"] = 0
            self._enter(_SAMPLING if new & samp or self.con1["ASAM"] else _WAITING, start)
        elif self._state.value == _WAITING and (new & samp or self.con1["ASAM"]):
            self._enter(_SAMPLING, start)
        elif self._state.value == _SAMPLING and not new & samp:
            self._sampling_ended_by_software(start)
        elif self._state.value == _CONVERTING:
            self.con1["SAMP"] = 0  # UNVERIFIED: SAMP = 1 while converting is ignored (§13)
        self.restored()
        self._plan()

    def _sampling_ended_by_software(self, start: int) -> None:
        """SAMP = 0 starts the conversion if nothing else does. UNVERIFIED: otherwise it only ends sampling (§13)."""
        if self.con1["SSRC"] == _MANUAL:
            self._enter(_CONVERTING, start)
        elif self.con1["ASAM"]:
            self.con1["SAMP"] = 1
        else:
            self._enter(_WAITING, start)

    def _switch_off(self) -> None:
        """ADON = 0 aborts without a result; ADCBUF stays (§13)."""
        self._state.value = _OFF
        self.con1["SAMP"] = 0
        self.events.cancel(self._step)

    def _setting_written(self, register: Register, old: int, new: int, _lanes: int) -> None:
        self._settle(register, old, new)
        self._plan()

    def _settle(self, register: Register, old: int, new: int) -> None:
        """What happened before this write happened under the old setting."""
        register.value = old
        self._catch_up_now()
        hardware = self.con2["BUFS"]
        register.value = new
        self.con2["BUFS"] = hardware

    def int0(self, due: int) -> None:
        """INT0 rose in cycle `due`."""
        if self.con1["SSRC"] == _INT0:
            self._triggered(due)

    def _timer_matched(self, due: int) -> None:
        if self.con1["SSRC"] == _TIMER3:
            self._triggered(due)

    def _wide_timer_matched(self, due: int) -> None:
        if self._timers[2].is_wide:
            self._timer_matched(due)

    def _triggered(self, cycle: int) -> None:
        """Sampling ends, conversion begins (SSRC = 1, 2)."""
        if self._state.value == _SAMPLING and not self.is_frozen:
            self._enter(_CONVERTING, 2 * cycle)
            self._plan()

    def _route(self, cycle: int) -> None:
        """ADPCFG = 0 makes a pin analog: its digital input reads 0 (§6)."""
        self.kit.pins.analog[self._port] = ~self.pcfg.value & 0xFFFF
        self.kit.pins.apply(self._port, cycle)

    # -- power and reset ---------------------------------------------------------------------------------------------

    def reset(self, power_on: bool) -> None:
        """Off; all channels analog."""
        self._state.value = _OFF
        self._route(self.now)
        self.restored()

    def stops_in(self, mode: int) -> bool:
        """With its own RC oscillator it runs in Sleep."""
        return not self.con3["ADRC"] if mode == SLEEP else super().stops_in(mode)

    def freeze(self, cycle: int, mode: int) -> None:
        """What was converted before counts."""
        self.catch_up(cycle)
        super().freeze(cycle, mode)

    def restored(self) -> None:
        """Listen to timer 3 only while it triggers, so that its matches stay simple otherwise."""
        wanted = self.con1["SSRC"] == _TIMER3 and bool(self.con1["ADON"])
        self._timers[3].listen(self._timer_matched, wanted)
        self._timers[2].listen(self._wide_timer_matched, wanted)
