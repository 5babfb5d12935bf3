"""Output compare and PWM 1-8 (§9): changes a pin when timer 2 or 3 reaches OCxR or OCxRS."""

from __future__ import annotations

from typing import Final

from emu.chips.chip import CompareSite
from emu.peripherals.base import ChipContext, Peripheral
from emu.peripherals.interrupt_lines import Interrupts
from emu.peripherals.pins import parse_pin
from emu.peripherals.ports.ports import Port
from emu.peripherals.timers.timers import Timer
from emu.system.events import NEVER

_OFF, _SET_ONCE, _CLEAR_ONCE, _TOGGLE, _ONE_PULSE, _PULSES, _PWM, _PWM_FAULT = range(8)
"""Values of OCM, the compare mode (§9)."""
_FLAG_DELAY: Final = 2
"""Delay in Tcy from the change of the pin to OCxIF (§9)."""

_RISE, _FALL, _DONE = range(3)
"""Kinds of the next pin change in the pulse and PWM modes."""


class Compare(Peripheral):
    """One output compare channel."""

    def __init__(
        self,
        site: CompareSite,
        context: ChipContext,
        interrupts: Interrupts,
        timers: dict[int, Timer],
        ports: dict[int, Port],
    ) -> None:
        super().__init__(f"oc{site.number}", context)
        self._line: Final = interrupts.line(site.irq)
        self._timers: Final = timers
        self.r: Final = self.register(f"OC{site.number}R")
        self.rs: Final = self.register(f"OC{site.number}RS")
        self.con: Final = self.register(f"OC{site.number}CON")
        self.idle_bit = (self.con, "OCSIDL")
        self.con.written_by(self._con_written)
        self.r.written_by(self._r_written)
        self.rs.written_by(lambda _old, _new, _lanes: self._plan())
        port, self._pin = parse_pin(site.pin)
        self._port: Final = ports[port]
        self._fault_port, self._fault_pin = parse_pin(site.fault_pin)
        self._level: Final = self.cell("level", "B")
        self._phase: Final = self.cell("phase", "B")
        self._pin_event: Final = self.slot("pin", self._pin_due)
        self._flag_event: Final = self.slot("flag", lambda _due: self._line.request())
        context.pins.watch(site.fault_pin, self._fault_edge)

    @property
    def _timer(self) -> Timer:
        return self._timers[3 if self.con["OCTSEL"] else 2]

    @property
    def _is_pwm(self) -> bool:
        return self.con["OCM"] in (_PWM, _PWM_FAULT)

    # -- pin changes -------------------------------------------------------------------------------------------------

    def _plan(self) -> None:
        """Post the next change of the pin, computed from the timer's next matches."""
        if self.con["OCM"] == _OFF or self.is_frozen:
            return
        if self.events.due(self._pin_event) == self.now + 1 and not (self._is_pwm and self._timer.is_frozen):
            return  # the pin change was already determined in this cycle
        cycle = self._next_change(self.now)
        self.events.set(self._pin_event, cycle) if cycle != NEVER else self.events.cancel(self._pin_event)

    def _next_change(self, after: int) -> int:
        """Return the cycle of the next pin change that follows from a match after cycle `after`."""
        timer, phase = self._timer, self._phase.value
        if phase == _DONE:
            return NEVER
        if self._is_pwm:  # the pin rises with TMR = 0 and falls with TMR = OCxR
            wrap = timer.next_cycle_at(0, after)
            return wrap if phase == _RISE else min(wrap, timer.next_cycle_at(self.r.value, after))
        target = self.rs.value if phase == _FALL else self.r.value
        match = timer.next_cycle_at(target, after)
        return NEVER if match == NEVER else match + 1

    def _pin_due(self, due: int) -> None:
        mode = self.con["OCM"]
        if self._is_pwm:
            self._pwm_step(due)
        elif mode in (_SET_ONCE, _CLEAR_ONCE):
            self._drive(mode == _SET_ONCE)
            self._phase.value = _DONE
            self.events.set(self._flag_event, due + _FLAG_DELAY)
        elif mode == _TOGGLE:
            self._drive(not self._level.value)
            self.events.set(self._flag_event, due + _FLAG_DELAY)
        elif self._phase.value == _RISE:
            self._drive(True)
            self._phase.value = _FALL
        else:
            self._drive(False)
            self._phase.value = _DONE if mode == _ONE_PULSE else _RISE
            self.events.set(self._flag_event, due + _FLAG_DELAY)
        cycle = self._next_change(due if self._is_pwm else due - 1)
        if cycle != NEVER:
            self.events.set(self._pin_event, cycle)

    def _pwm_step(self, due: int) -> None:
        """Handle a PWM match. A new period loads the duty cycle from OCxRS; 0 keeps the pin low, above PR high (§9)."""
        if self._timer.count(due) == 0:
            self.r.value = self.rs.value
            self._drive(self.r.value != 0)
            self._phase.value = _FALL if self.r.value else _RISE
        else:
            self._drive(False)
            self._phase.value = _RISE

    def _drive(self, level: bool) -> None:
        self._level.value = level
        self._port.claim_now(self._pin, drive=True, level=level)

    # -- control -----------------------------------------------------------------------------------------------------

    def _r_written(self, old: int, _new: int, _lanes: int) -> None:
        if self._is_pwm:
            self.r.value = old  # read-only in PWM mode: it holds the current duty cycle (§9)
        self._plan()

    def _con_written(self, _old: int, _new: int, _lanes: int) -> None:
        """Handle a write to OCxCON, which restarts the module and sets the pin to its initial level (§9)."""
        for event in (self._pin_event, self._flag_event):
            self.events.cancel(event)
        mode = self.con["OCM"]
        self.con["OCFLT"] = 0
        self.restored()
        if mode == _OFF:
            self._port.release(self._pin)
            return
        # UNVERIFIED: in toggle mode the pin starts at the level of its LAT bit (§9).
        preset = mode == _TOGGLE and bool(self._port.lat.value & self._pin)
        self._level.value = mode == _CLEAR_ONCE or preset
        self._phase.value = _RISE
        self._port.claim(self._pin, drive=True, level=self._level.value)
        if mode == _PWM_FAULT and not self.context.pins.level[self._fault_port] & self._fault_pin:
            self._fault()
        else:
            self._plan()

    def _fault_edge(self, _cycle: int, _changed: int, levels: int) -> None:
        if self.con["OCM"] == _PWM_FAULT and not levels & self._fault_pin and not self.con["OCFLT"]:
            self._fault()

    def _fault(self) -> None:
        """Handle a low fault pin: the output floats until the pin is high again and software writes OCM (§9)."""
        self.con["OCFLT"] = 1
        self._phase.value = _DONE
        self.events.cancel(self._pin_event)
        self._port.claim(self._pin, drive=False, level=0)
        self._line.request()

    def reset(self, power_on: bool) -> None:
        """Reset to off; the ports have already released the pins."""
        self._level.value = 0
        self._phase.value = _RISE
        self.restored()

    def thaw(self, cycle: int) -> None:
        """Resume the clock. The time base may have continued while it was stopped.

        A change determined before the clock stopped still happens (§9): with PWM in the cycle of the match, otherwise
        one cycle later.
        """
        waiting = self.remaining_delay(self._pin_event)
        super().thaw(cycle)
        if waiting > (not self._is_pwm):
            self._plan()

    def release_pins(self) -> None:
        """Release the channel's pin to LAT and TRIS."""
        self._port.release(self._pin)

    def restored(self) -> None:
        """Listen to changes of the time base if the channel is on, otherwise stop listening."""
        on, selected = self.con["OCM"] != _OFF, self._timer
        for number in (2, 3):
            timer = self._timers[number]
            timer.listen_to_changes(self._plan, on and timer is selected)
