/* SPDX-License-Identifier: MIT */
/* libc++'s headers ask for this type by this name. There are no multibyte conversions here. */
#ifndef BITS_MBSTATE_T_H
#define BITS_MBSTATE_T_H

typedef struct {
  unsigned int pending;
} mbstate_t;

#endif
