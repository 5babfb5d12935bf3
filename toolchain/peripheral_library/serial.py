"""Headers of the UARTs, SPI modules and the I2C module."""

from __future__ import annotations

from collections.abc import Iterator

from emu.chips.chip import Chip
from toolchain.peripheral_library.lines import (
    functions,
    instances,
    interrupt_controls,
    interrupt_settings,
    module,
    settings,
)

UART_MODE = {
    "EN": ("UARTEN", 1), "DIS": ("UARTEN", 0),
    "IDLE_STOP": ("USIDL", 1), "IDLE_CON": ("USIDL", 0),
    "ALTRX_ALTTX": ("ALTIO", 1), "RX_TX": ("ALTIO", 0),
    "EN_WAKE": ("WAKE", 1), "DIS_WAKE": ("WAKE", 0),
    "EN_LOOPBACK": ("LPBACK", 1), "DIS_LOOPBACK": ("LPBACK", 0),
    "EN_ABAUD": ("ABAUD", 1), "DIS_ABAUD": ("ABAUD", 0),
    "NO_PAR_9BIT": ("PDSEL", 3), "ODD_PAR_8BIT": ("PDSEL", 2), "EVEN_PAR_8BIT": ("PDSEL", 1),
    "NO_PAR_8BIT": ("PDSEL", 0),
    "2STOPBITS": ("STSEL", 1), "1STOPBIT": ("STSEL", 0),
}  # fmt: skip

UART_STATUS = {
    "INT_TX_BUF_EMPTY": ("UTXISEL", 1), "INT_TX": ("UTXISEL", 0),
    "TX_PIN_LOW": ("UTXBRK", 1), "TX_PIN_NORMAL": ("UTXBRK", 0),
    "TX_ENABLE": ("UTXEN", 1), "TX_DISABLE": ("UTXEN", 0),
    "INT_RX_BUF_FUL": ("URXISEL", 3), "INT_RX_3_4_FUL": ("URXISEL", 2), "INT_RX_CHAR": ("URXISEL", 1),
    "ADR_DETECT_EN": ("ADDEN", 1), "ADR_DETECT_DIS": ("ADDEN", 0),
    "RX_OVERRUN_CLEAR": ("OERR", 0),
}  # fmt: skip

UART_FUNCTIONS = """
void OpenUART$n(unsigned int config1, unsigned int config2, unsigned int ubrg)
  U${n}BRG = ubrg;
  U${n}MODE = config1;
  U${n}STA = config2;

void CloseUART$n(void)
  U${n}MODEbits.UARTEN = 0;
  _U${n}RXIE = 0;
  _U${n}TXIE = 0;
  _U${n}RXIF = 0;
  _U${n}TXIF = 0;

void ConfigIntUART$n(unsigned int config)
  _U${n}RXIF = 0;
  _U${n}TXIF = 0;
  _U${n}RXIP = config & 7;
  _U${n}TXIP = config >> 4 & 7;
  _U${n}RXIE = config >> 3 & 1;
  _U${n}TXIE = config >> 7 & 1;

char BusyUART$n(void)
  return !U${n}STAbits.TRMT;

char DataRdyUART$n(void)
  return U${n}STAbits.URXDA;

unsigned int ReadUART$n(void)
  return U${n}MODEbits.PDSEL == 3 ? U${n}RXREG : U${n}RXREG & 0xFF;

void WriteUART$n(unsigned int data)
  U${n}TXREG = U${n}MODEbits.PDSEL == 3 ? data : data & 0xFF;

void putsUART$n(unsigned int *buffer)
  const unsigned char *bytes = (const unsigned char *)buffer;
  unsigned int data;
  while ((data = U${n}MODEbits.PDSEL == 3 ? *buffer++ : *bytes++) != 0) {
    while (U${n}STAbits.UTXBF)
      continue;
    U${n}TXREG = data;
  }

unsigned int getsUART$n(unsigned int length, unsigned int *buffer, unsigned int uart_data_wait)
  unsigned char *bytes = (unsigned char *)buffer;
  for (; length; length--) {
    unsigned int wait = 0;
    while (!U${n}STAbits.URXDA)
      if (wait++ == uart_data_wait)
        return length;
    if (U${n}MODEbits.PDSEL == 3)
      *buffer++ = U${n}RXREG;
    else
      *bytes++ = (unsigned char)U${n}RXREG;
  }
  return 0;
"""
"""Functions of a UART. Words have 9 bits if PDSEL is 3, else the buffers hold bytes.

`getsUART` returns the number of words that it did not receive."""

