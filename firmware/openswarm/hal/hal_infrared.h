/* SPDX-License-Identifier: MIT */
/* Lower layer of the infra-red link: contract; implemented in board/<robot>/infrared. Eight receivers are sampled in
 * turn, continuously, in scans of equal length. The scan is the link's only clock; three scans are one bit. A robot
 * with other hardware has its own link (io/infrared/README.md) and implements only start and number. */
#ifndef HAL_INFRARED_H
#define HAL_INFRARED_H

#include <stdbool.h>
#include <stdint.h>

enum { HAL_INFRARED_SENSORS = 8 };

/* No interrupt occurs before hal_start(). */
void hal_infrared_start(void);
void hal_infrared_light(bool on); /* all emitters at once */
/* The robot's permanent number, 1 to 2047, or 0: none. */
uint16_t hal_infrared_number(void);

/* ISR, io/infrared: called after each scan. raw[n] is sensor n, 12 bits, smaller is brighter; valid until the next scan
 * ends. Light switched here appears in the next scan. */
void infrared_scanned(const volatile unsigned int *raw);

#endif
