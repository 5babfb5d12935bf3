"""What instructions do to the converter (§13) in the common case: registers that stand, ADON switched."""

from __future__ import annotations

from dataclasses import dataclass

from emu.events import NEVER
from emu.peripherals.adccourse import FOREVER
from emu.straight import Number, Place, Reader, Slot

OFF, WAITING, SAMPLING, CONVERTING = range(4)
"""States: ADON = 0; nothing connected; SAMP = 1; SAMP = 0 and the converter at work."""


@dataclass(frozen=True, slots=True)
class Standing:
    """A register the converter changes by itself, but not before a cycle it has published."""

    register: Place
    until: Place


def read_standing(m: Reader, p: Standing) -> Number:
    """What is stored, until then."""
    m.need(m.now < m.get(p.until))
    return m.get(p.register)


@dataclass(frozen=True, slots=True)
class AdcPlaces:
    """ADCON1 and ADCON2 with their bits, and cells of the converter."""

    register: Place
    until: Place
    con2: Place
    writable: int
    clear_only: int
    adon: int
    samp: int
    bufs: int
    native: Place
    frozen: Place
    sampling: Place
    conversion: Place
    results: Place
    state: Place
    mark: Place
    half: Place
    begun: tuple[Place, ...]
    """Scan, multiplexer, buffer and count: 0 when sampling begins anew."""
    step: Slot


def write_con1(m: Reader, p: AdcPlaces, value: Number, lanes: int) -> bool:
    """ADON alone changes. On: sampling begins with the next cycle, from the first channel on. Off: the conversion under
    way is lost."""
    old = m.get(p.register)
    free, kept = p.writable & lanes, p.clear_only & lanes
    new = (old & (0xFFFF & ~(free | kept))) | (value & free) | (old & value & kept)
    plain = (m.get(p.native) != 0) & (m.get(p.frozen) == NEVER)
    m.need(((old ^ new) == p.adon) & plain & (m.now < m.get(p.until)))
    starts, con2 = (new & p.adon) != 0, m.get(p.con2)
    sampling = m.get(p.sampling)
    begun = (m.now + 1) << 1
    end = begun + m.get(p.results) * (sampling + m.get(p.conversion))
    for place, first in ((p.mark, m.now + 1), (p.half, 0), *((place, 0) for place in p.begun)):
        m.put(place, m.select(starts, first, m.get(place)))
    m.put(p.register, m.select(starts, new | p.samp, new & (0xFFFF & ~p.samp)))
    m.put(p.con2, m.select(starts, con2 & (0xFFFF & ~p.bufs), con2))
    m.put(p.state, m.select(starts, SAMPLING, OFF))
    m.put(p.until, m.select(starts, (begun + sampling + 1) >> 1, FOREVER))
    m.post(p.step, m.select(starts, (end + 1) >> 1, NEVER))
    return True
