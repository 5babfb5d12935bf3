/* SPDX-License-Identifier: MIT */
/* XC16's name of the header that selects the device. */
#include "p30fxxxx.h"
