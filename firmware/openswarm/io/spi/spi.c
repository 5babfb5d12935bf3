/* SPDX-License-Identifier: MIT */
/* SPI: one transfer at a time; the interrupt exchanges single bytes of the bus's own block. */
#include "spi.h"

#include "bus.h"
#include "hal_spi.h"
#include "kernel.h"

#include <string.h>

enum { LARGEST = 1024 };

typedef struct {
    uint16 size, done;
    uint8 bytes[]; /* to be sent, replaced by those received */
} job;

static bus spi;
static job *volatile running; /* NULL: the interrupt has finished it */
static sys_spi_processor processor;

sint16 spi_exchanged(uint8 received)
{
    job *j = running;
    j->bytes[j->done++] = received;
    if (j->done < j->size) {
        return j->bytes[j->done];
    }
    running = NULL;
    return -1;
}

static bool exchange(job *j)
{
    running = j;
    hal_spi_begin(j->bytes[0]);
    for (uint8 ms = 0; j->done < j->size && ms < SYS_SPI_TIMEOUT_MS; ms++) {
        Sys_Sleep(1);
    }
    hal_spi_end();
    return j->done == j->size;
}

/* Performs a transfer and returns its error. */
static sys_error transfer(job *j, sys_spi_processor process)
{
    if (process != NULL && !process(j->bytes, j->size, false)) {
        return SYS_ERROR_ARGUMENT;
    }
    if (!exchange(j)) {
        return SYS_ERROR_BUSY;
    }
    return process == NULL || process(j->bytes, j->size, true) ? SYS_OK : SYS_ERROR_ARGUMENT;
}

bool Sys_SPI_Transfer(const uint8 *out, uint8 *in, uint16 size)
{
    if (size == 0 || size > LARGEST) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    job *j = bus_take(&spi, (uint16)(sizeof *j + size), hal_spi_end);
    if (j == NULL) {
        return false;
    }
    j->size = size;
    j->done = 0;
    if (out != NULL) {
        memcpy(j->bytes, out, size);
    } else {
        memset(j->bytes, 0, size);
    }
    sys_error error = transfer(j, processor);
    if (error == SYS_OK && in != NULL) {
        memcpy(in, j->bytes, size);
    }
    bus_give(&spi, hal_spi_end);
    return error == SYS_OK || os_fail(error);
}

sys_spi_processor Sys_Set_SPIProcessor(sys_spi_processor wanted)
{
    if (os_enter() != SYS_OK) {
        return NULL;
    }
    sys_spi_processor before = processor;
    processor = wanted;
    section_close();
    return before;
}

void Sys_Start_SPI(void)
{
    processor = NULL;
    hal_spi_start();
}
