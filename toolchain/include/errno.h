/* SPDX-License-Identifier: MIT */
/* C11 7.5. */
#ifndef ERRNO_H
#define ERRNO_H

extern int errno;
#define EDOM 33
#define ERANGE 34
#define EILSEQ 84

#endif
