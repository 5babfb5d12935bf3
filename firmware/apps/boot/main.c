/* A boot loader for the e-puck: README.md. One function, so that its address attribute places all code. */
#include <p30F6014A.h>
#include <stdbool.h>
#include <stdint.h>

#include "boot.h"
#include "flash_cells.h"

enum {
    HELLO = 0xC1,
    TYPE = 0x91, /* tinybld on this chip is 0x71 */
    DONE = 'K',
    AGAIN = 'N',
    LAST = 0xFF,           /* fourth byte of a block: start the program */
    BAUD_115200 = 7,       /* 14,745,600 / (16 x 115,200) - 1 */
    SECOND = 7150,         /* iterations of the waiting loop, just over 2,048 Tcy each; the receiver holds four bytes */
    HEADER = 4,            /* address, lowest byte first, and command */
    PAGE = BOOT_START >> 16,
    OFFSET = BOOT_START & 0xFFFF,
    GOTO = 0x04
};

static uint8_t block[HEADER + FLASH_ROW_BYTES + 1];

FLASH_INLINE void send(uint8_t byte)
{
    while (U1STAbits.UTXBF) {
    }
    U1TXREG = byte;
}

/* Whether `count` bytes arrived, each within a second of the previous one. */
FLASH_INLINE bool receive(uint8_t *to, uint8_t count)
{
    while (count > 0) {
        uint16_t patience = SECOND;
        while (!U1STAbits.URXDA) {
            __asm__ volatile("repeat #2047\n\tnop");
            U1STAbits.OERR = 0;
            ClrWdt();
            if (--patience == 0) {
                return false;
            }
        }
        *to++ = (uint8_t)U1RXREG;
        count--;
    }
    return true;
}

/* Whether a row may be written: it is not in the loader, and row 0 must still jump to the loader. */
FLASH_INLINE bool may_write(uint16_t page, uint16_t offset, const uint8_t *bytes)
{
    if (page > PAGE || (page == PAGE && offset >= OFFSET) || offset % FLASH_ROW_UNITS != 0) {
        return false;
    }
    if (page != 0 || offset != 0) {
        return true;
    }
    return bytes[0] == (OFFSET & 0xFF) && bytes[1] == OFFSET >> 8 && bytes[2] == GOTO && bytes[3] == PAGE &&
           bytes[4] == 0 && bytes[5] == 0;
}

/* Answers blocks until the last one, or until the line is silent for a second. */
FLASH_INLINE void converse(void)
{
    if (!receive(block, 1) || block[0] != HELLO) {
        return;
    }
    send(TYPE);
    send(DONE);
    while (receive(block, HEADER) && block[3] != LAST && receive(block + HEADER, FLASH_ROW_BYTES + 1)) {
        uint8_t sum = 0;
        for (uint8_t i = 0; i < sizeof block; i++) {
            sum += block[i];
        }
        uint16_t offset = block[0] | (uint16_t)block[1] << 8, page = block[2];
        bool is_done = sum == 0 && may_write(page, offset, block + HEADER);
        if (is_done) {
            flash_write_row(page, offset, block + HEADER);
            is_done = flash_row_holds(page, offset, block + HEADER);
        }
        send(is_done ? DONE : AGAIN);
    }
}

void __attribute__((address(BOOT_CODE), noinline, noreturn)) boot(void)
{
    U1BRG = BAUD_115200;
    U1MODE = 0x8000;
    U1STA = 0x0400;
    converse();
    while (!U1STAbits.TRMT) {
    }
    U1MODE = 0;
    __asm__ volatile("goto %0" : : "i"(BOOT_ENTRY));
    __builtin_unreachable();
}
