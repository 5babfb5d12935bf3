"""Reference model of the ADC (§13) in steps of half a Tcy, compared with the model that computes on access.

`difference` applies the same inputs to both: register writes by word and byte, levels, references, INT0, Idle and
Sleep. Occasional register reads must have no effect.
"""

from __future__ import annotations

import random
from collections.abc import Callable

from .conftest import Rig

OFF, WAITING, SAMPLING, CONVERTING = range(4)
ADON, ADSIDL, SSRC, ASAM, SAMP, DONE = 0x8000, 0x2000, 7 << 5, 4, 2, 1
CSCNA, BUFS, BUFM, ALTS, ADRC = 0x400, 0x80, 2, 1, 0x80
RC_TAD = 44
"""TAD of the internal oscillator: 1.5 us at 14.7456 MHz, in half Tcy."""
CYCLES = 1500


class Plain:
    """Reference model of the converter, advanced by half Tcy. A write takes effect in the cycle after it."""

    def __init__(self, level: Callable[[int, int], int]) -> None:
        self.word = dict.fromkeys(("ADCON1", "ADCON2", "ADCON3", "ADCHS", "ADCSSL"), 0)
        self.buffer = [0] * 16
        self.flag = self.is_stopped = False
        self.references = 0, 0x10000
        self._level = level
        self._state, self._age, self._half, self._free_from = OFF, 0, 0, 0
        self._scan = self._use_b = self._next = self._count = self._held = 0
        self._begins = OFF

    @property
    def _duration(self) -> int | None:
        con3 = self.word["ADCON3"]
        tad = RC_TAD if con3 & ADRC else (con3 & 63) + 1
        if self._state == CONVERTING:
            return 14 * tad
        return (con3 >> 8 & 31) * tad if self._state == SAMPLING and self.word["ADCON1"] & SSRC == SSRC else None

    def _sample(self) -> None:
        self._state, self._age = SAMPLING, 0
        self.word["ADCON1"] |= SAMP

    def _convert(self) -> None:
        self._state, self._age, cycle = CONVERTING, 0, self._half + 1 >> 1
        self.word["ADCON1"] &= ~(SAMP | DONE)
        con2, chs = self.word["ADCON2"], self.word["ADCHS"] >> 8 * self._use_b
        channel, scanned = chs & 15, [number for number in range(16) if self.word["ADCSSL"] >> number & 1]
        if con2 & CSCNA and scanned and not self._use_b:
            channel = scanned[self._scan % len(scanned)]
            self._scan = (self._scan % len(scanned) + 1) % len(scanned)
        self._use_b = int(bool(con2 & ALTS) and not self._use_b)
        choice = 0 if con2 & 0x8000 else con2 >> 13
        low = self.references[0] if choice & 2 else 0
        high = self.references[1] if choice & 1 else 0x10000
        zero = self._level(1, cycle) if chs >> 4 & 1 else low
        self._held = min(max((self._level(channel, cycle) - zero) * 4096 // max(high - low, 1), 0), 4095)

    def _finish(self) -> None:
        form, con2 = self.word["ADCON1"] >> 8, self.word["ADCON2"]
        self.buffer[self._next] = (self._held - 2048 * (form & 1) << 2 * (form & 2)) & 0xFFFF
        self._count, self._next = self._count + 1, (self._next + 1) % 16
        if self._count > con2 >> 2 & 15:
            self.word["ADCON2"] ^= BUFS if con2 & BUFM else 0
            self._count, self._scan, self.flag = 0, 0, True
            self._next = 8 if con2 & BUFM and self.word["ADCON2"] & BUFS else 0
        self.word["ADCON1"] |= DONE
        self._state = WAITING
        if self.word["ADCON1"] & ASAM:
            self._sample()

    def _end_states(self) -> None:
        """End the current state if its time is over, repeatedly, because a state may have no duration. A state that a
        write has shortened below its age ends in the cycle after the write."""
        while (limit := self._duration) is not None and self._age >= limit:
            if self._age > limit and self._half < self._free_from:
                break
            self._convert() if self._state == SAMPLING else self._finish()

    def live(self, cycle: int, int0: bool) -> None:
        """Advance to `cycle`, the next cycle. `int0`: an edge of INT0 is detected in it, before a conversion ends."""
        is_triggered = int0 and (SAMPLING in (self._state, self._begins)) and not self.is_stopped
        while self._half < 2 * cycle:
            self._half += 1
            if self._state > WAITING and not self.is_stopped:
                self._age += 1
                self._end_states()
        if self._begins == SAMPLING:
            self._sample()
        elif self._begins == CONVERTING:
            self._convert()
        self._begins = OFF
        self._end_states()
        if is_triggered and self._state == SAMPLING and self.word["ADCON1"] & SSRC == 1 << 5:
            self._convert()

    def write(self, name: str, value: int, lanes: int) -> None:
        """Write a register in the current cycle."""
        old = self.word[name]
        new = self.word[name] = old & ~lanes | value & lanes
        self._free_from = self._half + 2
        if name == "ADCON2":
            self.word[name] = new & ~BUFS | old & BUFS
        if name != "ADCON1":
            return
        if new & DONE and not old & DONE:
            new ^= DONE
        if not new & ADON:
            self._state = OFF
        elif not old & ADON:
            self._scan = self._use_b = self._next = self._count = 0
            self.word["ADCON2"] &= ~BUFS
            self._state = WAITING
        if self._state == WAITING and new & (SAMP | ASAM):
            self._begins = SAMPLING
        elif self._state == SAMPLING and not new & SAMP:
            if not new & SSRC:
                self._begins = CONVERTING
                new &= ~DONE
            elif not new & ASAM:
                self._state = WAITING
        is_sampling = self._begins == SAMPLING or (self._state == SAMPLING and self._begins == OFF)
        self.word[name] = new & ~SAMP | SAMP * is_sampling


def _value(draw: random.Random, name: str) -> int:
    """Return a random value of a register, usually one with which the ADC converts."""
    if name == "ADCON1":
        on, idle = draw.choice((0, ADON, ADON, ADON, ADON)), draw.choice((0, ADSIDL))
        return on | idle | draw.randrange(4) << 8 | draw.choice((0, 7, 7, 7, 1, 1, 5)) << 5 | draw.randrange(8)
    if name == "ADCON2":
        many = draw.choice((0, 1, 2, 3, draw.randrange(16))) << 2
        return draw.choice((0, CSCNA)) | draw.choice((0, 0, draw.randrange(8))) << 13 | many | draw.randrange(4)
    if name == "ADCON3":
        own = ADRC if draw.random() < 0.1 else 0
        return draw.choice((0, 0, 1, 2, draw.randrange(32))) << 8 | own | draw.choice((0, 1, 2, 5, 20, 63))
    return draw.randrange(0x10000) & (0x1F1F if name == "ADCHS" else 0xFFFF)


def difference(seed: int) -> str | None:
    """Apply the same inputs to both converters. Return the first difference and the last inputs, or None."""
    draw, rig = random.Random(seed), Rig()
    adc, levels = rig.dev.adc, [draw.randrange(0x10000) for _ in range(16)]
    moving = set(draw.sample(range(16), 5))

    def level(channel: int, cycle: int) -> int:
        return cycle * 37 + channel * 997 & 0xFFFF if channel in moving else levels[channel]

    for channel in range(16):
        adc.set_input(channel, levels[channel])
        if channel in moving:
            adc.source[channel] = lambda cycle, channel=channel: level(channel, cycle)
    plain, log, pin, wakes, edge = Plain(level), [], 0, 0, False
    looks = draw.choice((0.05, 0.5, 1.0))
    for name in ("ADCON3", "ADCON2", "ADCHS", "ADCSSL", "ADCON1"):
        value = _value(draw, name)
        log.append(f"0: {name} {value:#06x}")
        rig.write(name, value)
        plain.write(name, value, 0xFFFF)
    for cycle in range(1, CYCLES):
        rig.at(cycle)
        plain.live(cycle, edge)
        edge, kind = False, draw.random()
        if cycle == wakes:
            rig.dev.wake(cycle)
            plain.is_stopped = False
            log.append(f"{cycle}: awake")
        if not wakes > cycle and draw.random() < looks:
            seen = [rig.read(name) for name in ("ADCON1", "ADCON2", *(f"ADCBUF{n:X}" for n in range(16)))]
            wanted = [plain.word["ADCON1"], plain.word["ADCON2"], *plain.buffer]
            if seen != wanted or bool(rig.flag("ADIF")) != plain.flag:
                texts = [[f"{one:#06x}" for one in values] for values in (wanted, seen)]
                return f"cycle {cycle}: {texts[0]}, flag {plain.flag}; seen {texts[1]}; after {log[-8:]}"
            if plain.flag and draw.random() < 0.5:
                rig.clear_flags()
                plain.flag = False
        if kind < 0.02 and (channel := draw.randrange(16)) not in moving:
            levels[channel] = draw.randrange(0x10000)
            adc.set_input(channel, levels[channel])
        elif kind < 0.03:
            plain.references = draw.randrange(0x8000), draw.randrange(0x8000, 0x10001)
            adc.set_references(*plain.references)
        elif wakes <= cycle and kind < 0.09:
            name = draw.choice(("ADCON1", "ADCON1", "ADCON1", *plain.word))
            value, lanes = _value(draw, name), draw.choice((0xFFFF, 0xFFFF, 0x00FF, 0xFF00))
            if draw.random() < 0.3:
                name, value, lanes = "ADCON1", plain.word["ADCON1"] ^ SAMP, 0xFFFF
            log.append(f"{cycle}: {name} {value:#06x} in {lanes:#06x}")
            rig.write(name, value, lanes)
            plain.write(name, value, lanes)
        elif wakes <= cycle and kind < 0.12:
            pin ^= 1
            rig.dev.pins.set("RF6", pin)
            edge = bool(pin)
            log.append(f"{cycle}: INT0 {pin}")
        elif wakes <= cycle and kind < 0.13:
            mode, wakes = draw.choice((1, 2)), cycle + draw.randrange(1, 200)
            rig.dev.sleep(mode, cycle)
            plain.is_stopped = not plain.word["ADCON3"] & ADRC if mode == 2 else bool(plain.word["ADCON1"] & ADSIDL)
            log.append(f"{cycle}: asleep in mode {mode}")
    return None
