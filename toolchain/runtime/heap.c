/* SPDX-License-Identifier: MIT */
/* malloc, calloc, aligned_alloc, realloc, free (C11 7.22.3) in the linker's heap (-Wl,--heap=BYTES; without it malloc fails).
 * First fit over one list of blocks in address order; free neighbours are joined. Overhead: 2 bytes per block. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

extern char _heap[], _eheap[]; /* linker symbols __heap and __eheap, both 0 without a heap */

/* Header of a block: even number of bytes to the next header; bit 0 is set while the block is in use. */
typedef unsigned int header_t;
#define USED 1u
#define HEADER ((size_t)sizeof(header_t))
#define LARGEST 0x7FFEu

static header_t *at(char *address)
{
    return (header_t *)(void *)address;
}

static void start(void)
{
    static unsigned char started;
    if (!started && (uintptr_t)_eheap > (uintptr_t)_heap)
        *at(_heap) = (header_t)(_eheap - _heap) & ~USED;
    started = 1;
}

void *malloc(size_t size)
{
    start();
    if (size > LARGEST - HEADER)
        return NULL;
    header_t needed = (header_t)(size + HEADER + 1) & ~USED;
    if (needed < 2 * HEADER)
        needed = 2 * HEADER;
    for (char *block = _heap; block < _eheap; block += *at(block) & ~USED) {
        header_t length = *at(block);
        if (length & USED)
            continue;
        for (char *next = block + length; next < _eheap && !(*at(next) & USED); next = block + length)
            length += *at(next);
        *at(block) = length;
        if (length < needed)
            continue;
        if (length - needed >= 2 * HEADER) {
            *at(block + needed) = length - needed;
            length = needed;
        }
        *at(block) = length | USED;
        return block + HEADER;
    }
    return NULL;
}

void free(void *memory)
{
    if (memory)
        *at((char *)memory - HEADER) &= ~USED;
}

void *calloc(size_t count, size_t size)
{
    unsigned long bytes = (unsigned long)count * size;
    if (bytes > LARGEST)
        return NULL;
    void *memory = malloc((size_t)bytes);
    return memory ? memset(memory, 0, (size_t)bytes) : NULL;
}

/* The part before the first aligned address becomes a free block, so it must have room for one. */
void *aligned_alloc(size_t alignment, size_t size)
{
    if (!alignment || alignment & (alignment - 1) || alignment > LARGEST / 2 || size > LARGEST / 2)
        return NULL;
    if (alignment <= HEADER) /* every block has this alignment */
        return malloc(size);
    char *memory = malloc(size + alignment + 2 * HEADER);
    if (!memory || !((uintptr_t)memory & (alignment - 1)))
        return memory;
    uintptr_t least = (uintptr_t)memory + 2 * HEADER;
    char *aligned = memory + 2 * HEADER + (-least & (alignment - 1));
    header_t front = (header_t)(aligned - memory);
    *at(aligned - HEADER) = *at(memory - HEADER) - front; /* still in use */
    *at(memory - HEADER) = front;
    return aligned;
}

void *realloc(void *memory, size_t size)
{
    if (!memory)
        return malloc(size);
    size_t had = (*at((char *)memory - HEADER) & ~USED) - HEADER;
    if (size <= had)
        return memory;
    void *moved = malloc(size);
    if (moved) {
        memcpy(moved, memory, had);
        free(memory);
    }
    return moved;
}
