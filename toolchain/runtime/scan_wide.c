/* SPDX-License-Identifier: MIT */
/* %lld and its relatives of scanf. */
#include "scan.h"
#include "scan_integer.h"

SCAN_INTEGER(__scan_wide, unsigned long long)
