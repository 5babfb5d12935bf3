"""Headers of the 10-bit and 12-bit analogue-to-digital converters."""

from __future__ import annotations

from collections.abc import Iterator

from emu.chips.chip import Chip
from toolchain.peripheral_library.lines import interrupt_settings, module, settings

INPUTS = range(16)

CONTROL1 = {
    "MODULE_ON": ("ADON", 1), "MODULE_OFF": ("ADON", 0),
    "IDLE_STOP": ("ADSIDL", 1), "IDLE_CONTINUE": ("ADSIDL", 0),
    "FORMAT_SIGN_FRACT": ("FORM", 3), "FORMAT_FRACT": ("FORM", 2), "FORMAT_SIGN_INT": ("FORM", 1),
    "FORMAT_INTG": ("FORM", 0),
    "CLK_AUTO": ("SSRC", 7), "CLK_MPWM": ("SSRC", 3), "CLK_TMR": ("SSRC", 2), "CLK_INT0": ("SSRC", 1),
    "CLK_MANUAL": ("SSRC", 0),
    "SAMPLE_SIMULTANEOUS": ("SIMSAM", 1), "SAMPLE_INDIVIDUAL": ("SIMSAM", 0),
    "AUTO_SAMPLING_ON": ("ASAM", 1), "AUTO_SAMPLING_OFF": ("ASAM", 0),
    "SAMP_ON": ("SAMP", 1), "SAMP_OFF": ("SAMP", 0),
}  # fmt: skip

CONTROL2 = {
    "VREF_AVDD_AVSS": ("VCFG", 0), "VREF_EXT_AVSS": ("VCFG", 1),
    "VREF_AVDD_EXT": ("VCFG", 2), "VREF_EXT_EXT": ("VCFG", 3),
    "SCAN_ON": ("CSCNA", 1), "SCAN_OFF": ("CSCNA", 0),
    "CONVERT_CH_0ABC": ("CHPS", 3), "CONVERT_CH_0A": ("CHPS", 1), "CONVERT_CH0": ("CHPS", 0),
    **{f"SAMPLES_PER_INT_{count}": ("SMPI", count - 1) for count in range(1, 17)},
    "ALT_BUF_ON": ("BUFM", 1), "ALT_BUF_OFF": ("BUFM", 0),
    "ALT_INPUT_ON": ("ALTS", 1), "ALT_INPUT_OFF": ("ALTS", 0),
}  # fmt: skip


def clock_name(divider: int) -> str:
    """Name of a conversion clock of (divider + 1) / 2 instruction cycles: Tcy2, Tcy, 3Tcy2, 2Tcy ..."""
    halves = divider + 1
    count, unit = (halves, "Tcy2") if halves % 2 else (halves // 2, "Tcy")
    return f"CONV_CLK_{count if count > 1 else ''}{unit}"


CONTROL3 = {
    **{f"SAMPLE_TIME_{time}": ("SAMC", time) for time in range(32)},
    "CONV_CLK_INTERNAL_RC": ("ADRC", 1), "CONV_CLK_SYSTEM": ("ADRC", 0),
    **{clock_name(divider): ("ADCS", divider) for divider in range(64)},
}  # fmt: skip

CHANNELS = {
    f"{name.replace('SAMPLE', 'SAMPLE' + side)}": (field + side, value)
    for side in "AB"
    for name, field, value in [
        *((f"CH0_POS_SAMPLE_AN{pin}", "CH0S", pin) for pin in INPUTS),
        ("CH0_NEG_SAMPLE_AN1", "CH0N", 1), ("CH0_NEG_SAMPLE_NVREF", "CH0N", 0), ("CH0_NEG_SAMPLE_VREFN", "CH0N", 0),
        ("CHX_POS_SAMPLE_AN3AN4AN5", "CH123S", 1), ("CHX_POS_SAMPLE_AN0AN1AN2", "CH123S", 0),
        ("CHX_NEG_SAMPLE_AN9AN10AN11", "CH123N", 3), ("CHX_NEG_SAMPLE_AN6AN7AN8", "CH123N", 2),
        ("CHX_NEG_SAMPLE_NVREF", "CH123N", 0),
    ]
}  # fmt: skip
"""Settings of ADCHS for the samples A and B."""

FUNCTIONS = """
void Open$adc(unsigned int config1, unsigned int config2, unsigned int config3,
    unsigned int configport, unsigned int configscan)
  ADPCFG = configport;
  ADCSSL = configscan;
  ADCON3 = config3;
  ADCON2 = config2;
  ADCON1 = config1;

void Close$adc(void)
  _ADIE = 0;
  ADCON1bits.ADON = 0;
  _ADIF = 0;

void Convert$adc(void)
  ADCON1bits.SAMP = 0;

char Busy$adc(void)
  return !ADCON1bits.DONE;

unsigned int Read$adc(unsigned char bufIndex)
  return (&ADCBUF0)[bufIndex];

void SetChan$adc(unsigned int channel)
  ADCHS = channel;
"""


def adc10(chip: Chip) -> Iterator[str]:
    """Lines of `adc10.h`; only this converter has several channels."""
    if "CHPS" in chip.sfrs["ADCON2"].fields:
        yield from _converter(chip, "ADC10")


def adc12(chip: Chip) -> Iterator[str]:
    """Lines of `adc12.h`."""
    if "CHPS" not in chip.sfrs["ADCON2"].fields:
        yield from _converter(chip, "ADC12")


def _converter(chip: Chip, name: str) -> Iterator[str]:
    """Lines of the header of the converter `name`."""
    for register, rows in (("ADCON1", CONTROL1), ("ADCON2", CONTROL2), ("ADCON3", CONTROL3), ("ADCHS", CHANNELS)):
        yield from settings(chip, register, rows, "ADC_")
    for pin in INPUTS:
        yield f"#define SKIP_SCAN_AN{pin} 0x{0xFFFF & ~(1 << pin):04X}"
        yield f"#define ENABLE_AN{pin}_ANA 0x{0xFFFF & ~(1 << pin):04X}"
    yield "#define SCAN_NONE 0x0000"
    yield "#define SCAN_ALL 0xFFFF"
    yield "#define ENABLE_ALL_ANA 0x0000"
    yield "#define ENABLE_ALL_DIG 0xFFFF"
    yield "#define ADC_RESULT_FIRST 0"
    yield "#define ADC_RESULT_SECOND 8"
    yield from interrupt_settings("ADC_INT_PRI_", "ADC_INT_ENABLE", "ADC_INT_DISABLE")
    yield from module("AD", "ADC", f"ConfigInt{name}", FUNCTIONS, adc=name)
    yield f"#define StopSamp{name} Convert{name}"
