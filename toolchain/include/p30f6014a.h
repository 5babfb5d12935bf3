/* Microchip's name of the device header. */
#include "dspic30f6014a.h"