SPI_CONTROL = {
    "FRAME_ENABLE_ON": ("FRMEN", 1), "FRAME_ENABLE_OFF": ("FRMEN", 0),
    "FRAME_SYNC_INPUT": ("SPIFSD", 1), "FRAME_SYNC_OUTPUT": ("SPIFSD", 0),
    "DISABLE_SDO_PIN": ("DISSDO", 1), "ENABLE_SDO_PIN": ("DISSDO", 0),
    "SPI_MODE16_ON": ("MODE16", 1), "SPI_MODE16_OFF": ("MODE16", 0),
    "SPI_SMP_ON": ("SMP", 1), "SPI_SMP_OFF": ("SMP", 0),
    "SPI_CKE_ON": ("CKE", 1), "SPI_CKE_OFF": ("CKE", 0),
    "SLAVE_ENABLE_ON": ("SSEN", 1), "SLAVE_ENABLE_OFF": ("SSEN", 0),
    "CLK_POL_ACTIVE_LOW": ("CKP", 1), "CLK_POL_ACTIVE_HIGH": ("CKP", 0),
    "MASTER_ENABLE_ON": ("MSTEN", 1), "MASTER_ENABLE_OFF": ("MSTEN", 0),
    **{f"SEC_PRESCAL_{ratio}_1": ("SPRE", 8 - ratio) for ratio in range(1, 9)},
    **{f"PRI_PRESCAL_{4**step}_1": ("PPRE", 3 - step) for step in range(4)},
}  # fmt: skip

SPI_STATUS = {
    "SPI_ENABLE": ("SPIEN", 1), "SPI_DISABLE": ("SPIEN", 0),
    "SPI_IDLE_STOP": ("SPISIDL", 1), "SPI_IDLE_CON": ("SPISIDL", 0),
    "SPI_RX_OVFLOW_CLR": ("SPIROV", 0),
}  # fmt: skip

SPI_FUNCTIONS = """
void OpenSPI$n(unsigned int config1, unsigned int config2)
  SPI${n}CON = config1;
  SPI${n}STAT = config2;

void CloseSPI$n(void)
  _SPI${n}IE = 0;
  SPI${n}STATbits.SPIEN = 0;
  _SPI${n}IF = 0;

char DataRdySPI$n(void)
  return SPI${n}STATbits.SPIRBF;

unsigned int ReadSPI$n(void)
  SPI${n}STATbits.SPIROV = 0;
  if (!SPI${n}STATbits.SPIRBF)
    return 0xFFFFu;
  return SPI${n}CONbits.MODE16 ? SPI${n}BUF : SPI${n}BUF & 0xFF;

void WriteSPI$n(unsigned int data_out)
  SPI${n}BUF = SPI${n}CONbits.MODE16 ? data_out : data_out & 0xFF;

void putsSPI$n(unsigned int length, unsigned int *wrptr)
  const unsigned char *bytes = (const unsigned char *)wrptr;
  for (; length; length--) {
    SPI${n}BUF = SPI${n}CONbits.MODE16 ? *wrptr++ : *bytes++;
    while (SPI${n}STATbits.SPITBF)
      continue;
  }

unsigned int getsSPI$n(unsigned int length, unsigned int *rdptr, unsigned int spi_data_wait)
  unsigned char *bytes = (unsigned char *)rdptr;
  for (; length; length--) {
    unsigned int wait = 0;
    while (!SPI${n}STATbits.SPIRBF)
      if (wait++ == spi_data_wait)
        return length;
    if (SPI${n}CONbits.MODE16)
      *rdptr++ = SPI${n}BUF;
    else
      *bytes++ = (unsigned char)SPI${n}BUF;
  }
  return 0;
"""
"""Functions of an SPI module. Words have 16 bits in the mode MODE16, else the buffers hold bytes.

`ReadSPI` returns 0xFFFF if the buffer is empty. `getsSPI` starts no transfer; it returns the number of words that it
did not receive."""

