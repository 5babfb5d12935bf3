/* SPDX-License-Identifier: MIT */
/* C11 7.6 for arithmetic without flags or modes: it rounds to nearest and raises no flags. Macros of missing features are
 * undefined, as annex F.3 allows. */
#ifndef FENV_H
#define FENV_H

#ifdef __cplusplus
extern "C" {
#endif

typedef unsigned int fenv_t;
typedef unsigned int fexcept_t;

#define FE_ALL_EXCEPT 0
#define FE_TONEAREST 0
#define FE_DFL_ENV ((const fenv_t *)-1)

static __inline int feclearexcept(int which) { return which & 0; }
static __inline int feraiseexcept(int which) { return which != 0; }
static __inline int fetestexcept(int which) { return which & 0; }
static __inline int fegetexceptflag(fexcept_t *flags, int which) { return *flags = 0, which & 0; }
static __inline int fesetexceptflag(const fexcept_t *flags, int which) { return (void)flags, which != 0; }
static __inline int fegetround(void) { return FE_TONEAREST; }
static __inline int fesetround(int mode) { return mode != FE_TONEAREST; }
static __inline int fegetenv(fenv_t *to) { return *to = 0, 0; }
static __inline int feholdexcept(fenv_t *to) { return *to = 0, 0; }
static __inline int fesetenv(const fenv_t *from) { return (void)from, 0; }
static __inline int feupdateenv(const fenv_t *from) { return (void)from, 0; }

#ifdef __cplusplus
}
#endif

#endif
