"""Header of the CAN modules."""

from __future__ import annotations

from collections.abc import Iterator

from emu.chips.chip import Chip
from toolchain.peripheral_library.lines import (
    functions,
    inline,
    instances,
    interrupt_controls,
    interrupt_settings,
    settings,
)

CONTROL = {
    "CAPTURE_EN": ("CANCAP", 1), "CAPTURE_DIS": ("CANCAP", 0),
    "IDLE_STOP": ("CANSIDL", 1), "IDLE_CON": ("CANSIDL", 0),
    "MASTERCLOCK_1": ("CANCKS", 1), "MASTERCLOCK_0": ("CANCKS", 0),
    "REQ_OPERMODE_NOR": ("REQOP", 0), "REQ_OPERMODE_DIS": ("REQOP", 1), "REQ_OPERMODE_LOOPBK": ("REQOP", 2),
    "REQ_OPERMODE_LISTENONLY": ("REQOP", 3), "REQ_OPERMODE_CONFIG": ("REQOP", 4),
    "REQ_OPERMODE_LISTENALL": ("REQOP", 7),
}  # fmt: skip

TIMING1 = {f"SYNC_JUMP_WIDTH{width}": ("SJW", width - 1) for width in range(1, 5)}

TIMING2 = {
    "WAKEUP_BY_FILTER_EN": ("WAKFIL", 1), "WAKEUP_BY_FILTER_DIS": ("WAKFIL", 0),
    "SEG2_FREE_PROG": ("SEG2PHTS", 1), "SEG2_TIME_LIMIT_SET": ("SEG2PHTS", 0),
    "SAMPLE3TIMES": ("SAM", 1), "SAMPLE1TIME": ("SAM", 0),
}  # fmt: skip

SIZES = {
    "BAUD_PRE_SCALE": ("C1CFG1", "BRP"), "PHASE_SEG2_TQ": ("C1CFG2", "SEG2PH"), "PHASE_SEG1_TQ": ("C1CFG2", "SEG1PH"),
    "PROPAGATIONTIME_SEG_TQ": ("C1CFG2", "PRSEG"),
}  # fmt: skip
"""Macros whose argument is the value of a field plus one."""

TRANSMIT = {
    "TX_REQ": ("TXREQ", 1), "TX_STOP_REQ": ("TXREQ", 0),
    "TX_PRIORITY_HIGH": ("TXPRI", 3), "TX_PRIORITY_HIGH_INTER": ("TXPRI", 2),
    "TX_PRIORITY_LOW_INTER": ("TXPRI", 1), "TX_PRIORITY_LOW": ("TXPRI", 0),
}  # fmt: skip

RECEIVE = {
    "RXFUL_CLEAR": ("RXFUL", 0), "BUF0_DBLBUFFER_EN": ("DBEN", 1), "BUF0_DBLBUFFER_DIS": ("DBEN", 0),
}  # fmt: skip

INTERRUPTS = {
    f"INDI_{name}_{state}": (field, value)
    for name, field in {
        "INVMESS": "IRXIE", "WAK": "WAKIE", "ERR": "ERRIE", "TXB2": "TXB2IE", "TXB1": "TXB1IE", "TXB0": "TXB0IE",
        "RXB1": "RXB1IE", "RXB0": "RXB0IE",
    }.items()
    for state, value in (("EN", 1), ("DIS", 0))
}  # fmt: skip

