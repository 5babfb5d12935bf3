/* SPDX-License-Identifier: MIT */
/* XC16's name of the header that selects the device. */
#ifdef __dsPIC30F4013__
#include "dspic30f4013.h"
#else
#include "dspic30f6014a.h"
#endif
