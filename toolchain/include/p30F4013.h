/* SPDX-License-Identifier: MIT */
/* Microchip's name of the device header. */
#include "dspic30f4013.h"
