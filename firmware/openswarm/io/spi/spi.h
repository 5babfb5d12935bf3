/* SPDX-License-Identifier: MIT */
/* SPI master for threads: the interrupt exchanges the bytes while the thread sleeps. */
#ifndef SPI_H
#define SPI_H

#include "openswarm.h"

enum { SYS_SPI_TIMEOUT_MS = 100 /* of one transfer; no board's heap holds a transfer that takes longer */ };

/* Receives the bytes of a transfer twice and may change them: first those to send, then those received. False: the
 * bytes are not sent, or those received are damaged; the transfer fails. Context: the thread that calls
 * Sys_SPI_Transfer. */
typedef bool (*sys_spi_processor)(uint8 *bytes, uint16 size, bool received);
/* MTH | no | 52 | 16 | none.  Sets the processor of later transfers; NULL removes it. */
sys_spi_processor Sys_Set_SPIProcessor(sys_spi_processor processor);

/* M | no | - | 20 | none.  Between Sys_Init_Kernel and Sys_Start_Kernel. Mode 0, 8 bits; rate and pins:
 * board/epuck/spi. */
void Sys_Start_SPI(void);

/* T | until done, at most SYS_SPI_TIMEOUT_MS | - | 60 | CONTEXT, BUSY, MEMORY, ARGUMENT.  Sends size bytes of out
 * (NULL: zeros) and stores the received bytes in in (NULL: dropped); chip select stays asserted. False with ARGUMENT:
 * the processor refused, or size is 0 or above 1024; with BUSY: another thread's transfer is in progress, or time-out.
 * The bytes are copied to a heap block of size + 4; the block of a thread killed meanwhile is kept until the next
 * call. */
bool Sys_SPI_Transfer(const uint8 *out, uint8 *in, uint16 size);

#endif
