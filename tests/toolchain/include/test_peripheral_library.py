"""Headers of the peripheral library: they compile for every chip, and their functions set the registers as documented.

Values of macros are those of Microchip's "16-Bit Language Tools Libraries" (DS51456), in bits that the chip has.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import emu
from emu.chips import NAMES, chip_named
from emu.peripherals.i2c.bus import I2cDevice
from emu.peripherals.peripherals import Peripherals
from tests.toolchain.c_programs import build
from toolchain.peripheral_library import BODIES, headers

PROGRAM = Path(__file__).with_name("peripheral_library.c")
MEMORY_ADDRESS = 0x35

DOCUMENTED = {
    "T1CON": {"T1_ON": 0xFFFF, "T1_OFF": 0x7FFF, "T1_IDLE_CON": 0xDFFF, "T1_GATE_OFF": 0xFFBF, "T1_PS_1_1": 0xFFCF,
              "T1_PS_1_8": 0xFFDF, "T1_PS_1_64": 0xFFEF, "T1_SYNC_EXT_OFF": 0xFFFB, "T1_SOURCE_INT": 0xFFFD},
    "T2CON": {"T2_32BIT_MODE_OFF": 0xFFF7, "T2_PS_1_256": 0xFFFF},
    "IC1CON": {"IC_TIMER3_SRC": 0xFF7F, "IC_INT_2CAPTURE": 0xFFBF, "IC_EVERY_16_RISE_EDGE": 0xFFFD,
               "IC_EVERY_EDGE": 0xFFF9},
    "OC1CON": {"OC_TIMER2_SRC": 0xFFF7, "OC_PWM_FAULT_PIN_DISABLE": 0xFFFE, "OC_TOGGLE_PULSE": 0xFFFB,
               "OC_OFF": 0xFFF8},
    "U1MODE": {"UART_DIS": 0x6FE7, "UART_DIS_WAKE": 0xEF67, "UART_DIS_ABAUD": 0xEFC7, "UART_ODD_PAR_8BIT": 0xEFE5,
               "UART_EVEN_PAR_8BIT": 0xEFE3, "UART_NO_PAR_8BIT": 0xEFE1, "UART_1STOPBIT": 0xEFE6},
    "U1STA": {"UART_INT_TX": 0x7FFF, "UART_TX_PIN_NORMAL": 0xF7FF, "UART_TX_DISABLE": 0xFBFF,
              "UART_INT_RX_3_4_FUL": 0xFFBF,
              "UART_INT_RX_CHAR": 0xFF7F, "UART_ADR_DETECT_DIS": 0xFFDF, "UART_RX_OVERRUN_CLEAR": 0xFFFD},
    "SPI1CON": {"FRAME_ENABLE_OFF": 0xBFFF, "FRAME_SYNC_OUTPUT": 0xDFFF, "ENABLE_SDO_PIN": 0xF7FF,
                "SPI_CKE_OFF": 0xFEFF,
                "CLK_POL_ACTIVE_HIGH": 0xFFBF, "SEC_PRESCAL_3_1": 0xFFF7, "SEC_PRESCAL_8_1": 0xFFE3,
                "PRI_PRESCAL_64_1": 0xFFFC},
    "SPI1STAT": {"SPI_DISABLE": 0x7FFF, "SPI_RX_OVFLOW_CLR": 0xFFBF},
    "I2CCON": {"I2C_OFF": 0x7FFF, "I2C_CLK_HLD": 0xEFFF, "I2C_7BIT_ADD": 0xFBFF, "I2C_ACK": 0xFFDF,
               "I2C_RCV_DIS": 0xFFF7},
    "ADCON1": {"ADC_MODULE_OFF": 0x7FFF, "ADC_FORMAT_INTG": 0xFCFF, "ADC_CLK_TMR": 0xFF5F, "ADC_CLK_MANUAL": 0xFF1F,
               "ADC_AUTO_SAMPLING_OFF": 0xFFFB, "ADC_SAMPLE_INDIVIDUAL": 0xFFF7},
    "ADCON2": {"ADC_VREF_EXT_AVSS": 0x2FFF, "ADC_SCAN_OFF": 0xEBFF, "ADC_SAMPLES_PER_INT_11": 0xEFEB,
               "ADC_CONVERT_CH_0A": 0xEDFF},
    "ADCON3": {"ADC_SAMPLE_TIME_13": 0xEDFF, "ADC_CONV_CLK_SYSTEM": 0xFF7F, "ADC_CONV_CLK_21Tcy": 0xFFE9,
               "ADC_CONV_CLK_5Tcy2": 0xFFC4, "ADC_CONV_CLK_Tcy": 0xFFC1, "ADC_CONV_CLK_Tcy2": 0xFFC0},
    "ADCHS": {"ADC_CH0_POS_SAMPLEA_AN6": 0xFFF6, "ADC_CH0_NEG_SAMPLEA_NVREF": 0xFFEF, "ADC_CH0_POS_SAMPLEB_AN6": 0xF6FF,
              "ADC_CHX_POS_SAMPLEA_AN0AN1AN2": 0xFFDF, "ADC_CHX_NEG_SAMPLEB_AN6AN7AN8": 0xBFFF},
    "DCICON1": {"DCI_DIS": 0x7FFF, "DCI_SCKD_OUP": 0xFBFF, "DCI_TX_ZERO_UNF": 0xFF7F, "DCI_FSM_I2S": 0xFFFD},
    "DCICON2": {"DCI_BUFF_LEN_2": 0xF7FF, "DCI_FRAME_LEN_9": 0xFF1F, "DCI_DATA_WORD_12": 0xFFFB},
    "C1CTRL": {"CAN_CAPTURE_DIS": 0x2F00, "CAN_IDLE_CON": 0x8F00, "CAN_REQ_OPERMODE_LOOPBK": 0xAA00,
               "CAN_MASTERCLOCK_0_NO_WAIT": 0xB700},
    "C1CFG1": {"CAN_SYNC_JUMP_WIDTH3": 0x00BF, "CAN_BAUD_PRE_SCALE(5)": 0x00C4},
    "C1CFG2": {"CAN_WAKEUP_BY_FILTER_DIS": 0x07FF, "CAN_PHASE_SEG2_TQ(6)": 0x45FF, "CAN_PHASE_SEG1_TQ(3)": 0x47D7,
               "CAN_SAMPLE1TIME": 0x47BF},
    "C1TX0SID": {"CAN_TX_SID(0x555)": 0xA857, "CAN_SUB_NOR_TX_REQ": 0xF8FD, "CAN_TX_EID_DIS": 0xF8FE},
    "C1RXF0SID": {"CAN_FILTER_SID(0x555)": 0x1555, "CAN_RX_EID_DIS": 0x1FFC},
    "PTCON": {"PWM_DIS": 0x20FF, "PWM_OP_SCALE7": 0xA06F, "PWM_IPCLK_SCALE4": 0xA0F7, "PWM_MOD_SING": 0xA0FD},
    "PWMCON1": {"PWM_MOD2_COMP": 0x0DFF, "PWM_PDIS3H": 0x0FBF, "PWM_PDIS2L": 0x0FFD},
    "PWMCON2": {"PWM_SEVOPS5": 0x0403, "PWM_OSYNC_TCY": 0x0F01, "PWM_UEN": 0x0F02},
    "OVDCON": {"PWM_POUT_2L": 0xFBFF, "PWM_POUT1H_INACT": 0xFFFD},
    "FLTACON": {"PWM_OVA3L_INACTIVE": 0xEFFF, "PWM_FLTA_MODE_LATCH": 0xFF7F, "PWM_FLTA2_DIS": 0xFFFD},
    "QEICON": {"QEI_MODE_x2_PULSE": 0xFCFF, "QEI_CLK_PRESCALE_64": 0xFFF7, "QEI_INPUTS_NOSWAP": 0xFF7F},
    "DFLTCON": {"QEI_QE_CLK_DIVIDE_1_16": 0xFFBF, "QEI_QE_OUT_DISABLE": 0xFF7F, "MATCH_INDEX_INPUT_PHASEA": 0xFBFF},
}  # fmt: skip
"""Documented values of macros by the register for which they are made."""

INCLUDES = "".join(f"#include <{name}>\n" for name in BODIES)


class Echo(I2cDevice):
    """I2C device that returns the bytes of the last write from the first one on."""

    def __init__(self) -> None:
        self.written: list[int] = []
        self.next = 0

    def start(self, read: bool, cycle: int) -> bool:
        """Acknowledge; a write replaces the text, a read starts at its beginning."""
        if not read:
            self.written = []
        self.next = 0
        return True

    def write(self, byte: int, cycle: int) -> bool:
        """Append a byte."""
        self.written.append(byte)
        return True

    def read(self, cycle: int) -> int:
        """Return the next byte."""
        self.next += 1
        return self.written[self.next - 1]


def board(peripherals: Peripherals) -> Echo:
    """Attach the echoing device to the I2C bus of the chip."""
    device = Echo()
    assert peripherals.i2c is not None
    peripherals.i2c.wire.attach(MEMORY_ADDRESS, device)
    return device


@pytest.mark.parametrize("name", NAMES)
def test_macros_have_the_documented_bits(name: str, tmp_path: Path) -> None:
    """Each macro of a register of the chip has the documented value in the bits that software can write."""
    chip = chip_named(name)
    known = "".join(headers(chip).values())
    rows = [
        f'_Static_assert((({macro}) & {mask:#x}) == {value & mask:#x}, "{macro}");\n'
        for register, macros in DOCUMENTED.items()
        if register in chip.sfrs
        for mask in [chip.sfrs[register].mask & ~chip.sfrs[register].hw_owned]
        for macro, value in macros.items()
        if f" {macro.partition('(')[0]}" in known
    ]
    assert len(rows) > 60
    (tmp_path / "a.c").write_text(INCLUDES + INCLUDES + "".join(rows))
    standard = "gnu89" if name == "dsPIC30F4011" else "c11"
    options = ("-c", f"-mcpu={chip.name[5:]}", "-Wall", "-Wextra", f"-std={standard}")
    built = build([tmp_path / "a.c"], tmp_path / "a.o", *options)
    assert (built.status, built.messages) == (0, "")


def test_macros_combine_by_or_on_request(tmp_path: Path) -> None:
    """With USE_AND_OR, a setting has ones only in its own field, so settings combine by `|`."""
    (tmp_path / "a.c").write_text(
        "#define USE_AND_OR\n" + INCLUDES + '_Static_assert((T1_ON | T1_PS_1_64 | T1_SOURCE_INT) == 0x8020, "");\n'
        '_Static_assert((CAN_TX_SID(0x5A3) | CAN_TX_EID_EN | CAN_SUB_NOR_TX_REQ) == 0xB08D, "");\n'
        '_Static_assert((UART_EN | UART_NO_PAR_9BIT | UART_1STOPBIT) == 0x8006, "");\n'
        '_Static_assert((CAN_SYNC_JUMP_WIDTH2 | CAN_BAUD_PRE_SCALE(3)) == 0x42, "");\n'
    )
    built = build([tmp_path / "a.c"], tmp_path / "a.o", "-c", "-Wall")
    assert (built.status, built.messages) == (0, "")


def test_headers_compile_as_cxx(tmp_path: Path) -> None:
    """The headers compile as C++."""
    (tmp_path / "a.cpp").write_text(INCLUDES + "int main() { return OpenTimer1 == nullptr; }\n")
    built = build([tmp_path / "a.cpp"], tmp_path / "a.o", "-c")
    assert built.status == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "level"),
    [("dsPIC30F6014A", "-Os"), ("dsPIC30F4013", "-O0"), ("dsPIC30F3014", "-O2"), ("dsPIC30F4011", "-O2")],
)
def test_functions_set_the_registers(name: str, level: str, tmp_path: Path) -> None:
    """The functions configure, use and close each module of the chip (`peripheral_library.c`)."""
    options = (f"-mcpu={chip_named(name).name[5:]}", f"-DMEMORY_ADDRESS={MEMORY_ADDRESS}", level, "-Wall", "-Wextra")
    built = build([PROGRAM], tmp_path / "a.elf", *options)
    assert (built.status, built.messages) == (0, "")
    machine = emu.load(tmp_path / "a.elf", board=board)
    stop = machine.run(cycles=2_000_000)
    assert stop.reason == "halt", stop
    assert machine.w[0] == 0, f"{PROGRAM.name}:{machine.w[0]}"


def test_the_command_prints_a_header() -> None:
    """`python -m toolchain.device_header CHIP NAME` prints a header of the peripheral library."""
    words = [sys.executable, "-m", "toolchain.device_header"]
    done = subprocess.run([*words, "dsPIC30F4013", "can.h"], capture_output=True, text=True, check=True)
    assert done.stdout == headers(chip_named("dsPIC30F4013"))["can.h"]
    done = subprocess.run([*words, "dsPIC30F4013", "usb.h"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
