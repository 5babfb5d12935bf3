/* Full bridge, encoder and converter of a motor board with a dsPIC30F4011. */
#ifndef BRIDGE_H
#define BRIDGE_H

#include <stdbool.h>
#include <stdint.h>

#define BRIDGE_PERIOD 1474u    /* Tcy of a PWM period: 20 kHz at 29.4912 MHz */
#define BRIDGE_DEAD_TIME 30u   /* Tcy between the switches of a leg: 1 us */
#define BRIDGE_FULL 1400       /* largest voltage, in half Tcy of duty cycle */
#define BRIDGE_CONTROL_RATE 16u /* PWM periods per call of bridge_control */

/* Samples that the converter takes in the middle of a PWM period, all in the same cycle; 10 bits each. */
typedef struct {
    uint16_t demand;  /* AN6: potentiometer */
    uint16_t current; /* AN0: shunt of the bridge */
    uint16_t supply;  /* AN1: divided supply */
} bridge_samples;

/* Starts PWM, encoder and converter with 0 V at the motor. */
void bridge_init(void);

/* Sets the voltage at the motor, -BRIDGE_FULL to BRIDGE_FULL; a value beyond is limited. */
void bridge_drive(int16_t voltage);

/* Returns the encoder's position in quarter lines; it wraps at 65536. */
uint16_t bridge_position(void);

/* Returns the samples of the last PWM period. */
bridge_samples bridge_measure(void);

/* Whether the fault input has switched the bridge off since the last call. */
bool bridge_take_fault(void);

/* Waits in Idle mode for the next interrupt. */
void bridge_wait(void);

/* The application's control step, called every BRIDGE_CONTROL_RATE PWM periods by an interrupt. */
void bridge_control(void);

#endif
