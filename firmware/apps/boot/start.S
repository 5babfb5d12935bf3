; Reset entry. Sets up the stack and continues in C code, which is at the address after these words.
#include "boot.h"

    .section .boot, code, address(BOOT_START), keep
    .global __reset
__reset:
    mov #__SP_init, w15
    mov #__SPLIM_init, w0
    mov w0, SPLIM
    nop
    bra _boot
