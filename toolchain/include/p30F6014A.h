/* SPDX-License-Identifier: MIT */
/* Microchip's name of the device header. */
#include "dspic30f6014a.h"
