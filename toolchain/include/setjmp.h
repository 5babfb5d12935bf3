/* SPDX-License-Identifier: MIT */
/* C11 7.13: W8-W15 and the return address (abi-elf.md §2.1). */
#ifndef SETJMP_H
#define SETJMP_H

#ifdef __cplusplus
extern "C" {
#endif

typedef unsigned int jmp_buf[10];
int setjmp(jmp_buf environment) __attribute__((__returns_twice__));
_Noreturn void longjmp(jmp_buf environment, int value);

#ifdef __cplusplus
}
#endif

#endif
