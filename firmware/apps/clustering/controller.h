/* The two controllers for object clustering (epuck.md §8): wheel speeds by what the line-of-sight sensor sees. Shared with
 * clustering-bare. */
#ifndef CONTROLLER_H
#define CONTROLLER_H

#include <stdint.h>

typedef struct {
    uint8_t left, right; /* mm/s */
} wheel_speeds;

typedef struct {
    wheel_speeds nothing, object, robot;
} clustering_controller;

/* Percent of the maximum, 129 mm/s. */
#define SPEEDS(left_percent, right_percent) \
    {                                       \
        (left_percent)*129 / 100, (right_percent)*129 / 100 \
    }
#define CONTROLLER_A {SPEEDS(50, 100), SPEEDS(100, 50), SPEEDS(10, 50)} /* the published table, as recalled */
#define CONTROLLER_B {SPEEDS(55, 99), SPEEDS(98, 50), SPEEDS(89, 53)}   /* the original firmware */

/* RC-5 commands of the remote control (openswarm-original.md §5.6). */
enum { KEY_STANDBY = 12, KEY_SLEEP = 42, KEY_OK = 53 };

/* Selector positions: bit 0 chooses B, bit 3 starts without waiting for the remote control. */
enum { SELECT_B = 1, SELECT_START = 8 };
#ifndef CLUSTERING_START_AT_ONCE
#define CLUSTERING_START_AT_ONCE 0
#endif

#endif
