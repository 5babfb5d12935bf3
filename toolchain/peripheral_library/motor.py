"""Headers of the motor control PWM and the quadrature encoder interface."""

from __future__ import annotations

from collections.abc import Iterator

from emu.chips.chip import Chip
from toolchain.peripheral_library.lines import (
    functions,
    interrupt_controls,
    interrupt_settings,
    macro,
    module,
    settings,
)

SIDES = [f"{pair}{side}" for pair in range(1, 5) for side in "HL"]

TIME_BASE = {
    "EN": ("PTEN", 1), "DIS": ("PTEN", 0),
    "IDLE_STOP": ("PTSIDL", 1), "IDLE_CON": ("PTSIDL", 0),
    **{f"OP_SCALE{scale}": ("PTOPS", scale - 1) for scale in range(1, 17)},
    **{f"IPCLK_SCALE{4**step}": ("PTCKPS", step) for step in range(4)},
    "MOD_FREE": ("PTMOD", 0), "MOD_SING": ("PTMOD", 1), "MOD_UPDN": ("PTMOD", 2), "MOD_DBL": ("PTMOD", 3),
}  # fmt: skip

OUTPUTS = {
    **{f"MOD{pair}_IND": (f"PMOD{pair}", 1) for pair in range(1, 5)},
    **{f"MOD{pair}_COMP": (f"PMOD{pair}", 0) for pair in range(1, 5)},
    **{f"PEN{side}": (f"PEN{side}", 1) for side in SIDES},
    **{f"PDIS{side}": (f"PEN{side}", 0) for side in SIDES},
}

UPDATES = {
    **{f"SEVOPS{scale}": ("SEVOPS", scale - 1) for scale in range(1, 17)},
    "OSYNC_PWM": ("OSYNC", 1), "OSYNC_TCY": ("OSYNC", 0),
    "UDIS": ("UDIS", 1), "UEN": ("UDIS", 0),
}  # fmt: skip

DEAD_TIME = {
    **{f"DT{unit}PS{1 << step}": (f"DT{unit}PS", step) for unit in "AB" for step in range(4)},
    **{f"DT{unit}{time}": (f"DT{unit}", time) for unit in "AB" for time in range(64)},
}

OVERRIDE = {
    **{f"GEN_{side}": (f"POVD{side}", 1) for side in SIDES},
    **{f"POUT_{side}": (f"POVD{side}", 0) for side in SIDES},
    **{f"POUT{side}_ACT": (f"POUT{side}", 1) for side in SIDES},
    **{f"POUT{side}_INACT": (f"POUT{side}", 0) for side in SIDES},
}

FAULT = {
    **{f"OVA{side}_ACTIVE": (f"FAOV{side}", 1) for side in SIDES},
    **{f"OVA{side}_INACTIVE": (f"FAOV{side}", 0) for side in SIDES},
    "FLTA_MODE_CYCLE": ("FLTAM", 1), "FLTA_MODE_LATCH": ("FLTAM", 0),
    **{f"FLTA{pair}_EN": (f"FAEN{pair}", 1) for pair in range(1, 5)},
    **{f"FLTA{pair}_DIS": (f"FAEN{pair}", 0) for pair in range(1, 5)},
}  # fmt: skip

PWM_FUNCTIONS = """
void OpenMCPWM(unsigned int period, unsigned int sptime, unsigned int config1,
    unsigned int config2, unsigned int config3)
  PTPER = period;
  SEVTCMP = sptime;
  PWMCON1 = config2;
  PWMCON2 = config3;
  PTCON = config1;

void CloseMCPWM(void)
  _PWMIE = 0;
  _FLTAIE = 0;
  PTCONbits.PTEN = 0;
  _PWMIF = 0;
  _FLTAIF = 0;

void ConfigIntMCPWM(unsigned int config)
  _PWMIF = 0;
  _FLTAIF = 0;
  _PWMIP = config & 7;
  _FLTAIP = config >> 4 & 7;
  _PWMIE = config >> 3 & 1;
  _FLTAIE = config >> 7 & 1;

void OverrideMCPWM(unsigned int config)
  OVDCON = config;

void SetDCMCPWM(unsigned int dutycyclereg, unsigned int dutycycle, char updatedisable)
  PWMCON2bits.UDIS = updatedisable & 1;
  (&PDC1)[dutycyclereg - 1] = dutycycle;

void SetMCPWMDeadTimeGeneration(unsigned int config)
  DTCON1 = config;

void SetMCPWMFaultA(unsigned int config)
  FLTACON = config;
"""

