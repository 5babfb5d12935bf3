/* SPDX-License-Identifier: MIT */
/* Internal declarations of the scanf family. */
#ifndef SCAN_H
#define SCAN_H

/* Return the end of the number at `at`, at most `stop`; NULL if there is none. Base 0 accepts C's prefixes. The driver
 * links those of 64-bit integers and doubles if a format string contains them; otherwise they are null. */
const char *__scan_wide(const char *at, const char *stop, int base, unsigned long long *value) __attribute__((__weak__));
const char *__scan_double(const char *at, const char *stop, double *value) __attribute__((__weak__));

#endif
