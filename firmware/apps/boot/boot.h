/* Addresses of the boot loader: the last rows of flash. The four words before it are the program's entry.
 * `openswarm flash` writes them, because word 0 of flash jumps to the loader. Erased, they lead to the loader, too. */
#ifndef BOOT_H
#define BOOT_H

#define BOOT_START 0x017E00 /* known to openswarm/flashing/loaders.py too */
#define BOOT_ENTRY (BOOT_START - 8)
#define BOOT_CODE 0x017E10 /* start.S is shorter than this */

#endif
