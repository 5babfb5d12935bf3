/* Library for programs of a Kilobot, with the names and the messages of the published kilolib.
 *
 * A program defines setup and loop, and calls kilo_init and kilo_start. Facts: docs/reference/kilobot.md. */
#ifndef KILOLIB_H
#define KILOLIB_H

#include <stdint.h>

/* A message on air: 9 bytes of data, a type below 0x80 for programs, and the CRC that message_crc gives. */
typedef struct {
    uint8_t data[9];
    uint8_t type;
    uint16_t crc;
} message_t;

/* Strength of a received message, in counts of the converter (0 to 1023) at both gains. */
typedef struct {
    int16_t low_gain;
    int16_t high_gain;
} distance_measurement_t;

typedef message_t *(*message_tx_t)(void);
typedef void (*message_tx_success_t)(void);
typedef void (*message_rx_t)(message_t *, distance_measurement_t *);

enum { NORMAL = 0, GPS = 1 };

extern volatile uint32_t kilo_ticks; /* ticks of 32.768 ms since power-on, 30.5 a second */
extern uint16_t kilo_tx_period;      /* a message is sent each time the ticks times 255 exceed it: 3906 is 0.524 s */
extern uint16_t kilo_uid;            /* the robot's number in its EEPROM */
extern uint8_t kilo_turn_left, kilo_turn_right, kilo_straight_left, kilo_straight_right; /* calibrated duties */

extern message_tx_t kilo_message_tx;                 /* returns the message to send, or NULL */
extern message_tx_success_t kilo_message_tx_success; /* called when it is sent; in an interrupt */
extern message_rx_t kilo_message_rx;                 /* called for each message received; in an interrupt */

void kilo_init(void);                                    /* first call of main */
void kilo_start(void (*setup)(void), void (*loop)(void)); /* never returns */
uint16_t message_crc(const message_t *m);
uint8_t estimate_distance(const distance_measurement_t *d); /* mm between the centres, 33 to 255 */

/* Duties of the vibration motors, 0 to 255. A stopped motor needs 15 ms of spinup_motors first. */
void set_motors(uint8_t left, uint8_t right);
void spinup_motors(void);

#define RGB(red, green, blue) (((red) & 3) | (((green) & 3) << 2) | (((blue) & 3) << 4))
void set_color(uint8_t rgb);

void delay(uint16_t ms);
uint8_t rand_soft(void); /* pseudo-random, from a shift register */
void rand_seed(uint8_t seed);
uint8_t rand_hard(void);         /* from the noise of the battery's voltage; takes some ms */
int16_t get_ambientlight(void);  /* counts, or -1 while a message is received */
int16_t get_voltage(void);       /* counts of the battery, or -1 */

#endif
