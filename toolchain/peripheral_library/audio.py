"""Header of the data converter interface."""

from __future__ import annotations

from collections.abc import Iterator

from emu.chips.chip import Chip
from toolchain.peripheral_library.lines import interrupt_settings, module, settings

CONTROL1 = {
    "EN": ("DCIEN", 1), "DIS": ("DCIEN", 0),
    "IDLE_STOP": ("DCISIDL", 1), "IDLE_CON": ("DCISIDL", 0),
    "DIGI_LPBACK_EN": ("DLOOP", 1), "DIGI_LPBACK_DIS": ("DLOOP", 0),
    "SCKD_INP": ("CSCKD", 1), "SCKD_OUP": ("CSCKD", 0),
    "SAMP_CLK_RIS": ("CSCKE", 1), "SAMP_CLK_FAL": ("CSCKE", 0),
    "FSD_INP": ("COFSD", 1), "FSD_OUP": ("COFSD", 0),
    "TX_LASTVAL_UNF": ("UNFM", 1), "TX_ZERO_UNF": ("UNFM", 0),
    "SDO_TRISTAT": ("CSDOM", 1), "SDO_ZERO": ("CSDOM", 0),
    "DJST_ON": ("DJST", 1), "DJST_OFF": ("DJST", 0),
    "FSM_ACLINK_20BIT": ("COFSM", 3), "FSM_ACLINK_16BIT": ("COFSM", 2),
    "FSM_I2S": ("COFSM", 1), "FSM_MULTI": ("COFSM", 0),
}  # fmt: skip

CONTROL2 = {
    **{f"BUFF_LEN_{length}": ("BLEN", length - 1) for length in range(1, 5)},
    **{f"FRAME_LEN_{words}": ("COFSG", words - 1) for words in range(1, 17)},
    **{f"DATA_WORD_{bits}": ("WS", bits - 1) for bits in range(4, 17)},
}

FUNCTIONS = """
void OpenDCI(unsigned int config1, unsigned int config2, unsigned int config3,
    unsigned int trans_mask, unsigned int recv_mask)
  DCICON2 = config2;
  DCICON3 = config3;
  TSCON = trans_mask;
  RSCON = recv_mask;
  DCICON1 = config1;

void CloseDCI(void)
  _DCIIE = 0;
  DCICON1bits.DCIEN = 0;
  _DCIIF = 0;

char BufferEmptyDCI(void)
  return DCISTATbits.TMPTY;

char DataRdyDCI(void)
  return DCISTATbits.RFUL;

unsigned int ReadDCI(unsigned char buffer)
  return (&RXBUF0)[buffer];

void WriteDCI(unsigned int data_out, unsigned char buffer)
  (&TXBUF0)[buffer] = data_out;
"""


def dci(chip: Chip) -> Iterator[str]:
    """Lines of `dci.h`."""
    if "DCICON1" not in chip.sfrs:
        return
    yield from settings(chip, "DCICON1", CONTROL1, "DCI_")
    yield from settings(chip, "DCICON2", CONTROL2, "DCI_")
    for slot in range(16):
        yield f"#define DCI_DIS_SLOT_{slot} 0x{0xFFFF & ~(1 << slot):04X}"
    yield "#define DCI_DIS_SLOT_ALL 0x0000"
    yield "#define DCI_EN_SLOT_ALL 0xFFFF"
    yield from interrupt_settings("DCI_INT_PRI_", "DCI_INT_ON", "DCI_INT_OFF")
    yield from module("DCI", "DCI", "ConfigIntDCI", FUNCTIONS)
