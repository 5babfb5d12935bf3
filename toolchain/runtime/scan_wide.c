/* SPDX-License-Identifier: MIT */
/* Conversions of scanf with length ll: 64-bit integers. */
#include "scan.h"
#include "scan_integer.h"

SCAN_INTEGER(__scan_wide, unsigned long long)
