/* SPDX-License-Identifier: MIT */
/* Type that libc++'s headers require; this library has no conversions with a multibyte state. */
#ifndef BITS_MBSTATE_T_H
#define BITS_MBSTATE_T_H

typedef struct {
  unsigned int pending;
} mbstate_t;

#endif
