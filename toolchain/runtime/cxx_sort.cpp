// std::sort of arithmetic types: libc++'s header expects these instances in the library. Heap sort: small, no recursion.
#include <algorithm>

_LIBCPP_BEGIN_NAMESPACE_STD

template <class Less, class Iterator>
void __sort(Iterator first, Iterator last, Less)
{
    std::make_heap(first, last);
    std::sort_heap(first, last);
}

#define SORT(type) template void __sort<__less<type> &, type *>(type *, type *, __less<type> &)

SORT(char);
SORT(signed char);
SORT(unsigned char);
SORT(short);
SORT(unsigned short);
SORT(int);
SORT(unsigned int);
SORT(long);
SORT(unsigned long);
SORT(long long);
SORT(unsigned long long);
SORT(float);
SORT(double);
SORT(long double);

_LIBCPP_END_NAMESPACE_STD
