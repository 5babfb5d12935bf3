/* SPDX-License-Identifier: MIT */
/* Names of Microchip's libpic30 ("16-Bit Language Tools Libraries", chapter 4): delays, the UART, access to flash and EEPROM.
 * For __delay_ms and __delay_us the program defines FCY, the instruction cycles per second. */
#ifndef LIBPIC30_H
#define LIBPIC30_H

#ifdef __cplusplus
extern "C" {
#endif

/* Wait for the given number of instruction cycles, or up to 3 more, including call and return; at least 9. */
void __delay32(unsigned long cycles);

/* Address in flash or EEPROM: the page (TBLPAG) in bits 23:16, the offset in bits 15:0. */
typedef unsigned long _prog_addressT;
#define _init_prog_address(address, object) ((address) = __builtin_tbladdress(&(object)))

/* Copy bytes from program memory, 2 (p2d16) or 3 (p2d24) from each address; return the first address of which no byte is copied.
 * _strncpy stops after a NUL. */
_prog_addressT _memcpy_p2d16(void *destination, _prog_addressT source, unsigned int bytes);
_prog_addressT _memcpy_p2d24(void *destination, _prog_addressT source, unsigned int bytes);
_prog_addressT _strncpy_p2d16(char *destination, _prog_addressT source, unsigned int bytes);
_prog_addressT _strncpy_p2d24(char *destination, _prog_addressT source, unsigned int bytes);

/* Data EEPROM: erase a word or a row (16 words) or all, write a word or a row. Each call starts an operation of about 2 ms and returns;
 * _wait_eedata waits for its end. Interrupts of levels 1 to 6 are off for 8 cycles. */
#define _EE_WORD 2
#define _EE_ROW 32
void _erase_eedata(_prog_addressT destination, int bytes);
void _erase_eedata_all(void);
void _wait_eedata(void);
void _write_eedata_word(_prog_addressT destination, int word);
void _write_eedata_row(_prog_addressT destination, const void *source);

/* Flash: erase and write a row of 32 instructions; the CPU stalls for about 2 ms. _write_flash16 leaves the upper bytes erased (0xFF). */
/* UNVERIFIED: XC16's _write_flash16 also leaves the upper bytes erased. */
#define _FLASH_ROW 32
#define _FLASH_PAGE 32
void _erase_flash(_prog_addressT destination);
void _write_flash16(_prog_addressT destination, const int *source);
void _write_flash24(_prog_addressT destination, const long *source);

/* UART of printf, putchar, scanf and getchar: 1 or 2. A program may define it, or assign to it. */
extern int __C30_UART;

#define __delay_ms(milliseconds) __delay32((unsigned long)((milliseconds) * (FCY) / 1000ULL))
#define __delay_us(microseconds) __delay32((unsigned long)((microseconds) * (FCY) / 1000000ULL))

#ifdef __cplusplus
}
#endif

#endif
