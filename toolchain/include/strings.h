/* POSIX bit search on int. */
#ifndef STRINGS_H
#define STRINGS_H

static inline int ffs(int value) { return __builtin_ffs(value); }

#endif
