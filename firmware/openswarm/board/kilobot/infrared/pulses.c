/* SPDX-License-Identifier: MIT */
/* The Kilobot's infrared hardware, with the pins and channels of kilolib (board/kilobot/README.md): emitters on port B,
 * the receiver at the analog comparator, its strength at ADC0 (high gain) and ADC1 (low gain).
 *
 * The comparator also drives T1's input capture, which kilolib does not use: it dates each pulse however busy the CPU
 * is. */
#include "pulses.h"
#include "infrared_parts.h"

#include <avr/eeprom.h>
#include <avr/io.h>

enum {
    EMITTERS_ALLOWED = 0xC7,
    EMITTER_DEFAULT = 1 << PB0,
    SENSOR_SUPPLY_D = 1 << PD2,
    RECEIVER_D = 3,                         /* digital inputs of PD6 and PD7 off */
    CLOCK_OF_ADC = 1 << ADPS1 | 1 << ADPS0, /* 1 MHz */
    CHANNEL_HIGH_GAIN = 0,
    CHANNEL_LOW_GAIN = 1,
    CHANNEL_BATTERY = 6,
    NOISY_CONVERSIONS = 32
};
#define EMITTERS ((const uint8 *)0x90) /* EEPROM: kilolib's TX mask */
#define NUMBER ((const uint16 *)0xB0)  /* its UID */

static uint8 emitters;
static uint16 noise;

static uint16 convert(uint8 channel)
{
    ADMUX = channel;
    ADCSRA = 1 << ADEN | 1 << ADSC | CLOCK_OF_ADC;
    while (ADCSRA & 1 << ADSC) {
    }
    return ADC;
}

void pulses_prepare(uint16 first_alarm)
{
    emitters = eeprom_read_byte(EMITTERS);
    if (emitters == 0 || (emitters & (uint8)~EMITTERS_ALLOWED) != 0) {
        emitters = EMITTER_DEFAULT;
    }
    PORTB &= (uint8)~emitters;
    DDRD |= SENSOR_SUPPLY_D;
    PORTD |= SENSOR_SUPPLY_D;
    DIDR1 = RECEIVER_D;
    for (uint8 i = 0; i < NOISY_CONVERSIONS; i++) { /* kilolib, too, takes its random bits from the battery's voltage */
        noise = (uint16)((noise << 1 | noise >> 15) ^ convert(CHANNEL_BATTERY));
    }
    pulses_gain(true);
    ADCSRB = 1 << ADTS2 | 1 << ADTS1 | 1 << ADTS0; /* a capture starts a conversion; its handler clears the flag */
    ADCSRA = 1 << ADEN | 1 << ADATE | CLOCK_OF_ADC;
    OCR1A = first_alarm; /* T1 is 0 until the kernel starts it */
    TIMSK1 |= 1 << OCIE1A;
}

void pulses_listen(void)
{
    ACSR = 1 << ACIC;
    TCCR1B |= 1 << ICES1;
    TIMSK1 |= 1 << ICIE1;
}

uint16 pulses_noise(void)
{
    return noise;
}

uint16 pulses_now(void)
{
    return TCNT1;
}

uint16 pulses_seen(void)
{
    uint16 at = ICR1, again; /* the chip latches the high byte with the low one; simavr does not */
    while ((again = ICR1) != at) {
        at = again;
    }
    return at;
}

void pulses_alarm(uint16 counts)
{
    OCR1A = (uint16)(TCNT1 + counts);
}

void pulses_alarm_again(uint16 counts)
{
    uint16 at = (uint16)(OCR1A + counts);
    OCR1A = at;
    if ((sint16)(TCNT1 - at) >= 0) { /* it is over already */
        pulses_alarm(counts);
    }
}

void pulses_emitter(bool is_output)
{
    if (is_output) {
        DDRB |= emitters;
    } else {
        DDRB &= (uint8)~emitters;
    }
}

void pulses_flash(void)
{
    uint8 dark = PORTB;
    PORTB = dark | emitters;
    __builtin_avr_delay_cycles(8); /* with the store 9 cycles of light, as in kilolib */
    PORTB = dark;
}

void pulses_gain(bool is_high)
{
    ADMUX = is_high ? CHANNEL_HIGH_GAIN : CHANNEL_LOW_GAIN;
}

uint16 pulses_strength(void)
{
    return ADC;
}

uint16_t hal_infrared_number(void)
{
    uint16 number = eeprom_read_word(NUMBER);
    return number <= NUMBER_MASK ? number : 0;
}
