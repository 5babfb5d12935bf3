"""ADC (§13): sampling, conversion in TAD, scan, alternating inputs, SMPI, buffer halves, triggers.

Times are kept in half Tcy, because TAD is (ADCS + 1) half Tcy. Conversions between two interrupts post no events.
They are computed when a register is read, before an input changes, or when the interrupt is due. Analog levels are
ratiometric: 0..65535 of AVDD, so the 12-bit converter converts a level of `code << 4` to `code`.

The 10-bit converter (FRM DS70064E §17) has four sample-and-hold amplifiers. With SIMSAM they sample together, and a
sequence converts CH0, CH1 and so on. UNVERIFIED: without SIMSAM, a sequence samples and converts one channel after the
other, each with its own sampling time; SMPI counts sequences of all channels.
"""

from __future__ import annotations

from functools import partial
from typing import Final

from emu.chips.chip import AdcSite
from emu.peripherals.adc.rules import (
    CHANNELS,
    CONVERTING,
    OFF,
    SAMPLING,
    WAITING,
    AdcOperands,
    StableRegister,
    fire_round,
    read_stable,
    write_con1,
    write_scan,
)
from emu.peripherals.adc.settings import FOREVER, AnalogInputs, ConversionSettings, PublishedSettings
from emu.peripherals.base import SLEEP, ChipContext, Peripheral
from emu.peripherals.interrupt_lines import Interrupts
from emu.peripherals.pins import parse_pin
from emu.peripherals.timers.timers import Timer
from emu.system.device import Register
from emu.system.events import NEVER
from emu.system.rules import Rule, cell_of, event_slot

FULL_SCALE: Final = 0x10000
"""Analog level that corresponds to AVDD."""
_SETTINGS_CACHE_SIZE: Final = 64
"""Maximum number of decoded register settings in the cache; firmware uses only a few."""
_RC_TAD_SECONDS: Final = 1.5e-6  # UNVERIFIED: 1.2 to 1.5 us (§13)

_MANUAL, _INT0, _TIMER3, _PWM, _AUTO = 0, 1, 2, 3, 7
"""Values of SSRC, which selects what ends sampling (§13)."""


