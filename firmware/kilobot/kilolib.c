/* kilolib.h on the ATmega328P at 8 MHz: pulses of light, motors, LED and the commands of the overhead controller.
 *
 * Timer 1 is the clock of the bits. It runs from the first pulse of a frame to the last one, sent or received. */
#include "kilolib.h"

#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <stddef.h>
#include <string.h>
#include <util/crc16.h>
#include <util/delay.h>

enum {
    SLOT = 270,
    PER_CYCLE = 243, /* 65,536 / SLOT */
    LATENCY = 40,    /* cycles from a pulse until its handler reads the timer */
    HALF_SLOT = 134,
    STOP_SLOT = 9,
    LEADER = 2420,           /* cycles from the first pulse to the pulse that ends byte 0, in which no other pulse is */
    BYTE_AFTER_LEADER = 286, /* cycles from a stop pulse to the next start pulse */
    BYTE_AFTER_BYTE = 282,
    GIVE_UP = 2959, /* cycles without a pulse after a start pulse: the frame is lost */
    SETTLE = 540,   /* cycles, two slots, for which a sender ignores pulses after its own first one */
    FRAME = 12
};
enum { BOOT = 0x80, RESET = 0x83, SLEEP = 0x84, WAKEUP = 0x85, VOLTAGE = 0x87, RUN = 0x88, READUID = 0x89 };
enum { HIGH_GAIN = 0, LOW_GAIN = 1, BATTERY = 6, AMBIENT = 7 };
enum { EE_TURN_LEFT = 0x05, EE_TURN_RIGHT = 0x09, EE_LEFT = 0x0C, EE_RIGHT = 0x14, EE_LOW = 0x20, EE_HIGH = 0x50,
       EE_EMITTERS = 0x90, EE_UID = 0xB0, TABLE = 14, FIRST_MM = 33, STEP_MM = 5, FARTHEST_MM = 123 };
enum { LEFT_B = 1 << 3, RIGHT_D = 1 << 3, POWER_D = 1 << 2, EMITTERS_ALLOWED = 0xC7, RETRY = 255, TICK = 255 };
enum { IDLE, SETUP, RUNNING, SLEEPING, SHOW_VOLTAGE, SHOW_UID };

volatile uint32_t kilo_ticks;
uint16_t kilo_tx_period = 3906;
uint16_t kilo_uid;
uint8_t kilo_turn_left, kilo_turn_right, kilo_straight_left, kilo_straight_right;
message_tx_t kilo_message_tx;
message_tx_success_t kilo_message_tx_success;
message_rx_t kilo_message_rx;

static volatile uint8_t state = IDLE, receiving, uid_bit;
static uint8_t emitters, frame[FRAME], octet, random = 0xAA;
static int8_t place; /* index of the next byte in the frame; -1: byte 0 */
static uint16_t began, tx_clock;
static distance_measurement_t strength;

/* -- converter ---------------------------------------------------------------------------------------------------- */

static void by_comparator(uint8_t channel)
{
    ADMUX = channel;
    ADCSRB = 1 << ADTS0;
    ADCSRA = 1 << ADEN | 1 << ADATE | 1 << ADIF | 1 << ADPS1 | 1 << ADPS0;
}

static int16_t convert(uint8_t channel)
{
    int16_t counts = -1;
    cli();
    if (!receiving) {
        ADMUX = channel;
        ADCSRA = 1 << ADEN | 1 << ADSC | 1 << ADPS1 | 1 << ADPS0;
        while (ADCSRA & 1 << ADSC) {
        }
        counts = (int16_t)ADC;
        by_comparator(HIGH_GAIN);
    }
    sei();
    return counts;
}

/* Returns the result of the conversion that a pulse has started; waits until it is over. */
static int16_t converted(void)
{
    for (uint8_t tries = 0; tries < 40 && !(ADCSRA & 1 << ADIF); tries++) {
    }
    return (int16_t)ADC;
}

