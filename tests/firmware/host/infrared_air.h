/* The air between robots, for tests of the infra-red link: the test is the lower layer, sees what is lit, and says
 * what the sensors read, scan by scan. */
#ifndef INFRARED_AIR_H
#define INFRARED_AIR_H

#include "test.h"

#include "../../../firmware/openswarm/io/infrared/infrared_parts.h"

enum { DARK = 3800, LONGEST = 1200, EARLY = 1000 };

extern unsigned int readings[HAL_INFRARED_SENSORS];
extern bool own_light;
extern uint16 fixed_number; /* of the robot, before it starts */

void scan_isr(void);
void scan_with(uint8 sensor, uint16 depth); /* one in which light takes so much from a sensor; 4,096 of them are a second */
void scans_in_the_dark(unsigned n);
void begin_link(void);

/* Collects the light of one frame by scans; returns their number. Omits proximity: three scans with dark before and
 * after. */
typedef struct {
    bool lit[LONGEST];
    unsigned length;
} recording;

void record(recording *r); /* the next frame that is sent */
void play(const recording *r, uint8 sensor, uint16 depth);
void say(const char *text, uint16 as, recording *r); /* record this message of a robot with this number */

#endif
