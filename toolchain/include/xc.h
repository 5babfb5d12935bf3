/* SPDX-License-Identifier: MIT */
/* XC16's header of every program: the device of -mcpu=, stdint.h, and the keywords of the Common C Interface (-ext=cci). */
#ifndef XC_H
#define XC_H

#include "p30fxxxx.h"

#ifndef __ASSEMBLER__
#include <stdint.h>

#ifdef __CCI__
#define __at(place) __attribute__((address(place)))
#define __section(text) __attribute__((section(text)))
#define __align(bytes) __attribute__((aligned(bytes)))
#define __deprecate __attribute__((deprecated))
#define __pack __attribute__((packed))
#define __persistent __attribute__((persistent))
#define __near __attribute__((near))
#define __far __attribute__((far))
#define __xdata __attribute__((space(xmemory)))
#define __ydata __attribute__((space(ymemory)))
#define __eeprom __attribute__((space(eedata)))
#define __interrupt(...) __attribute__((interrupt(__VA_ARGS__)))
#endif
#endif

#endif