int16_t get_ambientlight(void)
{
    return convert(AMBIENT);
}

int16_t get_voltage(void)
{
    return convert(BATTERY);
}

/* -- sending ------------------------------------------------------------------------------------------------------ */

static void wait_for(uint16_t at)
{
    while ((int16_t)(TCNT1 - at) < 0) {
    }
}

static void pulse(uint16_t at)
{
    wait_for(at);
    uint8_t dark = PORTB;
    PORTB = dark | emitters;
    __builtin_avr_delay_cycles(8); /* 9 cycles of light with the store */
    PORTB = dark;
}

static void send_byte(uint16_t at, uint8_t byte)
{
    pulse(at);
    for (uint8_t bit = 0; bit < 8; bit++, byte >>= 1) {
        at += SLOT;
        if (byte & 1) {
            pulse(at);
        }
    }
    pulse(at + SLOT);
}

/* Sends a message; interrupts are off. Returns 0 if another robot is sending. */
static uint8_t send(const message_t *m)
{
    const uint8_t *bytes = (const uint8_t *)m;
    TCCR1B = 1 << CS10;
    TCNT1 = 0;
    DDRB |= emitters;
    uint16_t at = 40;
    pulse(at);
    wait_for(at + SETTLE);
    while ((int16_t)(TCNT1 - (at + LEADER - 60)) < 0) {
        if (ACSR & 1 << ACO) {
            return 0;
        }
    }
    at += LEADER;
    pulse(at);
    at += BYTE_AFTER_LEADER;
    for (uint8_t n = 0; n < FRAME; n++) {
        send_byte(at, bytes[n]);
        at += STOP_SLOT * SLOT + BYTE_AFTER_BYTE;
    }
    return 1;
}

ISR(TIMER0_COMPA_vect)
{
    tx_clock += TICK;
    kilo_ticks++;
    OCR0A = 0;
    if (receiving || state != RUNNING || tx_clock <= kilo_tx_period || kilo_message_tx == NULL) {
        return;
    }
    const message_t *m = kilo_message_tx();
    if (m == NULL) {
        return;
    }
    uint8_t is_sent = send(m);
    TCCR1B = 0;
    ACSR |= 1 << ACI; /* its own light */
    by_comparator(HIGH_GAIN);
    if (!is_sent) {
        OCR0A = (uint8_t)(TCNT0 + (rand_soft() & RETRY)); /* some ms later */
        return;
    }
    tx_clock = 0;
    if (kilo_message_tx_success != NULL) {
        kilo_message_tx_success();
    }
}

/* -- receiving ---------------------------------------------------------------------------------------------------- */

static void listen(void)
{
    receiving = 0;
    TCCR1B = 0;
    TIMSK1 = 0;
    by_comparator(HIGH_GAIN);
}

ISR(TIMER1_COMPA_vect)
{
    listen();
}

static void obey(void)
{
    switch (frame[9]) {
    case BOOT:
        cli();
        ((void (*)(void))(0x7000 / 2))();
        break;
    case RESET:
        wdt_enable(WDTO_15MS);
        for (;;) {
        }
    case SLEEP:
        state = SLEEPING;
        break;
    case WAKEUP:
        state = IDLE;
        break;
    case VOLTAGE:
        state = SHOW_VOLTAGE;
        break;
    case RUN:
        if (state != RUNNING) {
            state = SETUP;
        }
        return;
    case READUID:
        uid_bit = frame[0];
        state = SHOW_UID;
        return;
    default:
        return;
    }
    set_motors(0, 0);
}

static void take_frame(void)
{
    message_t m;
    memcpy(&m, frame, sizeof m);
    listen();
    if (message_crc(&m) != m.crc) {
        return;
    }
    if (m.type >= BOOT) {
        obey();
    } else if (state == RUNNING && kilo_message_rx != NULL) {
        kilo_message_rx(&m, &strength);
    }
}

