"""Motor control PWM (DS70135G §15): time base, duty cycles, dead time, override, fault input, special event trigger.

One event is posted for the next change: the end of a period, an edge of a comparison, the end of a dead time, or the
special event. Outputs are driven at these events; nothing is polled.

UNVERIFIED: outputs of a stopped time base (PTEN = 0) are inactive; a dead time follows changes of a comparison, not
those of an override; the fault input acts in the cycle of its edge.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.chips.chip import PwmSite
from emu.peripherals.base import ChipContext, Peripheral
from emu.peripherals.interrupt_lines import Interrupts
from emu.peripherals.motor.time_base import DOUBLE_UPDATE, PRESCALE, SINGLE_SHOT, UP_DOWN, TimeBase
from emu.peripherals.pins import parse_pin
from emu.peripherals.ports.ports import Port
from emu.system.events import NEVER

_DEAD_TIME_PRESCALE: Final = (1, 2, 4, 8)
"""Tcy per count of DTA, by DTAPS (§15.7.3)."""


class Pwm(Peripheral):
    """The PWM module. Output pair n (1, 2, 3) has the pins PWMnL and PWMnH."""

    def __init__(self, site: PwmSite, context: ChipContext, interrupts: Interrupts, ports: dict[int, Port]) -> None:
        super().__init__("pwm", context)
        self._line: Final = interrupts.line(site.irq)
        self._fault_line: Final = interrupts.line(site.fault_irq)
        self.con, self.tmr, self.per = (self.register(name) for name in ("PTCON", "PTMR", "PTPER"))
        self.special: Final = self.register("SEVTCMP")
        self.outputs, self.updates = self.register("PWMCON1"), self.register("PWMCON2")
        self.dead_time, self.fault = self.register("DTCON1"), self.register("FLTACON")
        self.override: Final = self.register("OVDCON")
        self.duties: Final = [self.register(f"PDC{pair}") for pair in range(1, len(site.pairs) + 1)]
        self.idle_bit = (self.con, "PTSIDL")
        self.con.written_by(self._con_written)
        self.tmr.written_by(self._tmr_written)
        self.tmr.computed(lambda: self._shown(self.now))
        for register in (self.per, self.special, self.updates, *self.duties):
            register.written_by(lambda _old, _new, _lanes: self._buffers_written())
        for register in (self.outputs, self.dead_time, self.fault, self.override):
            register.written_by(lambda _old, _new, _lanes: self._outputs_written())
        self.on_special: Callable[[int], None] | None = None
        """Called with the cycle of each special event, which is a trigger of the ADC (§15.12)."""
        pins = [tuple(parse_pin(name) for name in pair) for pair in site.pairs]
        self._port: Final = ports[pins[0][0][0]]
        self._masks: Final = [(low[1], high[1]) for low, high in pins]
        """Pin masks (low, high) of each pair."""
        self._fault_port, self._fault_pin = parse_pin(site.fault_pin)
        self._zero: Final = self.cell("zero", "q")
        self._timestamps.append(self._zero)
        """First cycle of the current period, or the negative number that a written PTMR implies.

        While the time base is stopped, `_stopped_at` holds PTMR instead.
        """
        self._running: Final = self.cell("running", "B")
        self._stopped_at: Final = self.cell("stopped_at", "H")
        self._period: Final = self.cell("period", "H")
        self._duty: Final = self.array("duty", "H", len(site.pairs))
        """Latched PTPER and PDCx of the current period."""
        self._level: Final = self.array("level", "B", len(site.pairs))
        self._since: Final = [self.timestamp(f"since{pair}") for pair in range(len(site.pairs))]
        """Output of each comparison, and the cycle of its last change, from which the dead time counts."""
        self._post: Final = self.cell("post", "B")
        self._special_post: Final = self.cell("special_post", "B")
        self._faulted: Final = self.cell("faulted", "B")
        self._overridden: Final = self.cell("overridden", "H")
        """OVDCON in force, which follows the register at the start of a period if OSYNC is set."""
        self._step: Final = self.slot("step", self._due)
        context.pins.watch(site.fault_pin, self._fault_edge)

    # -- time base ---------------------------------------------------------------------------------------------------

    @property
    def _base(self) -> TimeBase:
        mode = self.con["PTMOD"]
        return TimeBase(self._zero.value, self._period.value, PRESCALE[self.con["PTCKPS"]], mode >= UP_DOWN)

    def _shown(self, cycle: int) -> int:
        """Return PTMR with PTDIR at `cycle`."""
        if not self._running.value:
            return self._stopped_at.value
        count, downwards = self._base.count(min(cycle, self.clock))
        return count | downwards << 15

    def _latch(self, duties: bool = True) -> None:
        """Load the buffered PTPER and PDCx. UDIS keeps the old ones (§15.11)."""
        if self.updates["UDIS"]:
            return
        if duties:
            for pair, register in enumerate(self.duties):
                self._duty[pair] = register.value
        self._period.value = self.per.value

    def _con_written(self, old: int, new: int, _lanes: int) -> None:
        enable = 1 << self.context.chip.sfrs["PTCON"].fields["PTEN"][0]
        before = self.con.value
        following = self.now + 1
        if old & enable and (old ^ new) & ~enable & 0xFFFF:  # the count continues at the new rate, prescaler cleared
            self.con.value = old
            count = self._shown(self.now)
            self.con.value = before
            self._count_from(count, following)
        self._post.value = 0
        if new & enable and not old & enable:
            self._latch()
            self._running.value = 1
            self._count_from(self._stopped_at.value, following)
        elif old & enable and not new & enable:
            self._stop(following)
        self._update(following)

    def _count_from(self, count: int, cycle: int) -> None:
        """Make PTMR equal `count` in `cycle`, from which on it counts upwards.

        UNVERIFIED: a value above PTPER acts as PTPER, so that the period ends at the next count.
        """
        self._zero.value = cycle - min(count & 0x7FFF, self._period.value) * PRESCALE[self.con["PTCKPS"]]

    def _stop(self, cycle: int) -> None:
        """Stop the time base; PTMR keeps its count (§15.1)."""
        self._stopped_at.value = self._shown(cycle)
        self._running.value = 0

    def _tmr_written(self, _old: int, new: int, _lanes: int) -> None:
        self._stopped_at.value = new & 0x7FFF
        self._count_from(new, self.now + 1)
        self._post.value = 0
        self._update(self.now + 1)

    def _buffers_written(self) -> None:
        """Handle a write to a buffered register, which otherwise takes effect at the end of the period.

        It takes effect immediately if the time base is off; with IUE set, only the duty cycles do.
        """
        if not self._running.value:
            self._latch()
        elif self.updates["IUE"] and not self.updates["UDIS"]:
            for pair, register in enumerate(self.duties):
                self._duty[pair] = register.value
        self._update(self.now + 1)

    def _outputs_written(self) -> None:
        if not self.updates["OSYNC"] or not self._running.value:
            self._overridden.value = self.override.value
        if self.fault.value & 7 and not self.context.pins.level[self._fault_port] & self._fault_pin:
            self._faulted.value = 1
        self._update(self.now + 1)

    def _due(self, due: int) -> None:
        """Handle the special event, then the end or the middle of a period, then edges and ends of dead times."""
        mode, base = self.con["PTMOD"], self._base
        if self._special_cycle(base) == due:
            self._special_event(due)
        if due == base.end:
            self._zero.value = due
            self._end_period(mode, due)
        elif mode == DOUBLE_UPDATE and due == base.cycle_of(base.period, True):
            self._latch()
            self._line.request()
        self._update(due)

    def _end_period(self, mode: int, due: int) -> None:
        """Load the buffers, leave a fault that is over, and request the interrupt if the postscaler is due (§15.1)."""
        self._latch()
        self._overridden.value = self.override.value
        self._end_fault()
        if mode == SINGLE_SHOT:
            self.con["PTEN"] = 0
            self._stopped_at.value = self._running.value = 0
        self._post.value = (self._post.value + 1) % (self.con["PTOPS"] + 1)
        if mode in (SINGLE_SHOT, DOUBLE_UPDATE) or not self._post.value:
            self._line.request()

    def _special_cycle(self, base: TimeBase) -> int:
        """Return the cycle of the special event in the current period, NEVER if there is none."""
        value = self.special.value
        return base.cycle_of(value & 0x7FFF, bool(value >> 15))

    def _special_event(self, due: int) -> None:
        self._special_post.value = (self._special_post.value + 1) % (self.updates["SEVOPS"] + 1)
        if not self._special_post.value and self.on_special is not None:
            self.on_special(due)

    # -- outputs -----------------------------------------------------------------------------------------------------

    def _update(self, cycle: int) -> None:
        """Drive the outputs from `cycle` on, and post the next event."""
        base, running = self._base, bool(self._running.value)
        dead = self.dead_time["DTA"] * _DEAD_TIME_PRESCALE[self.dead_time["DTAPS"]]
        upcoming = [base.end, self._special_cycle(base), base.cycle_of(base.period, True)] if running else []
        for pair, duty in enumerate(self._duty):
            level = running and base.level(duty, cycle)
            if level != bool(self._level[pair]):
                self._level[pair], self._since[pair].value = level, cycle
            upcoming += [base.next_edge(duty, cycle)] if running else []
            upcoming.append(self._since[pair].value + dead)
        self._drive(cycle, dead, running)
        following = min((event for event in upcoming if event > cycle), default=NEVER)
        if following == NEVER or self.is_frozen:
            self.events.cancel(self._step)
        else:
            self.events.set(self._step, following)

    def _drive(self, cycle: int, dead: int, running: bool) -> None:
        """Drive the pins that the module owns: PENxH and PENxL select them (§15.10)."""
        owned = levels = 0
        for pair, masks in enumerate(self._masks):
            for side, mask in enumerate(masks):
                if self.outputs[f"PEN{pair + 1}{'LH'[side]}"]:
                    owned |= mask
                    active = self._is_active(pair, side, cycle, dead, running)
                    levels |= mask if active == self._is_active_high(side) else 0
        self._port.drive_now(sum(mask for pair in self._masks for mask in pair), owned, levels, cycle)

    def _is_active(self, pair: int, side: int, cycle: int, dead: int, running: bool) -> bool:
        """Return whether an output is active; `side` is 0 for PWMxL and 1 for PWMxH."""
        bit = 2 * pair + side
        if self._faulted.value and self.fault[f"FAEN{pair + 1}"]:
            return bool(self.fault.value >> 8 + bit & 1)
        if not self._overridden.value >> 8 + bit & 1:
            return bool(self._overridden.value >> bit & 1)
        if not running:
            return False
        level = bool(self._level[pair])
        if self.outputs[f"PMOD{pair + 1}"]:  # independent outputs follow the comparison
            return level
        return level == bool(side) and cycle >= self._since[pair].value + dead

    def _is_active_high(self, side: int) -> bool:
        word = self.context.chip.config["FBORPOR"]
        return bool(word.field(self.context.program.setting("FBORPOR"), ("LPOL", "HPOL")[side]))

    # -- fault input -------------------------------------------------------------------------------------------------

    def _fault_edge(self, cycle: int, _changed: int, levels: int) -> None:
        """Handle an edge of the fault pin: low drives the outputs of the enabled pairs to FLTACON's state (§15.10)."""
        if not self.fault.value & 7 or levels & self._fault_pin:
            return
        self._faulted.value = 1
        self._fault_line.request()
        self._update(cycle)

    def _end_fault(self) -> None:
        """Return to normal outputs at the start of a period, once the pin is high.

        The latched mode (FLTAM = 0) also waits until software has cleared FLTAIF.
        """
        is_high = self.context.pins.level[self._fault_port] & self._fault_pin
        if is_high and (self.fault["FLTAM"] or not self._fault_line.pending):
            self._faulted.value = 0

    # -- power and reset ---------------------------------------------------------------------------------------------

    def reset(self, power_on: bool) -> None:
        """Reset to off. PWMPIN = 0 in FBORPOR gives the pins to the module at a reset (§15.10)."""
        word = self.context.chip.config["FBORPOR"]
        if not word.field(self.context.program.setting("FBORPOR"), "PWMPIN"):
            self.outputs.value = 0x77 & self.context.chip.sfrs["PWMCON1"].mask
        for cell in (self._running, self._stopped_at, self._post, self._special_post, self._faulted):
            cell.value = 0
        for pair in range(len(self._duty)):
            self._duty[pair] = self._level[pair] = self._since[pair].value = 0
        self._period.value = self.per.value
        self._overridden.value = self.override.value
        self._zero.value = self.now
        self._update(self.now)

    def thaw(self, cycle: int) -> None:
        """Resume the clock."""
        super().thaw(cycle)
        self._update(cycle)

    def release_pins(self) -> None:
        """Release the outputs to LAT and TRIS."""
        self._update(self.now + 1)
