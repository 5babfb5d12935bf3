/* Where the boot loader lies: the last rows of flash. The four words before it are the program's entry, which
 * `openswarm flash` puts there, since word 0 of flash leads into the loader. Erased they lead into it as well. */
#ifndef BOOT_H
#define BOOT_H

#define BOOT_START 0x017E00 /* known to openswarm/flashing/loaders.py too */
#define BOOT_ENTRY (BOOT_START - 8)
#define BOOT_CODE 0x017E10 /* start.S is shorter than this */

#endif
