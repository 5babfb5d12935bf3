/* SPDX-License-Identifier: MIT */
/* Vibration motors of the Kilobot: T2, phase-correct PWM with prescaler 8 on OC2A and OC2B, as kilolib drives them.
 *
 * A Kilobot slides and measures no speed. The duty at which it goes straight is calibrated for each robot and kept in
 * EEPROM. The speed FULL_MM_S selects that duty, a lower speed proportionally less, UNVERIFIED on a robot: the paper's
 * controllers then turn and go in the right direction. It cannot drive backwards. A motor that starts gets SPIN_UP_MS
 * of full duty against static friction (kilolib: 15 ms; never longer than 50). */
#include "io.h"
#include "pins.h"

#include <avr/eeprom.h>
#include <avr/io.h>

enum { FULL_MM_S = SYS_MAXIMUM_SPEED, LONGEST_DUTY = 90, SPIN_UP_MS = 15, FULL_DUTY = 255 };
#define CALIBRATED_LEFT ((const uint8 *)0x0C)  /* EEPROM: kilo_straight_left */
#define CALIBRATED_RIGHT ((const uint8 *)0x14) /* kilo_straight_right */

typedef struct {
    uint8 duty, straight;
    volatile uint8 spin_up_ms;
} motor;

static motor left, right;

static uint8 calibrated(const uint8 *address)
{
    uint8 duty = eeprom_read_byte(address);
    return duty <= LONGEST_DUTY ? duty : LONGEST_DUTY; /* an erased byte reads 255 */
}

void hal_motors_init(void)
{
    left.straight = calibrated(CALIBRATED_LEFT);
    right.straight = calibrated(CALIBRATED_RIGHT);
    PORTB &= (uint8)~PIN_MOTOR_B;
    PORTD &= (uint8)~PIN_MOTOR_D;
    DDRB |= PIN_MOTOR_B;
    DDRD |= PIN_MOTOR_D;
}

/* Devices locked. Returns the new value of the compare register. */
static uint8 set(motor *m, int16_t mm_s)
{
    uint8 duty = mm_s > 0 ? (uint8)((uint16)mm_s * m->straight / FULL_MM_S) : 0;
    if (duty != 0 && m->duty == 0) {
        m->spin_up_ms = SPIN_UP_MS;
    } else if (duty == 0) {
        m->spin_up_ms = 0;
    }
    m->duty = duty;
    return m->spin_up_ms != 0 ? FULL_DUTY : duty;
}

/* kilolib's set_motors(first, second): header and source disagree; as in the header, the first is left here. */
void hal_motors_drive(int16_t left_mm_s, int16_t right_mm_s)
{
    uint8 before = SREG;
    __asm__ volatile("cli" ::: "memory");
    OCR2A = set(&left, left_mm_s);
    OCR2B = set(&right, right_mm_s);
    bool turns = (left.duty | right.duty) != 0; /* otherwise the timer is off, and its pins are low ports */
    TCCR2A = turns ? 1 << COM2A1 | 1 << COM2B1 | 1 << WGM20 : 0;
    TCCR2B = turns ? 1 << CS21 : 0;
    SREG = before;
}

void kilobot_motors_tick(void)
{
    if (left.spin_up_ms != 0 && --left.spin_up_ms == 0) {
        OCR2A = left.duty;
    }
    if (right.spin_up_ms != 0 && --right.spin_up_ms == 0) {
        OCR2B = right.duty;
    }
}
