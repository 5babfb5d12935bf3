/* SPDX-License-Identifier: MIT */
/* Microchip's name of the header that selects the device. */
#if defined(__dsPIC30F4013__)
#include "dspic30f4013.h"
#include "dspic30f4013_fields.h"
#elif defined(__dsPIC30F3014__)
#include "dspic30f3014.h"
#include "dspic30f3014_fields.h"
#elif defined(__dsPIC30F4011__)
#include "dspic30f4011.h"
#include "dspic30f4011_fields.h"
#elif defined(__dsPIC30F6012A__)
#include "dspic30f6012a.h"
#include "dspic30f6012a_fields.h"
#elif defined(__dsPIC30F6014__)
#include "dspic30f6014.h"
#include "dspic30f6014_fields.h"
#else
#include "dspic30f6014a.h"
#include "dspic30f6014a_fields.h"
#endif
