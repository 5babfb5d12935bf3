/* SPDX-License-Identifier: MIT */
/* Lower layer of the infra-red link: contract here, code in board/<robot>/infrared. Eight receivers are sampled one after the
 * other in scans of equal length, for ever; the scan is the only clock of the link. Three scans are a bit. A robot whose
 * hardware is another has a link of its own (io/infrared/README.md), of which start and number are all that others call. */
#ifndef HAL_INFRARED_H
#define HAL_INFRARED_H

#include <stdbool.h>
#include <stdint.h>

enum { HAL_INFRARED_SENSORS = 8 };

/* No interrupt comes before hal_start(). */
void hal_infrared_start(void);
void hal_infrared_light(bool on); /* all emitters at once */
/* A number given to this robot for ever, 1 to 2047, or 0: none. */
uint16_t hal_infrared_number(void);

/* ISR, io/infrared: a scan is over. raw[n] is sensor n, 12 bits, smaller is brighter; valid until the next scan is over.
 * Light that is switched here shows in the next scan. */
void infrared_scanned(const volatile unsigned int *raw);

#endif