class Adc(Peripheral):
    """The ADC: one or four sample-and-hold amplifiers, each after two input multiplexers."""

    def __init__(self, site: AdcSite, context: ChipContext, interrupts: Interrupts, timers: dict[int, Timer]) -> None:
        super().__init__("adc", context)
        self.site: Final = site
        self._line: Final = interrupts.line(site.irq)
        self._timers: Final = timers
        self.con1, self.con2, self.con3 = (self.register(f"ADCON{number}") for number in (1, 2, 3))
        self.chs: Final = self.register("ADCHS")
        self.pcfg: Final = self.register("ADPCFG")
        self.cssl: Final = self.register("ADCSSL")
        self.idle_bit = (self.con1, "ADSIDL")
        self._has_amplifiers: Final = "CHPS" in context.chip.sfrs["ADCON2"].fields
        self._buffers: Final = [self.register(f"ADCBUF{index:X}") for index in range(16)]
        for register in (*self._buffers, self.con1, self.con2):
            register.computed(partial(self._read, register))
        word = self.con1.address >> 1
        self._clear_only: Final = self.bus.clear_only[word]
        self.bus.writable[word] |= self._clear_only  # `catch_up` must run before the value of DONE is known
        self.bus.clear_only[word] = 0
        self.con1.written_by(self._con1_written)
        for register in (self.con2, self.con3, self.chs, self.cssl):
            register.written_by(partial(self._setting_written, register))
        self.pcfg.written_by(lambda _old, _new, _lanes: self._route(self.now + 1))
        self._port: Final = parse_pin(site.pins[0])[0]
        self.source: Final = AnalogInputs(self, CHANNELS)
        """Analog source of each channel: a function of the cycle that replaces the channel's level.

        Call `catch_up` before the function changes.
        """
        self.input: Final = self.source.level
        """Analog level of each channel; change it through `set_input`."""
        self._published: Final = PublishedSettings(self, CHANNELS)
        self._vref_high: Final = self.cell("vref_high", "I", FULL_SCALE)
        self._vref_low: Final = self.cell("vref_low", "I", 0)
        self.inputs_come_later = False
        """Whether inputs of past cycles may be unknown, because the world around the robot follows later."""
        self._state: Final = self.cell("state", "B")
        self._mark: Final = self.timestamp("mark")
        """Start of the current state, in cycles; `half` adds half a Tcy."""
        self._half: Final = self.cell("half", "B")
        self._held: Final = self.cell("held", "H")
        self._held_too: Final = self.array("held_too", "H", 3)
        """Samples of CH1 to CH3, which wait for their conversion."""
        self._turn: Final = self.cell("turn", "B")
        """Number of channels of the current sequence that have been converted."""
        self._scan: Final = self.cell("scan", "B")
        self._use_b: Final = self.cell("use_b", "B")
        self._next: Final = self.cell("next", "B")
        self._count: Final = self.cell("count", "B")
        self._stands: Final = self.timestamp("constant_until", FOREVER)
        """First cycle in which ADCBUFx, ADCON1 and ADCON2 may differ from their stored values."""
        self._step: Final = self.slot("step", self._due)
        sfrs = context.chip.sfrs
        self._settings: Final = tuple(
            (register.address >> 1, ~sum(1 << sfrs[register.name].fields[bit][0] for bit in owned) & 0xFFFF)
            for register, owned in (
                (self.con1, ("SAMP", "DONE")), (self.con2, ("BUFS",)), (self.con3, ()), (self.chs, ()), (self.cssl, ()))
        )  # fmt: skip
        """Indices and masks of the registers that determine the conversion settings."""
        self._settings_cache: Final[dict[tuple[int, ...], ConversionSettings]] = {}
        for register in (*self._buffers, self.con2):
            register.set_rule(Rule(StableRegister(register.cell, self._stands.cell), read_stable))
        operands = self._operands()
        self.con1.set_rule(Rule(operands, read_stable, write_con1))
        self.cssl.set_rule(Rule(operands, None, write_scan))
        self.set_event_rule(self._step, Rule(operands, fires=fire_round))

    def _operands(self) -> AdcOperands:
        sfrs, record = self.context.chip.sfrs, self.record
        adon, samp, done = (1 << sfrs["ADCON1"].fields[name][0] for name in ("ADON", "SAMP", "DONE"))
        cells = ("native", "frozen", "sampling", "conversion", "results", "halves", "length", "state", "mark", "half",
                 "scan", "use_b", "next", "count", "held", "channels", "level_from")  # fmt: skip
        return AdcOperands(
            register=self.con1.cell,
            until=self._stands.cell,
            con2=self.con2.cell,
            writable=sfrs["ADCON1"].writable,
            clear_only=sfrs["ADCON1"].clear_only,
            adon=adon,
            samp=samp,
            bufs=1 << sfrs["ADCON2"].fields["BUFS"][0],
            cssl=self.cssl.cell,
            scannable=sfrs["ADCSSL"].writable,
            cscna=1 << sfrs["ADCON2"].fields["CSCNA"][0],
            done=done,
            buffer=self._buffers[0].cell,
            level=cell_of(record, "adc.input"),
            shift=16 - self.site.bits,
            step=event_slot(record, self._step),
            native_source=self.source.native_source,
            line=self._line.line,
            **{name: cell_of(record, f"adc.{name}") for name in cells},
        )

    # -- inputs ------------------------------------------------------------------------------------------------------

    def set_input(self, channel: int, level: int) -> None:
        """Apply an analog level (0..65535 of AVDD) to a channel from the next cycle on."""
        self.catch_up(self.now)
        self.input[channel] = level

    @property
    def samples_from(self) -> int | None:
        """First cycle in which a pending conversion may sample an input; None if the converter is idle."""
        return self._mark.value if self._state.value > WAITING and not self.is_frozen else None

    def set_references(self, low: int, high: int) -> None:
        """Set the levels on VREF- and VREF+ (0..65536 of AVDD), which are used if VCFG selects them."""
        self.catch_up(self.now)
        self._vref_low.value, self._vref_high.value = low, high

    def _current_settings(self) -> ConversionSettings:
        """Return the current settings, cached by the register contents."""
        u16 = self.record.u16
        key = tuple([u16[word] & bits for word, bits in self._settings])
        settings = self._settings_cache.get(key)
        if settings is None:
            if len(self._settings_cache) >= _SETTINGS_CACHE_SIZE:
                self._settings_cache.clear()
            settings = self._settings_cache[key] = self._decode_settings()
        # With the RC oscillator, settings also depend on Fcy, which is not part of the key.
        return self._decode_settings() if self.con3["ADRC"] else settings

    def _decode_settings(self) -> ConversionSettings:
        tad = max(round(2 * _RC_TAD_SECONDS * self.context.fcy()), 1) if self.con3["ADRC"] else self.con3["ADCS"] + 1
        con2, chs = self.con2, self.chs
        return ConversionSettings(
            tad=tad,
            sampling=self.con3["SAMC"] * tad if self.con1["SSRC"] == _AUTO else NEVER,
            auto_sample=bool(self.con1["ASAM"]),
            scanned=tuple(number for number in range(16) if con2["CSCNA"] and self.cssl.value >> number & 1),
            inputs=((chs["CH0SA"], chs["CH0NA"]), (chs["CH0SB"], chs["CH0NB"])),
            alternates=bool(con2["ALTS"]),
            results=con2["SMPI"] + 1,
            in_halves=bool(con2["BUFM"]),
            form=self.con1["FORM"],
            references=con2["VCFG"],
            bits=self.site.bits,
            conversion_tad=self.site.conversion,
            amplifiers=(1, 2, 4, 4)[con2["CHPS"]] if self._has_amplifiers else 1,
            simultaneous=self._has_amplifiers and bool(self.con1["SIMSAM"]),
            others=self._other_inputs() if self._has_amplifiers else ((), ()),
        )

    def _other_inputs(self) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
        """Return (positive, negative) inputs of CH1 to CH3 of multiplexers A and B; -1 is the low reference (§17.8)."""
        chosen = ((self.chs[f"CH123S{mux}"], self.chs[f"CH123N{mux}"]) for mux in "AB")
        first, second = (
            tuple((3 * high + index, {2: 6, 3: 9}.get(low, -1 - index) + index) for index in range(3))
            for high, low in chosen
        )
        return first, second

    def _references(self, vcfg: int) -> tuple[int, int]:
        """Return the low and high reference level.

        Bit 0 of VCFG selects VREF+, bit 1 VREF-; 1xx selects the supplies (§13).
        """
        if vcfg & 4:
            return 0, FULL_SCALE
        return self._vref_low.value if vcfg & 2 else 0, self._vref_high.value if vcfg & 1 else FULL_SCALE

    def _sample(self, settings: ConversionSettings, channel: int, negative: int, cycle: int) -> int:
        """Return the conversion result for an input sampled at `cycle`. `negative` is CH0N: 1 selects AN1."""
        return self._difference(settings, channel, 1 if negative else -1, cycle)

    def _difference(self, settings: ConversionSettings, channel: int, negative: int, cycle: int) -> int:
        """Return the conversion result of two inputs; a negative input of -1 is the low reference."""
        low, high = self._references(settings.references)
        zero = self.source.at(negative, cycle) if negative >= 0 else low
        codes = 1 << settings.bits
        return min(max((self.source.at(channel, cycle) - zero) * codes // max(high - low, 1), 0), codes - 1)

    def _sample_channel(self, settings: ConversionSettings, cycle: int) -> int:
        """Return the sample whose conversion starts: of CH0, or of the sequence's next channel without SIMSAM.

        With SIMSAM, all other channels are sampled with CH0.
        """
        turn, use_b = self._turn.value, self._use_b.value
        if turn and not settings.simultaneous:
            return self._difference(settings, *settings.others[use_b][turn - 1], cycle)
        channel, negative, self._scan.value, following = settings.next_input(self._scan.value, use_b)
        if settings.simultaneous:
            for index, inputs in enumerate(settings.others[use_b][: settings.amplifiers - 1]):
                self._held_too[index] = self._difference(settings, *inputs, cycle)
        if settings.amplifiers == 1:
            self._use_b.value = following
        return self._sample(settings, channel, negative, cycle)

    # -- time --------------------------------------------------------------------------------------------------------

    def _duration(self, settings: ConversionSettings, state: int) -> int:
        """Return the duration of a state in half Tcy; NEVER if it ends by a trigger or by software."""
        if state == CONVERTING:
            return settings.conversion
        return settings.sampling if state == SAMPLING else NEVER

    def _enter(self, state: int, halves: int) -> None:
        self._state.value = state
        self._mark.value = halves >> 1
        self._half.value = halves & 1
        self.con1["SAMP"] = state == SAMPLING
        if state == CONVERTING:
            self.con1["DONE"] = 0
            settings = self._current_settings()
            self._held.value = self._sample_channel(settings, halves + 1 >> 1)

    def catch_up(self, cycle: int) -> None:
        """Complete every conversion that ends at or before `cycle`, except the one that requests the interrupt.

        The event handler completes that one; if the event is due now, it has not run yet. While the converter's clock
        is stopped, no conversion ends.
        """
        if not self.is_frozen:
            self._convert_by(min(cycle, self.events.due(self._step) - 1))

    def _convert_by(self, cycle: int) -> bool:
        """Complete every conversion that ends at or before `cycle`.

        Return whether one of them requested the interrupt.
        """
        state = self._state.value
        if state <= WAITING:
            return False
        settings = self._current_settings()
        if settings.amplifiers > 1:
            return self._end_state(settings, cycle)
        begun = 2 * self._mark.value + self._half.value
        interrupted, moved = False, False
        held, done = self._held.value, 0
        scan, use_b = self._scan.value, self._use_b.value
        while True:
            duration = self._duration(settings, state)
            if duration == NEVER or begun + duration + 1 >> 1 > cycle:
                break
            begun += duration
            moved = True
            if state == SAMPLING:
                state, done = CONVERTING, 0
                channel, negative, scan, use_b = settings.next_input(scan, use_b)
                held = self._sample(settings, channel, negative, begun + 1 >> 1)
            else:
                if self._store(settings, held):
                    interrupted, scan = True, 0  # the scan restarts after every interrupt (§13)
                state, done = (SAMPLING if settings.auto_sample else WAITING), 1
        if moved:
            self._state.value, self._held.value = state, held
            self._scan.value, self._use_b.value = scan, use_b
            self._mark.value, self._half.value = begun >> 1, begun & 1
            self.con1["SAMP"] = state == SAMPLING
            self.con1["DONE"] = done
            self._stands.value = FOREVER if duration == NEVER else begun + duration + 1 >> 1
        return interrupted

    def _end_state(self, settings: ConversionSettings, cycle: int) -> bool:
        """End the current state of a sequence of several channels, if it ends at or before `cycle`.

        Each state of such a sequence has its own event. Return whether the interrupt is requested.
        """
        state = self._state.value
        duration = self._duration(settings, state)
        end = 2 * self._mark.value + self._half.value + duration
        if duration == NEVER or end + 1 >> 1 > cycle:
            return False
        if state == SAMPLING:
            self._enter(CONVERTING, end)
            return False
        turn = self._turn.value + 1
        if turn < settings.amplifiers:
            self._store(settings, self._held.value, ends_sequence=False)
            self._turn.value = turn
            if settings.simultaneous:
                self._held.value = self._held_too[turn - 1]
                self._mark.value, self._half.value = end >> 1, end & 1
            else:
                self._enter(SAMPLING, end)
            return False
        self._turn.value = 0
        self._use_b.value = int(settings.alternates and not self._use_b.value)
        interrupted = self._store(settings, self._held.value)
        if interrupted:
            self._scan.value = 0
        self._enter(SAMPLING if settings.auto_sample else WAITING, end)
        self.con1["DONE"] = 1
        return interrupted

    def _store(self, settings: ConversionSettings, code: int, ends_sequence: bool = True) -> bool:
        """Store a result and advance the buffer pointer. Return True after each SMPI + 1 sequences.

        A sequence is one conversion, or one of each channel (CHPS).
        """
        value = code - (1 << settings.bits - 1) if settings.form & 1 else code
        place = self._next.value
        self._buffers[place].value = value << 16 - settings.bits if settings.form & 2 else value
        if not ends_sequence:
            self._next.value = (place + 1) % 16
            return False
        count = self._count.value + 1
        if count < settings.results:
            self._count.value = count
            self._next.value = (place + 1) % 16
            return False
        self._count.value = 0
        if settings.in_halves:
            self.con2["BUFS"] = 1 - self.con2["BUFS"]
            self._next.value = 8 * self.con2["BUFS"]
        else:
            self._next.value = 0
        return True

    def _plan(self) -> None:
        """Post the next interrupt event. If software or a trigger ends sampling, post the end of the current state."""
        settings, state = self._current_settings(), self._state.value
        self._published.publish(settings, changes_by_itself=bool(self.con3["ADRC"]))
        duration = self._duration(settings, state)
        if duration == NEVER:
            self.events.cancel(self._step)
            self._stands.value = FOREVER
            return
        end = 2 * self._mark.value + self._half.value + duration
        if end + 1 >> 1 <= self.now:  # the new setting makes the state shorter, so it ends in the next cycle
            end = 2 * (self.now + 1)
            self._mark.value, self._half.value = end - duration >> 1, end - duration & 1
        self._stands.value = end + 1 >> 1
        if settings.amplifiers > 1:
            self.events.set(self._step, end + 1 >> 1)
            return
        if state == SAMPLING:
            end += settings.conversion
        if settings.auto_sample and settings.sampling != NEVER:
            missing = max(settings.results - 1 - self._count.value, 0)
            end += missing * (settings.sampling + settings.conversion)
        self.events.set(self._step, end + 1 >> 1)

    def _due(self, due: int) -> None:
        if self._convert_by(due):
            self._line.request()
        self._plan()

    def _read(self, register: Register) -> int:
        self.synchronize()
        return register.value

    def synchronize(self) -> None:
        """Bring the registers up to the current cycle. The interrupt is requested by its own event."""
        if self._state.value > WAITING:
            self.catch_up(self.now)

    # -- control -----------------------------------------------------------------------------------------------------

    def _con1_written(self, old: int, new: int, lanes: int) -> None:
        left = self._settle(self.con1, old, new, lanes)
        new = self.con1.value = self.con1.value & (left | ~self._clear_only)
        fields = self.context.chip.sfrs["ADCON1"].fields
        adon, samp = (1 << fields[name][0] for name in ("ADON", "SAMP"))
        start = 2 * (self.now + 1)
        if not new & adon:
            self._switch_off()
        elif not old & adon:
            self._scan.value = self._use_b.value = self._next.value = self._count.value = self._turn.value = 0
            self.con2["BUFS"] = 0
            self._enter(SAMPLING if new & samp or self.con1["ASAM"] else WAITING, start)
        elif self._state.value == WAITING and (new & samp or self.con1["ASAM"]):
            self._enter(SAMPLING, start)
        elif self._state.value == SAMPLING and not new & samp:
            self._end_sampling_by_software(start)
        elif self._state.value == CONVERTING:
            self.con1["SAMP"] = 0  # UNVERIFIED: SAMP = 1 while converting is ignored (§13)
        self.restored()
        self._plan()

    def _end_sampling_by_software(self, start: int) -> None:
        """Handle a write of SAMP = 0. With SSRC = 0 it starts the conversion.

        UNVERIFIED: with other values of SSRC it only ends sampling (§13).
        """
        if self.con1["SSRC"] == _MANUAL:
            self._enter(CONVERTING, start)
        elif self.con1["ASAM"]:
            self.con1["SAMP"] = 1
        else:
            self._enter(WAITING, start)

    def _switch_off(self) -> None:
        """Handle ADON = 0: abort the conversion without a result and keep ADCBUF (§13)."""
        self._state.value = OFF
        self.con1["SAMP"] = 0
        self.events.cancel(self._step)

    def _setting_written(self, register: Register, old: int, new: int, lanes: int) -> None:
        self._settle(register, old, new, lanes)
        self._plan()

    def _settle(self, register: Register, old: int, new: int, lanes: int) -> int:
        """Complete earlier conversions with the old register value, then apply the write.

        Return the register's value before the write, in which bits outside `lanes` remain.
        """
        register.value = old
        self.synchronize()
        left, hardware = register.value, self.con2["BUFS"]
        register.value = left & ~lanes | new & lanes
        self.con2["BUFS"] = hardware
        return left

    def int0(self, due: int) -> None:
        """Handle the rise of the INT0 flag in cycle `due`: it is a conversion trigger if SSRC selects it."""
        if self.con1["SSRC"] == _INT0:
            self._start_conversion(due)

    def _timer_matched(self, due: int) -> None:
        if self.con1["SSRC"] == _TIMER3:
            self._start_conversion(due)

    def _wide_timer_matched(self, due: int) -> None:
        if self._timers[2].is_wide:
            self._timer_matched(due)

    def special_event(self, due: int) -> None:
        """Handle the special event of the motor control PWM in cycle `due`: a trigger if SSRC selects it (§17.12)."""
        if self.con1["SSRC"] == _PWM:
            self._start_conversion(due)

    def _start_conversion(self, cycle: int) -> None:
        """Handle a trigger (SSRC = 1, 2, 3): end sampling and start the conversion."""
        if self._state.value == SAMPLING and not self.is_frozen:
            self._enter(CONVERTING, 2 * cycle)
            self._plan()

    def clock_changes(self) -> None:
        """Complete conversions before the clock frequency changes. After a reset, ADON is 0 and none is pending."""
        if self.con1["ADON"]:
            self.catch_up(self.now)

    def clock_changed(self) -> None:
        """Reschedule after a change of Fcy: the TAD of the internal RC oscillator then takes another number of Tcy."""
        if self.con1["ADON"] and self.con3["ADRC"] and not self.is_frozen:
            self._plan()

    def _route(self, cycle: int) -> None:
        """Apply ADPCFG: a 0 bit makes a pin analog, so that its digital input reads 0 (§6)."""
        self.context.pins.analog[self._port] = ~self.pcfg.value & 0xFFFF
        self.context.pins.apply(self._port, cycle)

    # -- power and reset ---------------------------------------------------------------------------------------------

    def reset(self, power_on: bool) -> None:
        """Reset to off, with all channels analog."""
        self._state.value = OFF
        self._stands.value = FOREVER
        self._route(self.now)
        self.restored()
        self._plan()

    def stops_in(self, mode: int) -> bool:
        """Whether the converter stops. With its own RC oscillator it runs in Sleep."""
        return not self.con3["ADRC"] if mode == SLEEP else super().stops_in(mode)

    def freeze(self, cycle: int, mode: int) -> None:
        """Complete conversions up to `cycle`, then stop the clock."""
        self.catch_up(cycle)
        super().freeze(cycle, mode)

    def restored(self) -> None:
        """Listen to timer 3 only while it triggers conversions: a timer with listeners has no native match rule."""
        wanted = self.con1["SSRC"] == _TIMER3 and bool(self.con1["ADON"])
        self._timers[3].listen(self._timer_matched, wanted)
        self._timers[2].listen(self._wide_timer_matched, wanted)