I2C_CONTROL = {
    "ON": ("I2CEN", 1), "OFF": ("I2CEN", 0),
    "IDLE_STOP": ("I2CSIDL", 1), "IDLE_CON": ("I2CSIDL", 0),
    "CLK_REL": ("SCLREL", 1), "CLK_HLD": ("SCLREL", 0),
    "IPMI_EN": ("IPMIEN", 1), "IPMI_DIS": ("IPMIEN", 0),
    "10BIT_ADD": ("A10M", 1), "7BIT_ADD": ("A10M", 0),
    "SLW_DIS": ("DISSLW", 1), "SLW_EN": ("DISSLW", 0),
    "SM_EN": ("SMEN", 1), "SM_DIS": ("SMEN", 0),
    "GCALL_EN": ("GCEN", 1), "GCALL_DIS": ("GCEN", 0),
    "STR_EN": ("STREN", 1), "STR_DIS": ("STREN", 0),
    "NACK": ("ACKDT", 1), "ACK": ("ACKDT", 0),
    "ACK_EN": ("ACKEN", 1), "ACK_DIS": ("ACKEN", 0),
    "RCV_EN": ("RCEN", 1), "RCV_DIS": ("RCEN", 0),
    "STOP_EN": ("PEN", 1), "STOP_DIS": ("PEN", 0),
    "RESTART_EN": ("RSEN", 1), "RESTART_DIS": ("RSEN", 0),
    "START_EN": ("SEN", 1), "START_DIS": ("SEN", 0),
}  # fmt: skip

I2C_FUNCTIONS = """
void OpenI2C(unsigned int config1, unsigned int config2)
  I2CBRG = config2;
  I2CCON = config1;

void CloseI2C(void)
  I2CCONbits.I2CEN = 0;
  _SI2CIE = 0;
  _MI2CIE = 0;
  _SI2CIF = 0;
  _MI2CIF = 0;

void ConfigIntI2C(unsigned int config)
  _SI2CIF = 0;
  _MI2CIF = 0;
  _SI2CIP = config & 7;
  _MI2CIP = config >> 4 & 7;
  _SI2CIE = config >> 3 & 1;
  _MI2CIE = config >> 7 & 1;

void StartI2C(void)
  I2CCONbits.SEN = 1;

void RestartI2C(void)
  I2CCONbits.RSEN = 1;

void StopI2C(void)
  I2CCONbits.PEN = 1;

void AckI2C(void)
  I2CCONbits.ACKDT = 0;
  I2CCONbits.ACKEN = 1;

void NotAckI2C(void)
  I2CCONbits.ACKDT = 1;
  I2CCONbits.ACKEN = 1;

void IdleI2C(void)
  while (I2CCON & (_I2CCON_SEN_MASK | _I2CCON_RSEN_MASK | _I2CCON_PEN_MASK | _I2CCON_RCEN_MASK | _I2CCON_ACKEN_MASK)
      || I2CSTATbits.TRSTAT)
    continue;

char DataRdyI2C(void)
  return I2CSTATbits.RBF;

unsigned char MasterReadI2C(void)
  I2CCONbits.RCEN = 1;
  while (I2CCONbits.RCEN)
    continue;
  I2CSTATbits.I2COV = 0;
  return (unsigned char)I2CRCV;

char MasterWriteI2C(unsigned char data_out)
  I2CTRN = data_out;
  return I2CSTATbits.IWCOL ? -1 : 0;

unsigned int MasterputsI2C(unsigned char *wrptr)
  for (; *wrptr; wrptr++) {
    if (MasterWriteI2C(*wrptr))
      return (unsigned int)-3;
    while (I2CSTATbits.TBF)
      continue;
    IdleI2C();
  }
  return 0;

unsigned int MastergetsI2C(unsigned int length, unsigned char *rdptr, unsigned int i2c_data_wait)
  while (length) {
    unsigned int wait = 0;
    I2CCONbits.RCEN = 1;
    while (!I2CSTATbits.RBF)
      if (wait++ == i2c_data_wait)
        return length;
    *rdptr++ = (unsigned char)I2CRCV;
    I2CCONbits.ACKDT = --length == 0;
    I2CCONbits.ACKEN = 1;
    while (I2CCONbits.ACKEN)
      continue;
  }
  return 0;

unsigned char SlaveReadI2C(void)
  while (!I2CSTATbits.RBF)
    continue;
  I2CSTATbits.I2COV = 0;
  return (unsigned char)I2CRCV;

void SlaveWriteI2C(unsigned char data_out)
  I2CTRN = data_out;
  I2CCONbits.SCLREL = 1;

unsigned int SlaveputsI2C(unsigned char *wrptr)
  for (; *wrptr; wrptr++) {
    SlaveWriteI2C(*wrptr);
    while (I2CSTATbits.TBF)
      continue;
  }
  return 0;

unsigned int SlavegetsI2C(unsigned char *rdptr, unsigned int i2c_data_wait)
  unsigned int count = 0, wait = 0;
  while (!I2CSTATbits.P)
    if (I2CSTATbits.RBF) {
      *rdptr++ = (unsigned char)I2CRCV;
      I2CSTATbits.I2COV = 0;
      I2CCONbits.SCLREL = 1;
      count++;
      wait = 0;
    } else if (wait++ == i2c_data_wait)
      break;
  return count;
"""
"""Functions of the I2C module.

`MasterputsI2C` returns -3 after a write collision. `MastergetsI2C` acknowledges every byte but the last one; it returns
the number of bytes that it did not receive. `SlavegetsI2C` returns the number of bytes received until the Stop."""


