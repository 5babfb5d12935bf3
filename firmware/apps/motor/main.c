/* Speed control of a DC motor with an encoder, without a kernel (README.md). */
#include <stdbool.h>
#include <stdint.h>

#include "bridge.h"
#include "serial.h"

#define REPORT_STEPS 125u   /* control steps between two reports: 0.1 s */
#define CURRENT_LIMIT 900u  /* of 1023 */
#define PROPORTIONAL 24     /* half Tcy of duty cycle per quarter line and step */
#define INTEGRAL 3
#define DEMAND_SHIFT 5      /* the potentiometer selects 0 to 31 quarter lines per step */

static volatile int16_t speed;
static volatile bool limited;
static volatile uint8_t reports;

void bridge_control(void)
{
    static uint16_t last;
    static int16_t sum;
    static uint8_t steps;
    uint16_t position = bridge_position();
    bridge_samples now = bridge_measure();
    speed = (int16_t)(position - last);
    last = position;
    limited = now.current > CURRENT_LIMIT;
    int16_t error = (int16_t)(now.demand >> DEMAND_SHIFT) - speed;
    if (limited) {
        sum = 0;
    } else if (sum + error > -BRIDGE_FULL / INTEGRAL && sum + error < BRIDGE_FULL / INTEGRAL) {
        sum += error;
    }
    bridge_drive(limited ? 0 : error * PROPORTIONAL + sum * INTEGRAL);
    if (++steps == REPORT_STEPS) {
        steps = 0;
        reports++;
    }
}

int main(void)
{
    serial_init();
    serial_text("motor\n");
    bridge_init();
    uint8_t done = 0;
    for (;;) {
        if (done != reports) {
            done = reports;
            serial_text("speed ");
            serial_number(speed);
            serial_text(limited ? " current limit\n" : "\n");
        }
        if (bridge_take_fault()) {
            serial_text("fault\n");
        }
        bridge_wait();
    }
}
