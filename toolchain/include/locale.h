/* SPDX-License-Identifier: MIT */
/* C11 7.11: the locale is always "C". */
#ifndef LOCALE_H
#define LOCALE_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#define LC_ALL 0
#define LC_COLLATE 1
#define LC_CTYPE 2
#define LC_MONETARY 3
#define LC_NUMERIC 4
#define LC_TIME 5

struct lconv {
  char *decimal_point, *thousands_sep, *grouping;
  char *mon_decimal_point, *mon_thousands_sep, *mon_grouping, *positive_sign, *negative_sign;
  char *currency_symbol, *int_curr_symbol;
  char frac_digits, p_cs_precedes, n_cs_precedes, p_sep_by_space, n_sep_by_space, p_sign_posn, n_sign_posn;
  char int_frac_digits, int_p_cs_precedes, int_n_cs_precedes, int_p_sep_by_space, int_n_sep_by_space, int_p_sign_posn,
      int_n_sign_posn;
};

char *setlocale(int category, const char *name); /* "C" for "C", "" and NULL; NULL for every other name */
struct lconv *localeconv(void);

#ifdef __cplusplus
}
#endif

#endif
