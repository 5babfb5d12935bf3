/* SPDX-License-Identifier: MIT */
/* Internal declarations of the scanf family. */
#ifndef SCAN_H
#define SCAN_H

/* Return the end of the number at `at`, at most `stop`; NULL if there is none. Base 0 accepts C's prefixes. The driver
 * links each function only if a format string reads 64-bit integers or doubles; otherwise its address is null. */
const char *__scan_wide(const char *at, const char *stop, int base, unsigned long long *value) __attribute__((__weak__));
const char *__scan_double(const char *at, const char *stop, double *value) __attribute__((__weak__));

#endif
