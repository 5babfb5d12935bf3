/* SPDX-License-Identifier: MIT */
/* complex.h in single precision. */
#define REAL float
#define F(name) name##f
#define LARGE 20
#include "complex_functions.h"
