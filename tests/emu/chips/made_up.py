"""A fictitious chip that differs in every property that engines and devices must take from `Chip`.

Its SFRs end later, the size of its RAM differs and is no power of two, Y RAM is smaller than X RAM, flash ends
earlier, half of the devices are missing, and every interrupt has another number, flag and priority field.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType
from typing import Final

from emu.chips.chip import Chip, InterruptSource, Region, Sfr
from emu.chips.dspic30f6014a import DSPIC30F6014A

SFR_END, Y_START, RAM_END, FLASH_END = 0x0900, 0x1100, 0x1500, 0xD000
_GONE: Final = ("IC3", "IC4", "IC5", "IC6", "IC7", "IC8", "OC3", "OC4", "OC5", "OC6", "OC7", "OC8", "U2RX", "U2TX",
                "SPI2", "C1", "C2", "DCI", "SI2C", "MI2C", "T4", "T5", "INT3", "INT4", "LVD")  # fmt: skip
_WITHOUT: Final = (
    "IC3", "IC4", "IC5", "IC6", "IC7", "IC8", "OC3", "OC4", "OC5", "OC6", "OC7", "OC8", "U2", "SPI2", "C1", "C2", "DCI",
    "TSCON", "RSCON", "RXBUF", "TXBUF", "I2C", "T4", "T5", "TMR4", "TMR5", "PR4", "PR5", "PMD3",
)  # fmt: skip


def _interrupts(whole: Chip) -> dict[int, InterruptSource]:
    """Return the interrupt sources of the remaining devices, numbered backwards from 40."""
    kept = [source for source in whole.interrupts.values() if source.name not in _GONE]
    table = {}
    for place, source in enumerate(kept):
        irq = 40 - 2 * place
        word, bit, group = irq // 16, irq % 16, irq // 4
        table[irq] = InterruptSource(
            irq, source.name, (f"IFS{word}", bit), (f"IEC{word}", bit), (f"IPC{group}", 4 * (irq % 4))
        )
    return table


def _sfrs(whole: Chip, interrupts: dict[int, InterruptSource]) -> dict[str, Sfr]:
    """Return the registers of the remaining devices, with flags, enables and priorities in the places that
    `interrupts` gives."""
    sfrs = {name: sfr for name, sfr in whole.sfrs.items() if not name.startswith(_WITHOUT)}
    fields: dict[str, dict[str, tuple[int, int]]] = {}
    for source in interrupts.values():
        stem = "AD" if source.name == "ADC" else source.name
        places = ((source.flag, "IF", 1), (source.enable, "IE", 1), (source.priority, "IP", 3))
        for (register, bit), suffix, width in places:
            fields.setdefault(register, {})[stem + suffix] = (bit, width)
    for name, sfr in list(sfrs.items()):
        if name.startswith(("IFS", "IEC", "IPC")):
            own = fields.get(name, {})
            mask = sum((1 << width) - 1 << lsb for lsb, width in own.values())
            reset = sum(4 << lsb for lsb, _ in own.values()) if name.startswith("IPC") else 0
            sfrs[name] = replace(sfr, fields=MappingProxyType(own), mask=mask, reset=reset)
        elif name.startswith("PMD"):
            own = {field: place for field, place in sfr.fields.items() if not field.startswith(_WITHOUT)}
            mask = sum(1 << lsb for lsb, _ in own.values())
            sfrs[name] = replace(sfr, fields=MappingProxyType(own), mask=mask)
    return sfrs


def _made_up(whole: Chip) -> Chip:
    interrupts = _interrupts(whole)
    numbers = {whole.interrupts[irq].name: irq for irq in whole.interrupts}
    now = {numbers[source.name]: irq for irq, source in interrupts.items()}
    named = {source.name: source.irq for source in interrupts.values()}
    vectors = []
    for vector in whole.vectors:
        source = None if vector.irq is None else interrupts.get(vector.irq)
        if vector.irq is not None:
            name = f"{source.name}Interrupt" if source else f"Interrupt{vector.irq}"
            vector = replace(vector, name=name, implemented=source is not None)
        vectors.append(vector)
    data = dict(whole.data)
    for region in (Region("sfr", 0, SFR_END), Region("ram", SFR_END, RAM_END), Region("xram", SFR_END, Y_START),
                   Region("yram", Y_START, RAM_END)):  # fmt: skip
        data[region.name] = region
    program = dict(whole.program)
    program["flash"] = Region("flash", 0, FLASH_END)
    program["program"] = Region("program", program["program"].start, FLASH_END)
    program["eedata"] = Region("eedata", 0x7FFE00, 0x800000)
    timers = tuple(
        replace(timer, irq=named[f"T{timer.number}"]) for timer in whole.timers if f"T{timer.number}" in named
    )
    return replace(
        whole,
        name="dsPIC30F0000",
        sfrs=MappingProxyType(_sfrs(whole, interrupts)),
        vectors=tuple(vectors),
        interrupts=MappingProxyType(dict(sorted(interrupts.items()))),
        data=MappingProxyType(data),
        program=MappingProxyType(program),
        external_pins=tuple((pin, now[irq]) for pin, irq in whole.external_pins if irq in now),
        timers=timers,
        uarts=tuple(
            replace(uart, rx_irq=now[uart.rx_irq], tx_irq=now[uart.tx_irq]) for uart in whole.uarts[:1]
        ),
        spis=tuple(replace(spi, irq=now[spi.irq]) for spi in whole.spis[:1]),
        i2c=None,
        captures=tuple(replace(site, irq=now[site.irq]) for site in whole.captures[:2]),
        compares=tuple(replace(site, irq=now[site.irq]) for site in whole.compares[:2]),
        adc=replace(whole.adc, pins=whole.adc.pins[:13], irq=now[whole.adc.irq]),
        dci=None,
        cans=(),
        nvm_irq=now[whole.nvm_irq],
        lvd_irq=None,
    )  # fmt: skip


MADE_UP: Final = _made_up(DSPIC30F6014A)
CHIPS: Final = {chip.name: chip for chip in (DSPIC30F6014A, MADE_UP)}
"""Chips on which the campaigns run."""
