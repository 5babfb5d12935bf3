/* SPDX-License-Identifier: MIT */
/* complex.h in double precision. */
#define REAL double
#define F(name) name
#define LARGE 40
#include "complex_functions.h"
