/* SPDX-License-Identifier: MIT */
/* Neighbour table of fixed size. Only the link's interrupt writes it. */
#include "infrared_parts.h"
#include "kernel.h"

static sys_neighbour table[SYS_NEIGHBOURS]; /* source 0: free */
static uint8 known, next_to_age;

static void lose(sys_neighbour *n)
{
    (void)Sys_Send_Event(SYS_NEIGHBOUR_LOST, n, sizeof *n);
    n->source = 0;
    known--;
}

/* Returns the entry of a number; else a free one; else the entry not heard for the longest time. */
static sys_neighbour *entry_of(uint16 number, uint16 now)
{
    sys_neighbour *best = table;
    uint16 oldest = 0;
    for (sys_neighbour *n = table; n != table + SYS_NEIGHBOURS; n++) {
        if (n->source == number) {
            return n;
        }
        uint16 age = n->source != 0 ? (uint16)(now - n->heard) : 0xFFFFu;
        if (age >= oldest) {
            oldest = age;
            best = n;
        }
    }
    return best;
}

void neighbours_heard(uint16 number, uint8 sensor, uint16 strength)
{
    uint16 now = clock_now();
    sys_neighbour *n = entry_of(number, now);
    bool is_new = n->source != number;
    if (is_new && n->source != 0) {
        lose(n);
    }
    *n = (sys_neighbour){number, strength, now, sensor};
    if (is_new) {
        known++;
        (void)Sys_Send_Event(SYS_NEIGHBOUR_SEEN, n, sizeof *n);
    }
}

void neighbours_age(void)
{
    sys_neighbour *n = table + next_to_age;
    next_to_age = (uint8)((next_to_age + 1u) % SYS_NEIGHBOURS);
    if (n->source != 0 && (uint16)(clock_now() - n->heard) > SYS_NEIGHBOUR_LIFETIME) {
        lose(n);
    }
}

uint8 neighbours_count(void)
{
    return known;
}

uint8 Sys_Get_Neighbours(sys_neighbour *neighbours, uint8 most)
{
    uint8 copied = 0;
    for (const sys_neighbour *n = table; n != table + SYS_NEIGHBOURS && copied != most; n++) {
        hal_lock_state lock = hal_lock_devices();
        neighbours[copied] = *n;
        hal_unlock(lock);
        copied = (uint8)(copied + (neighbours[copied].source != 0));
    }
    return copied;
}
