/* SPDX-License-Identifier: MIT */
/* Functions that C++ code calls implicitly (Itanium C++ ABI, 3.3 and 5.1.5): new and delete on the C heap, which the linker
 * option --heap=BYTES creates. There are no exceptions: plain `new` ends the program if memory is exhausted. */
#include <stdlib.h>

void *_Znwj(size_t size)
{
    void *p = malloc(size ? size : 1);
    if (p == NULL)
        abort();
    return p;
}

void *_Znaj(size_t size)
{
    return _Znwj(size);
}

void *_ZnwjRKSt9nothrow_t(size_t size, const void *tag)
{
    (void)tag;
    return malloc(size ? size : 1);
}

void *_ZnajRKSt9nothrow_t(size_t size, const void *tag)
{
    return _ZnwjRKSt9nothrow_t(size, tag);
}

void _ZdlPv(void *p)
{
    free(p);
}

void _ZdlPvj(void *p, size_t size)
{
    (void)size;
    free(p);
}

void _ZdaPv(void *p)
{
    free(p);
}

void _ZdaPvj(void *p, size_t size)
{
    (void)size;
    free(p);
}

/* Called through the vtable of an object under construction or destruction: a pure virtual function. */
void __cxa_pure_virtual(void)
{
    abort();
}

/* std::__libcpp_verbose_abort(char const *, ...), which libc++ calls instead of throwing an exception. */
void _ZNSt3__122__libcpp_verbose_abortEPKcz(const char *format, ...)
{
    (void)format;
    abort();
}

/* std::nothrow */
const char _ZSt7nothrow = 0;