IDENTIFIERS = {
    "CAN_MASK_SID(x)": "((unsigned int)(x) << 2 & 0x1FFC) | DSPIC_SETTING(0xE003, 0)",
    "CAN_MATCH_FILTER_TYPE": "DSPIC_SETTING(0xFFFF, 1)",
    "CAN_IGNORE_FILTER_TYPE": "DSPIC_SETTING(0xFFFE, 0)",
    "CAN_FILTER_SID(x)": "CAN_MASK_SID(x)",
    "CAN_RX_EID_EN": "DSPIC_SETTING(0xFFFF, 1)",
    "CAN_RX_EID_DIS": "DSPIC_SETTING(0xFFFE, 0)",
    "CAN_MASK_EID(x)": "((unsigned long)(x) & 0x3FFFF) << 10",
    "CAN_FILTER_EID(x)": "CAN_MASK_EID(x)",
    "CAN_TX_SID(x)": "((unsigned int)(x) << 5 & 0xF800) | ((unsigned int)(x) << 2 & 0xFC) | DSPIC_SETTING(3, 0)",
    "CAN_SUB_REM_TX_REQ": "DSPIC_SETTING(0xFFFF, 2)",
    "CAN_SUB_NOR_TX_REQ": "DSPIC_SETTING(0xFFFD, 0)",
    "CAN_TX_EID_EN": "DSPIC_SETTING(0xFFFF, 1)",
    "CAN_TX_EID_DIS": "DSPIC_SETTING(0xFFFE, 0)",
    "CAN_TX_EID(x)": "((unsigned long)(x) & 0x3C000) << 14 | ((unsigned long)(x) & 0x3FFF) << 10"
    " | DSPIC_SETTING(0x3F8, 0)",
    "CAN_REM_TX_REQ": "DSPIC_SETTING(0xFFFFFFFF, 0x200)",
    "CAN_NOR_TX_REQ": "DSPIC_SETTING(0xFFFFFDFF, 0)",
    **{f"CAN_DATALEN_{n}": f"DSPIC_SETTING(0x{0xFFFFFF87 | n << 3:08X}, 0x{n << 3:X})" for n in range(9)},
}
"""Values of identifier registers: the standard identifier has 11 bits, the extended part 18.

- Filter or mask: standard identifier in bits 12 to 2, EXIDE or MIDE in bit 0.
- Transmitted message: standard identifier in bits 15 to 11 and 7 to 2, SRR in bit 1, TXIDE in bit 0.
- Extended part of a transmitted message: the upper word is for EID; the lower word is for DLC, with TXRTR in bit 9 and
  the length in bits 6 to 3."""

FUNCTIONS = """
void CAN${n}Initialize(unsigned int config1, unsigned int config2)
  C${n}CFG1 = config1;
  C${n}CFG2 = config2;

void CAN${n}SetOperationMode(unsigned int config)
  C${n}CTRL = config;
  while (C${n}CTRLbits.OPMODE != (config >> 8 & 7))
    continue;

void CAN${n}SetOperationModeNoWait(unsigned int config)
  C${n}CTRL = config;

void CAN${n}AbortAll(void)
  C${n}CTRLbits.ABAT = 1;

void ConfigIntCAN$n(unsigned int config1, unsigned int config2)
  _C${n}IF = 0;
  C${n}INTE = config1;
  _C${n}IP = config2 & 7;
  _C${n}IE = config2 >> 3 & 1;

char CAN${n}IsTXPassive(void)
  return C${n}INTFbits.TXBP;

char CAN${n}IsRXPassive(void)
  return C${n}INTFbits.RXBP;

char CAN${n}IsBusOff(void)
  return C${n}INTFbits.TXBO;

unsigned char CAN${n}GetTXErrorCount(void)
  return C${n}TERRCNT;

unsigned char CAN${n}GetRXErrorCount(void)
  return C${n}RERRCNT;
"""