ISR(ANALOG_COMP_vect)
{
    uint16_t now = TCNT1;
    if (!receiving) {
        TCNT1 = LATENCY;
        TCCR1B = 1 << CS10;
        receiving = 1, place = -1, octet = 0, began = 0;
        OCR1A = GIVE_UP;
        TIFR1 = 1 << OCF1A;
        TIMSK1 = 1 << OCIE1A;
        ADCSRA |= 1 << ADIF; /* clears the flag of an earlier conversion; that of this pulse is not over yet */
        strength.high_gain = converted();
        by_comparator(LOW_GAIN);
        return;
    }
    uint8_t slot = (uint8_t)((uint32_t)(uint16_t)(now - LATENCY - began + HALF_SLOT) * PER_CYCLE >> 16);
    if (slot < STOP_SLOT) {
        if (place < 0 || slot == 0) {
            listen(); /* light in byte 0, which is dark: two robots have begun to send */
        } else {
            octet |= (uint8_t)(1 << (slot - 1));
        }
    } else if (slot > STOP_SLOT) {
        began = now - LATENCY, octet = 0;
        OCR1A = began + GIVE_UP;
    } else {
        if (place < 0) {
            strength.low_gain = converted();
        } else {
            frame[place] = octet;
        }
        if (++place == FRAME) {
            take_frame();
        }
    }
}

uint16_t message_crc(const message_t *m)
{
    uint16_t crc = 0xFFFF;
    for (uint8_t n = 0; n < 10; n++) {
        crc = _crc_ccitt_update(crc, ((const uint8_t *)m)[n]);
    }
    return crc;
}

/* -- distance ----------------------------------------------------------------------------------------------------- */

static int16_t table(uint16_t start, uint8_t n)
{
    uint8_t *at = (uint8_t *)(start + 2 * n);
    return (int16_t)(eeprom_read_byte(at) << 8 | eeprom_read_byte(at + 1));
}

/* Returns the mm by which the distance exceeds that of a falling table's first entry: interpolated, or extrapolated. */
static int16_t in_table(uint16_t start, int16_t counts)
{
    uint8_t n = 1;
    while (n < TABLE - 1 && table(start, n) > counts) {
        n++;
    }
    int16_t before = table(start, n - 1), after = table(start, n);
    if (before <= after) {
        return STEP_MM * n;
    }
    return STEP_MM * (n - 1) + (int16_t)((int32_t)STEP_MM * (before - counts) / (before - after));
}

uint8_t estimate_distance(const distance_measurement_t *d)
{
    int16_t mm;
    if (d->high_gain < 900) {
        mm = in_table(EE_HIGH, d->high_gain);
    } else {
        mm = d->low_gain > table(EE_LOW, 0) ? 0 : in_table(EE_LOW, d->low_gain);
    }
    mm += FIRST_MM;
    return mm < FIRST_MM ? FIRST_MM : mm > FARTHEST_MM ? FARTHEST_MM : (uint8_t)mm;
}

/* -- motors, LED, time, random numbers ---------------------------------------------------------------------------- */

void set_motors(uint8_t left, uint8_t right)
{
    OCR2A = left;
    OCR2B = right;
}

void spinup_motors(void)
{
    set_motors(255, 255);
    delay(15);
}

void set_color(uint8_t rgb)
{
    uint8_t d = DDRD & ~(1 << 5 | 1 << 4), c = DDRC & ~0x3C;
    d |= (rgb & 1 ? 1 << 5 : 0) | (rgb & 2 ? 1 << 4 : 0);
    c |= (rgb & 4 ? 1 << 3 : 0) | (rgb & 8 ? 1 << 2 : 0) | (rgb & 16 ? 1 << 5 : 0) | (rgb & 32 ? 1 << 4 : 0);
    DDRD = d;
    DDRC = c;
}

void delay(uint16_t ms)
{
    while (ms-- != 0) {
        _delay_ms(1);
    }
}

uint8_t rand_soft(void)
{
    uint8_t low = random & 1;
    random >>= 1;
    if (low) {
        random ^= 0xB8;
    }
    return random;
}

