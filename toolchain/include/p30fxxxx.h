/* SPDX-License-Identifier: MIT */
/* Microchip's name of the header that selects the device; there is one device here. */
#include "dspic30f6014a.h"
