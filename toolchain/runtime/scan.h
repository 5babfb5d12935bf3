/* SPDX-License-Identifier: MIT */
/* Inside of the scanf family. */
#ifndef SCAN_H
#define SCAN_H

/* Where the number at `at` ends, not behind `stop`; NULL when there is none. Base 0 takes C's prefixes. The driver links
 * those of 64-bit integers and doubles when a format string of the program mentions them; until then they are null. */
const char *__scan_wide(const char *at, const char *stop, int base, unsigned long long *value) __attribute__((__weak__));
const char *__scan_double(const char *at, const char *stop, double *value) __attribute__((__weak__));

#endif
