"""Headers for external interrupts and change notification, for the causes of a reset, and for the watchdog timer."""

from __future__ import annotations

from collections.abc import Iterator

from emu.chips.chip import Chip
from toolchain.peripheral_library.lines import functions, interrupt_settings, macro

EDGE_BIT = 4  # falling edge, in the argument of ConfigINT0

EXTERNAL_FUNCTIONS = """
void ConfigINT$n(unsigned int config)
  _INT${n}IF = 0;
  _INT${n}IP = config & 7;
  _INT${n}EP = config >> 4 & 1;
  _INT${n}IE = config >> 3 & 1;

void CloseINT$n(void)
  _INT${n}IE = 0;
  _INT${n}IF = 0;
"""

CHANGE_FUNCTIONS = """
void ConfigCNPullups(long config)
  CNPU1 = (unsigned int)config;
  CNPU2 = (unsigned int)(config >> 16);

void ConfigIntCN(long config)
  _CNIF = 0;
  CNEN1 = (unsigned int)config;
  CNEN2 = (unsigned int)(config >> 16) & 0xFF;
  _CNIP = (unsigned int)(config >> 24) & 7;
  _CNIE = (unsigned int)(config >> 27) & 1;
"""
"""Functions of the change notification: bit n of the argument is input CNn, bits 24 to 27 are the interrupt's."""

RESET_FUNCTIONS = """
char isPOR(void)
  return RCONbits.POR;

char isBOR(void)
  return RCONbits.BOR;

char isMCLR(void)
  return RCONbits.EXTR;

char isWDTTO(void)
  return RCONbits.WDTO;

char isWDTWU(void)
  return RCONbits.WDTO && RCONbits.SLEEP;

char isWU(void)
  return RCONbits.SLEEP && !RCONbits.WDTO;
"""
"""Causes of a reset or of a wake-up from Sleep mode: `isWDTWU` by the watchdog, `isWU` by another source."""


def ports(chip: Chip) -> Iterator[str]:
    """Lines of `ports.h`."""
    yield from interrupt_settings("EXT_INT_PRI_", "EXT_INT_ENABLE", "EXT_INT_DISABLE")
    yield macro("FALLING_EDGE_INT", 0xFFFF, 1 << EDGE_BIT)
    yield macro("RISING_EDGE_INT", 0xFFFF & ~(1 << EDGE_BIT), 0)
    for n in (n for n in range(5) if any(f"INT{n}IE" in sfr.fields for sfr in chip.sfrs.values())):
        yield f"#define EnableINT{n} (_INT{n}IE = 1)"
        yield f"#define DisableINT{n} (_INT{n}IE = 0)"
        yield f"#define SetPriorityInt{n}(priority) (_INT{n}IP = (priority))"
        yield from functions(EXTERNAL_FUNCTIONS, n=str(n))
        yield f"#define configINT{n} ConfigINT{n}"
    yield from interrupt_settings("CHANGE_INT_PRI_", "CHANGE_INT_ON", "CHANGE_INT_OFF", 24, 27, 0xFFFFFFFF)
    for n in (n for n in range(24) if any(f"CN{n}IE" in chip.sfrs[name].fields for name in ("CNEN1", "CNEN2"))):
        yield f"#define EnableCN{n} (_CN{n}IE = 1)"
        yield f"#define DisableCN{n} (_CN{n}IE = 0)"
    yield from functions(CHANGE_FUNCTIONS)


def reset(chip: Chip) -> Iterator[str]:
    """Lines of `reset.h`. The macros PORStatReset and BORStatReset set the bits, as after a power-on."""
    yield "#define DisableInterrupts(cycles) __builtin_disi(cycles)"
    yield "#define PORStatReset (RCONbits.POR = 1)"
    yield "#define BORStatReset (RCONbits.BOR = 1)"
    yield from _software_watchdog()
    yield from functions(RESET_FUNCTIONS)
    if any("LVDIF" in sfr.fields for sfr in chip.sfrs.values()):
        yield from functions("char isLVD(void)\n  return _LVDIF;")


def watchdog(_chip: Chip) -> Iterator[str]:
    """Lines of `wdt.h`."""
    yield from _software_watchdog()
    yield "#define WDT_ENABLE 1"
    yield "#define WDT_DISABLE 0"
    yield "#define EnableWDT(config) (RCONbits.SWDTEN = (config) & 1)"
    yield "#define DisableWDT(config) (RCONbits.SWDTEN = (config) & 1)"
    yield "#define ClearWDT() __builtin_clrwdt()"


def _software_watchdog() -> Iterator[str]:
    """Macros that switch the watchdog timer by software."""
    yield "#define WDTSWEnable (RCONbits.SWDTEN = 1)"
    yield "#define WDTSWDisable (RCONbits.SWDTEN = 0)"