void rand_seed(uint8_t seed)
{
    random = seed ? seed : 1;
}

uint8_t rand_hard(void)
{
    uint8_t found = 0;
    for (uint8_t bit = 0; bit < 8; bit++) {
        for (uint8_t tries = 0; tries < 128; tries++) { /* of two different bits the first is unbiased (von Neumann) */
            uint8_t one = get_voltage() & 1, two = get_voltage() & 1;
            if (one != two) {
                found |= (uint8_t)(one << bit);
                break;
            }
        }
    }
    return found;
}

/* -- states ------------------------------------------------------------------------------------------------------- */

void kilo_init(void)
{
    cli();
    MCUSR = 0;
    wdt_disable();
    PORTB = 0, PORTC = 0, PORTD = POWER_D;
    DDRC = 0, DDRD = POWER_D | RIGHT_D;
    emitters = eeprom_read_byte((uint8_t *)EE_EMITTERS);
    if (emitters == 0 || emitters & (uint8_t)~EMITTERS_ALLOWED) {
        emitters = 1;
    }
    DDRB = emitters | LEFT_B;
    kilo_uid = eeprom_read_word((uint16_t *)EE_UID);
    kilo_turn_left = eeprom_read_byte((uint8_t *)EE_TURN_LEFT);
    kilo_turn_right = eeprom_read_byte((uint8_t *)EE_TURN_RIGHT);
    kilo_straight_left = eeprom_read_byte((uint8_t *)EE_LEFT);
    kilo_straight_right = eeprom_read_byte((uint8_t *)EE_RIGHT);
    TCCR0A = 0, TCCR0B = 1 << CS02 | 1 << CS00, TIMSK0 = 1 << OCIE0A;
    TCCR1A = 0, TCCR1B = 0;
    TCCR2A = 1 << COM2A1 | 1 << COM2B1 | 1 << WGM20, TCCR2B = 1 << CS21;
    set_motors(0, 0);
    DIDR1 = 1 << AIN1D | 1 << AIN0D;
    ACSR = 1 << ACI | 1 << ACIE | 1 << ACIS1 | 1 << ACIS0;
    by_comparator(HIGH_GAIN);
    sei();
}

EMPTY_INTERRUPT(WDT_vect)

/* Sleeps for eight seconds in power-down mode, then listens for 12 ms. */
static void doze(void)
{
    set_color(0);
    PORTD &= (uint8_t)~POWER_D;
    wdt_reset();
    cli();
    WDTCSR = 1 << WDCE | 1 << WDE;
    WDTCSR = 1 << WDIE | 1 << WDP3 | 1 << WDP0;
    set_sleep_mode(SLEEP_MODE_PWR_DOWN);
    sleep_enable();
    sei();
    sleep_cpu();
    sleep_disable();
    wdt_disable();
    PORTD |= POWER_D;
    delay(12); /* the controller repeats its message every 10.4 ms */
    while (receiving) {
    }
}

static void show_voltage(void)
{
    int16_t counts = get_voltage();
    set_color(counts > 682 ? RGB(0, 1, 0) : counts > 648 ? RGB(0, 0, 1) : counts > 614 ? RGB(1, 1, 0) : RGB(1, 0, 0));
}

static void blink(uint8_t rgb)
{
    set_color(rgb);
    delay(1);
    set_color(0);
    delay(200);
}

void kilo_start(void (*setup)(void), void (*loop)(void))
{
    for (;;) {
        switch (state) {
        case SETUP:
            setup();
            state = RUNNING;
            break;
        case RUNNING:
            loop();
            break;
        case SLEEPING:
            doze();
            break;
        case SHOW_VOLTAGE:
            show_voltage();
            break;
        case SHOW_UID:
            set_motors(uid_bit < 16 && kilo_uid >> uid_bit & 1 ? kilo_turn_left : 0, 0);
            break;
        default:
            blink(RGB(0, 1, 0));
        }
    }
}
