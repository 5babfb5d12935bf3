/* SPDX-License-Identifier: MIT */
/* POSIX bit search on int. */
#ifndef STRINGS_H
#define STRINGS_H

#ifdef __cplusplus
extern "C" {
#endif

static __inline int ffs(int value) { return __builtin_ffs(value); }

#ifdef __cplusplus
}
#endif

#endif