def can(chip: Chip) -> Iterator[str]:
    """Lines of `can.h`."""
    numbers = instances(chip, "C${n}CTRL")
    if not numbers:
        return
    control = chip.sfrs["C1CTRL"].fields
    no_freeze = 0xFFFF & ~(1 << control["CANFRZ"][0])
    yield from settings(chip, "C1CTRL", CONTROL, "CAN_", no_freeze & ~(1 << control["ABAT"][0]))
    abort = {f"{name}_NO_WAIT": row for name, row in CONTROL.items()}
    yield from settings(chip, "C1CTRL", abort, "CAN_", no_freeze)
    yield from settings(chip, "C1CFG1", TIMING1, "CAN_")
    yield from settings(chip, "C1CFG2", TIMING2, "CAN_")
    for name, (register, field) in SIZES.items():
        lsb, width = chip.sfrs[register].fields[field]
        largest = (1 << width) - 1
        others = f"DSPIC_SETTING(0x{0xFFFF & ~(largest << lsb):04X}, 0)"
        yield f"#define CAN_{name}(x) (((unsigned int)((x) - 1) & {largest}) << {lsb} | {others})"
    yield from settings(chip, "C1TX0CON", TRANSMIT, "CAN_")
    yield from settings(chip, "C1RX0CON", RECEIVE, "CAN_")
    yield from settings(chip, "C1INTE", INTERRUPTS, "CAN_")
    yield from (f"#define {name} ({value})" for name, value in IDENTIFIERS.items())
    yield from interrupt_settings("CAN_INT_PRI_", "CAN_INT_ENABLE", "CAN_INT_DISABLE")
    for n in numbers:
        yield from interrupt_controls(f"C{n}", f"CAN{n}")
        yield from functions(FUNCTIONS, n=n)
        yield from _buffer_functions(n)


def _buffer_functions(n: str) -> Iterator[str]:
    """Functions of module `n` that select a buffer, filter or mask by number. Numbers out of range select the last."""

    def chosen(argument: str, count: int, place: str) -> str:
        """Expression of the address of one of `count` registers; `#` in `place` is the number."""
        texts = [f"&{place.replace('#', str(k))}" for k in range(count)]
        tests = "".join(f"{argument} == {k} ? {text} : " for k, text in enumerate(texts[:-1]))
        return tests + texts[-1]

    transmit, receive = f"C{n}TX#CON", f"C{n}RX#CON"
    yield inline(
        f"void CAN{n}SetTXMode(char buffno, unsigned int config)",
        f"  *({chosen('buffno', 3, transmit)}) = config;",
    )
    yield inline(
        f"void CAN{n}SetRXMode(char buffno, unsigned int config)",
        f"  *({chosen('buffno', 2, receive)}) = config;",
    )
    yield inline(
        f"char CAN{n}IsTXReady(char buffno)",
        f"  return !(*({chosen('buffno', 3, transmit)}) & _C{n}TX0CON_TXREQ_MASK);",
    )
    yield inline(
        f"char CAN{n}IsRXReady(char buffno)",
        f"  return (*({chosen('buffno', 2, receive)}) & _C{n}RX0CON_RXFUL_MASK) != 0;",
    )
    for kind, letter, count in (("Mask", "M", 2), ("Filter", "F", 6)):
        registers = chosen("number", count, f"C{n}RX{letter}#SID")
        yield inline(
            f"void CAN{n}Set{kind}(char number, unsigned int sid, unsigned long eid)",
            f"  volatile unsigned int *registers = {registers};\n"
            "  registers[0] = sid;\n  registers[1] = (unsigned int)(eid >> 16);\n  registers[2] = (unsigned int)eid;",
        )
    yield inline(
        f"void CAN{n}SendMessage(unsigned int sid, unsigned long eid, unsigned char *data, unsigned char datalen, "
        "char MsgFlag)",
        f"  volatile unsigned int *registers = {chosen('MsgFlag', 3, f'C{n}TX#SID')};\n"
        "  registers[0] = sid;\n"
        "  registers[1] = (unsigned int)(eid >> 16);\n"
        f"  registers[2] = ((unsigned int)eid & ~_C{n}TX0DLC_DLC_MASK) | datalen << _C{n}TX0DLC_DLC_POSITION;\n"
        "  for (unsigned char i = 0; i < datalen; i++)\n"
        "    ((volatile unsigned char *)(registers + 3))[i] = data[i];\n"
        f"  registers[7] |= _C{n}TX0CON_TXREQ_MASK;",
    )
    yield inline(
        f"void CAN{n}ReceiveMessage(unsigned char *data, unsigned char datalen, char MsgFlag)",
        f"  volatile unsigned char *bytes = (volatile unsigned char *)({chosen('MsgFlag', 2, f'C{n}RX#B1')});\n"
        "  for (unsigned char i = 0; i < datalen; i++)\n"
        "    data[i] = bytes[i];",
    )
