"""Headers of the timers, input captures and output compares."""

from __future__ import annotations

from collections.abc import Iterator

from emu.chips.chip import Chip
from toolchain.peripheral_library.lines import (
    configure_interrupt,
    functions,
    instances,
    interrupt_settings,
    module,
    settings,
)

TIMER = {
    "ON": ("TON", 1), "OFF": ("TON", 0),
    "IDLE_STOP": ("TSIDL", 1), "IDLE_CON": ("TSIDL", 0),
    "GATE_ON": ("TGATE", 1), "GATE_OFF": ("TGATE", 0),
    "PS_1_1": ("TCKPS", 0), "PS_1_8": ("TCKPS", 1), "PS_1_64": ("TCKPS", 2), "PS_1_256": ("TCKPS", 3),
    "32BIT_MODE_ON": ("T32", 1), "32BIT_MODE_OFF": ("T32", 0),
    "SYNC_EXT_ON": ("TSYNC", 1), "SYNC_EXT_OFF": ("TSYNC", 0),
    "SOURCE_EXT": ("TCS", 1), "SOURCE_INT": ("TCS", 0),
}  # fmt: skip

TIMER_FUNCTIONS = """
void OpenTimer$n(unsigned int config, unsigned int period)
  TMR$n = 0;
  PR$n = period;
  T${n}CON = config;

void CloseTimer$n(void)
  _T${n}IE = 0;
  T${n}CON = 0;
  _T${n}IF = 0;

unsigned int ReadTimer$n(void)
  return TMR$n;

void WriteTimer$n(unsigned int timer)
  TMR$n = timer;
"""

PAIR_FUNCTIONS = """
void OpenTimer$low$high(unsigned int config, unsigned long period)
  TMR${high}HLD = 0;
  TMR$low = 0;
  PR$high = (unsigned int)(period >> 16);
  PR$low = (unsigned int)period;
  T${low}CON = config | _T${low}CON_T32_MASK;

void CloseTimer$low$high(void)
  _T${high}IE = 0;
  T${low}CON = 0;
  _T${high}IF = 0;

unsigned long ReadTimer$low$high(void)
  unsigned int timer = TMR$low;
  return (unsigned long)TMR${high}HLD << 16 | timer;

void WriteTimer$low$high(unsigned long timer)
  TMR${high}HLD = (unsigned int)(timer >> 16);
  TMR$low = (unsigned int)timer;
"""
"""Functions of two timers as one of 32 bits; the interrupt is that of the upper timer."""

CAPTURE = {
    "IDLE_STOP": ("ICSIDL", 1), "IDLE_CON": ("ICSIDL", 0),
    "TIMER2_SRC": ("ICTMR", 1), "TIMER3_SRC": ("ICTMR", 0),
    "INT_4CAPTURE": ("ICI", 3), "INT_3CAPTURE": ("ICI", 2), "INT_2CAPTURE": ("ICI", 1), "INT_1CAPTURE": ("ICI", 0),
    "INTERRUPT": ("ICM", 7), "EVERY_16_RISE_EDGE": ("ICM", 5), "EVERY_4_RISE_EDGE": ("ICM", 4),
    "EVERY_RISE_EDGE": ("ICM", 3), "EVERY_FALL_EDGE": ("ICM", 2), "EVERY_EDGE": ("ICM", 1), "INPUTCAP_OFF": ("ICM", 0),
}  # fmt: skip

CAPTURE_FUNCTIONS = """
void OpenCapture$n(unsigned int config)
  IC${n}CON = config;

void CloseCapture$n(void)
  _IC${n}IE = 0;
  IC${n}CONbits.ICM = 0;
  _IC${n}IF = 0;

void ReadCapture$n(unsigned int *buffer)
  while (IC${n}CONbits.ICBNE)
    *buffer++ = IC${n}BUF;
"""

COMPARE = {
    "IDLE_STOP": ("OCSIDL", 1), "IDLE_CON": ("OCSIDL", 0),
    "TIMER3_SRC": ("OCTSEL", 1), "TIMER2_SRC": ("OCTSEL", 0),
    "PWM_FAULT_PIN_ENABLE": ("OCM", 7), "PWM_FAULT_PIN_DISABLE": ("OCM", 6),
    "CONTINUE_PULSE": ("OCM", 5), "SINGLE_PULSE": ("OCM", 4), "TOGGLE_PULSE": ("OCM", 3),
    "HIGH_LOW": ("OCM", 2), "LOW_HIGH": ("OCM", 1), "OFF": ("OCM", 0),
}  # fmt: skip

COMPARE_FUNCTIONS = """
void OpenOC$n(unsigned int config, unsigned int value1, unsigned int value2)
  OC${n}CONbits.OCM = 0;
  OC${n}RS = value1;
  OC${n}R = value2;
  OC${n}CON = config;

void CloseOC$n(void)
  _OC${n}IE = 0;
  OC${n}CONbits.OCM = 0;
  _OC${n}IF = 0;

unsigned int ReadDCOC${n}PWM(void)
  return OC${n}CONbits.OCM >= 6 ? OC${n}RS : 0xFFFFu;

unsigned int ReadRegOC$n(char reg)
  return OC${n}CONbits.OCM >= 6 ? 0xFFFFu : reg ? OC${n}R : OC${n}RS;

void SetDCOC${n}PWM(unsigned int dutycycle)
  if (OC${n}CONbits.OCM >= 6)
    OC${n}RS = dutycycle;

void SetPulseOC$n(unsigned int pulse_start, unsigned int pulse_stop)
  if (OC${n}CONbits.OCM < 6) {
    OC${n}R = pulse_start;
    OC${n}RS = pulse_stop;
  }
"""
"""Functions of an output compare; in its two PWM modes OCM is 6 or 7."""


def timer(chip: Chip) -> Iterator[str]:
    """Lines of `timer.h`."""
    numbers = instances(chip, "T${n}CON")
    for n in numbers:
        yield from settings(chip, f"T{n}CON", TIMER, f"T{n}_")
        yield from interrupt_settings(f"T{n}_INT_PRIOR_", f"T{n}_INT_ON", f"T{n}_INT_OFF")
        yield from module(f"T{n}", f"T{n}", f"ConfigIntTimer{n}", TIMER_FUNCTIONS, n=n)
    for low, high in ("23", "45"):
        if low in numbers and high in numbers:
            yield from functions(PAIR_FUNCTIONS, low=low, high=high)
            yield configure_interrupt(f"T{high}", f"ConfigIntTimer{low}{high}")


def input_capture(chip: Chip) -> Iterator[str]:
    """Lines of `incap.h`."""
    yield from settings(chip, "IC1CON", CAPTURE, "IC_")
    yield from interrupt_settings("IC_INT_PRIOR_", "IC_INT_ON", "IC_INT_OFF")
    for n in instances(chip, "IC${n}CON"):
        yield from module(f"IC{n}", f"IC{n}", f"ConfigIntCapture{n}", CAPTURE_FUNCTIONS, n=n)


def output_compare(chip: Chip) -> Iterator[str]:
    """Lines of `outcompare.h`."""
    yield from settings(chip, "OC1CON", COMPARE, "OC_")
    yield from interrupt_settings("OC_INT_PRIOR_", "OC_INT_ON", "OC_INT_OFF")
    for n in instances(chip, "OC${n}CON"):
        yield from module(f"OC{n}", f"OC{n}", f"ConfigIntOC{n}", COMPARE_FUNCTIONS, n=n)