ENCODER = {
    "DIR_SEL_QEB": ("UPDN_SRC", 1), "DIR_SEL_CNTRL": ("UPDN_SRC", 0),
    "EXT_CLK": ("TQCS", 1), "INT_CLK": ("TQCS", 0),
    "INDEX_RESET_ENABLE": ("POSRES", 1), "INDEX_RESET_DISABLE": ("POSRES", 0),
    "CLK_PRESCALE_1": ("TQCKPS", 0), "CLK_PRESCALE_8": ("TQCKPS", 1), "CLK_PRESCALE_64": ("TQCKPS", 2),
    "CLK_PRESCALE_256": ("TQCKPS", 3),
    "GATED_ACC_ENABLE": ("TQGATE", 1), "GATED_ACC_DISABLE": ("TQGATE", 0),
    "LOGIC_CONTROL_IO": ("PCDOUT", 1), "NORMAL_IO": ("PCDOUT", 0),
    "INPUTS_SWAP": ("SWPAB", 1), "INPUTS_NOSWAP": ("SWPAB", 0),
    "MODE_x4_MATCH": ("QEIM", 7), "MODE_x4_PULSE": ("QEIM", 6), "MODE_x2_MATCH": ("QEIM", 5),
    "MODE_x2_PULSE": ("QEIM", 4),
    "MODE_TIMER": ("QEIM", 1), "MODE_OFF": ("QEIM", 0),
    "UP_COUNT": ("UPDN", 1), "DOWN_COUNT": ("UPDN", 0),
    "IDLE_STOP": ("QEISIDL", 1), "IDLE_CON": ("QEISIDL", 0),
}  # fmt: skip

FILTER = {
    **{f"QEI_QE_CLK_DIVIDE_1_{ratio}": ("QECK", code) for code, ratio in enumerate((1, 2, 4, 16, 32, 64, 128, 256))},
    "QEI_QE_OUT_ENABLE": ("QEOUT", 1), "QEI_QE_OUT_DISABLE": ("QEOUT", 0),
    "POS_CNT_ERR_INT_DISABLE": ("CEID", 1), "POS_CNT_ERR_INT_ENABLE": ("CEID", 0),
}  # fmt: skip

QEI_FUNCTIONS = """
void OpenQEI(unsigned int config1, unsigned int config2)
  QEICON = config1;
  DFLTCON = config2;

void CloseQEI(void)
  _QEIIE = 0;
  QEICONbits.QEIM = 0;
  _QEIIF = 0;

unsigned int ReadQEI(void)
  return POSCNT;

void WriteQEI(unsigned int position)
  POSCNT = position;
"""


def pwm(chip: Chip) -> Iterator[str]:
    """Lines of `pwm.h`."""
    if "PTCON" not in chip.sfrs:
        return
    yield from settings(chip, "PTCON", TIME_BASE, "PWM_")
    yield from settings(chip, "PWMCON1", OUTPUTS, "PWM_")
    immediate = 1 << chip.sfrs["PWMCON2"].fields["IUE"][0]
    yield from settings(chip, "PWMCON2", UPDATES, "PWM_", 0xFFFF & ~immediate)
    yield from settings(chip, "DTCON1", DEAD_TIME, "PWM_")
    yield from settings(chip, "OVDCON", OVERRIDE, "PWM_")
    yield from settings(chip, "FLTACON", FAULT, "PWM_")
    yield from interrupt_settings("PWM_INT_PR", "PWM_INT_EN", "PWM_INT_DIS")
    yield from interrupt_settings("PWM_FLTA_INT_PR", "PWM_FLTA_EN_INT", "PWM_FLTA_DIS_INT", 4, 7)
    yield from interrupt_controls("PWM", "MCPWM")
    yield from interrupt_controls("FLTA", "FLTA")
    yield from functions(PWM_FUNCTIONS)


def qei(chip: Chip) -> Iterator[str]:
    """Lines of `qei.h`."""
    if "QEICON" not in chip.sfrs:
        return
    yield from settings(chip, "QEICON", ENCODER, "QEI_")
    yield from settings(chip, "DFLTCON", FILTER)
    yield from _index_settings(chip)
    yield from interrupt_settings("QEI_INT_PRI_", "QEI_INT_ENABLE", "QEI_INT_DISABLE", enable_bit=7)
    yield from module("QEI", "QEI", "ConfigIntQEI", QEI_FUNCTIONS, 7)


def _index_settings(chip: Chip) -> Iterator[str]:
    """Macros for the two bits of IMV: levels of both phases in the mode x4, else the phase and its level."""
    lsb, _width = chip.sfrs["DFLTCON"].fields["IMV"]
    for bit, high, low in (
        (lsb + 1, "PHASEB_HIGH", "PHASEB_LOW"),
        (lsb, "PHASEA_HIGH", "PHASEA_LOW"),
        (lsb + 1, "INPUT_PHASEB", "INPUT_PHASEA"),
        (lsb, "INPUT_HIGH", "INPUT_LOW"),
    ):
        yield macro(f"MATCH_INDEX_{high}", 0xFFFF, 1 << bit)
        yield macro(f"MATCH_INDEX_{low}", 0xFFFF & ~(1 << bit), 0)
