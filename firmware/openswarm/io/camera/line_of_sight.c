/* SPDX-License-Identifier: MIT */
/* 24 pixels vote by the nearest of four colours (openswarm-original.md §8, revision A). */
#include "line_of_sight.h"

enum { WIDTH = 20, PIXEL_BYTES = 2, COLUMNS = 4, ROWS = 6, VOTES = 2 };

static const uint8_t columns[COLUMNS] = {6, 9, 12, 15};
static const uint8_t rows[ROWS] = {4, 6, 8, 10, 12, 14};

static uint16_t distance(uint16_t a, uint16_t b)
{
    return a > b ? a - b : b - a;
}

/* Returns the nearest reference colour by the sum of absolute differences; the first of dark, green, red, white wins a
 * tie. Red and dark are objects. Only white's reference has blue, (100, 80, 80). */
static uint8_t classify(const uint8_t *pixel)
{
    uint16_t high = pixel[0], low = pixel[1];
    uint16_t red = high & 0xF8u;
    uint16_t green = (uint16_t)((high & 7u) << 5 | (low & 0xE0u) >> 3);
    uint16_t blue = (uint16_t)((low & 0x1Fu) << 3);
    uint16_t nearest = (uint16_t)(red + green + blue);
    uint8_t colour = SIGHT_RED; /* dark */
    uint16_t other = (uint16_t)(red + distance(green, 40) + blue);
    if (other < nearest) {
        nearest = other;
        colour = SIGHT_GREEN;
    }
    other = (uint16_t)(distance(red, 80) + green + blue);
    if (other < nearest) {
        nearest = other;
        colour = SIGHT_RED;
    }
    other = (uint16_t)(distance(red, 100) + distance(green, 80) + distance(blue, 80));
    return other < nearest ? SIGHT_WHITE : colour;
}

uint8_t line_of_sight(const uint8_t *frame)
{
    uint8_t red = 0, green = 0;
    for (uint8_t y = 0; y < ROWS; y++) {
        const uint8_t *row = frame + (uint16_t)(rows[y] * (WIDTH * PIXEL_BYTES));
        for (uint8_t x = 0; x < COLUMNS; x++) {
            uint8_t colour = classify(row + columns[x] * PIXEL_BYTES);
            if (colour == SIGHT_RED && ++red == VOTES) { /* a majority that the rest cannot outvote */
                return SIGHT_RED;
            }
            green += colour == SIGHT_GREEN;
        }
    }
    return green >= VOTES ? SIGHT_GREEN : SIGHT_WHITE;
}
