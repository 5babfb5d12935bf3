"""Data addresses of the ATmega328P's registers, for Python and C (data sheet, register summary; avr.md §1)."""

from __future__ import annotations

from typing import Final

_GROUPS: Final = (
    (0x23, "PINB DDRB PORTB PINC DDRC PORTC PIND DDRD PORTD"),
    (0x35, "TIFR0 TIFR1 TIFR2"),
    (0x3B, "PCIFR EIFR EIMSK GPIOR0 EECR EEDR EEARL EEARH GTCCR TCCR0A TCCR0B TCNT0 OCR0A OCR0B"),
    (0x4A, "GPIOR1 GPIOR2 SPCR SPSR SPDR"),
    (0x50, "ACSR"),
    (0x53, "SMCR MCUSR MCUCR"),
    (0x57, "SPMCSR"),
    (0x5D, "SPL SPH SREG"),
    (0x60, "WDTCSR CLKPR"),
    (0x64, "PRR"),
    (0x66, "OSCCAL"),
    (0x68, "PCICR EICRA"),
    (0x6B, "PCMSK0 PCMSK1 PCMSK2 TIMSK0 TIMSK1 TIMSK2"),
    (0x78, "ADCL ADCH ADCSRA ADCSRB ADMUX"),
    (0x7E, "DIDR0 DIDR1 TCCR1A TCCR1B TCCR1C"),
    (0x84, "TCNT1L TCNT1H ICR1L ICR1H OCR1AL OCR1AH OCR1BL OCR1BH"),
    (0xB0, "TCCR2A TCCR2B TCNT2 OCR2A OCR2B"),
    (0xB6, "ASSR"),
    (0xB8, "TWBR"),
    (0xBD, "TWAMR"),
    (0xC0, "UCSR0A UCSR0B UCSR0C"),
    (0xC4, "UBRR0L UBRR0H UDR0"),
)
"""Address of the first register of a group, and the registers from there."""
ADDRESSES: Final = {name: first + index for first, names in _GROUPS for index, name in enumerate(names.split())}
C_NAMES: Final = {"SREG": "SREG_AT"}
"""C names of addresses that differ from the register's: in the instruction table, SREG is the value (isa/rows.py)."""


def enumeration() -> str:
    """Return the addresses as an enumeration in C."""
    return "enum {\n" + "".join(f"    {C_NAMES.get(n, n)} = {a:#04x},\n" for n, a in ADDRESSES.items()) + "};\n"