def uart(chip: Chip) -> Iterator[str]:
    """Lines of `uart.h`."""
    yield from settings(chip, "U1MODE", UART_MODE, "UART_")
    yield from settings(chip, "U1STA", UART_STATUS, "UART_")
    yield from interrupt_settings("UART_RX_INT_PR", "UART_RX_INT_EN", "UART_RX_INT_DIS")
    yield from interrupt_settings("UART_TX_INT_PR", "UART_TX_INT_EN", "UART_TX_INT_DIS", 4, 7)
    for n in instances(chip, "U${n}MODE"):
        yield from interrupt_controls(f"U{n}RX", f"U{n}RX")
        yield from interrupt_controls(f"U{n}TX", f"U{n}TX")
        yield from functions(UART_FUNCTIONS, n=n)
        yield f"#define getcUART{n} ReadUART{n}"
        yield f"#define putcUART{n} WriteUART{n}"


def spi(chip: Chip) -> Iterator[str]:
    """Lines of `spi.h`."""
    yield from settings(chip, "SPI1CON", SPI_CONTROL)
    yield from settings(chip, "SPI1STAT", SPI_STATUS)
    yield from interrupt_settings("SPI_INT_PRI_", "SPI_INT_EN", "SPI_INT_DIS")
    for n in instances(chip, "SPI${n}CON"):
        yield from module(f"SPI{n}", f"SPI{n}", f"ConfigIntSPI{n}", SPI_FUNCTIONS, n=n)
        yield f"#define getcSPI{n} ReadSPI{n}"
        yield f"#define putcSPI{n} WriteSPI{n}"


def i2c(chip: Chip) -> Iterator[str]:
    """Lines of `i2c.h`."""
    yield from settings(chip, "I2CCON", I2C_CONTROL, "I2C_")
    yield from interrupt_settings("SI2C_INT_PRI_", "SI2C_INT_ON", "SI2C_INT_OFF")
    yield from interrupt_settings("MI2C_INT_PRI_", "MI2C_INT_ON", "MI2C_INT_OFF", 4, 7)
    yield from interrupt_controls("SI2C", "SI2C")
    yield from interrupt_controls("MI2C", "MI2C")
    yield from functions(I2C_FUNCTIONS)
    for name in ("Slavegetc", "Slaveputc", "Mastergetc", "Masterputc"):
        yield f"#define {name}I2C {name.replace('getc', 'Read').replace('putc', 'Write')}I2C"
