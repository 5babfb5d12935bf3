/* SPDX-License-Identifier: MIT */
/* Lower layer of the SPI master. */
#ifndef HAL_SPI_H
#define HAL_SPI_H

#include <stdint.h>

void hal_spi_start(void);              /* pins and module; the slave is not selected */
void hal_spi_begin(uint8_t first);     /* selects the slave and sends; spi_exchanged() follows each byte */
void hal_spi_end(void);                /* disables the interrupt; deasserts chip select */
int16_t spi_exchanged(uint8_t received); /* ISR, io/spi: the next byte, 0-255, or -1 */

#endif
