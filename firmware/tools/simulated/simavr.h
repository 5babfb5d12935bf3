/* A paused ATmega328P: interface shared by simavr.c and air.c. */
#ifndef SIMAVR_H
#define SIMAVR_H

#include <sim_avr.h>
#include <stdint.h>

enum { UART_ROOM = 1 << 20, RUNS_ON = 0, DONE = 1, CRASHED = 2, AT_PLACE = 3 };

typedef struct {
    avr_t *avr;
    uint64_t instructions;
    uint32_t written;
    uint16_t lowest_sp, watch_from, watch_to;
    uint8_t uart[UART_ROOM];
} machine;

int machine_step(machine *m); /* executes one instruction, or sleeps; returns RUNS_ON, DONE or CRASHED */

#endif
