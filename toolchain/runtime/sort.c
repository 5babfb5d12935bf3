/* SPDX-License-Identifier: MIT */
/* qsort and bsearch (C11 7.22.5). Heap sort: no recursion, no extra memory, O(n log n) in the worst case. */
#include <stdlib.h>

typedef int comparison(const void *, const void *);

static void swap(char *left, char *right, size_t size)
{
    while (size--) {
        char kept = *left;
        *left++ = *right;
        *right++ = kept;
    }
}

/* Restore the heap below `root` (byte offsets; `end` is exclusive). */
static void sift(char *base, size_t root, size_t end, size_t size, comparison *compare)
{
    for (size_t child; (child = 2 * root + size) < end; root = child) {
        if (child + size < end && compare(base + child, base + child + size) < 0)
            child += size;
        if (compare(base + root, base + child) >= 0)
            return;
        swap(base + root, base + child, size);
    }
}

void qsort(void *base, size_t count, size_t size, comparison *compare)
{
    size_t end = count * size;
    if (count < 2)
        return;
    for (size_t root = count / 2 * size; root > 0;) {
        root -= size;
        sift(base, root, end, size, compare);
    }
    while (end > size) {
        end -= size;
        swap(base, (char *)base + end, size);
        sift(base, 0, end, size, compare);
    }
}

void *bsearch(const void *key, const void *base, size_t count, size_t size, comparison *compare)
{
    const char *low = base;
    while (count) {
        const char *middle = low + count / 2 * size;
        int order = compare(key, middle);
        if (order == 0)
            return (void *)middle;
        if (order > 0) {
            low = middle + size;
            count -= count / 2 + 1;
        } else {
            count /= 2;
        }
    }
    return NULL;
}
