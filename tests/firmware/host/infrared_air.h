/* The simulated medium between robots, for tests of the infra-red link. The test replaces the hardware layer: it
 * observes the LED and supplies the readings of the sensors, scan by scan. */
#ifndef INFRARED_AIR_H
#define INFRARED_AIR_H

#include "test.h"

#include "../../../firmware/openswarm/io/infrared/infrared_parts.h"

enum { DARK = 3800, LONGEST = 1200, EARLY = 1000 };

extern unsigned int readings[HAL_INFRARED_SENSORS];
extern bool own_light;
extern uint16 fixed_number; /* the robot's number, set before it starts */

void scan_isr(void);
void scan_with(uint8 sensor, uint16 depth); /* one scan; light lowers the reading by depth; 4,096 scans/s */
void scans_in_the_dark(unsigned n);
void begin_link(void);

/* LED states of one frame, one per scan, and their number. A proximity measurement is no frame: it lights for three
 * scans, with dark scans before and after. */
typedef struct {
    bool lit[LONGEST];
    unsigned length;
} recording;

void record(recording *r); /* records the next frame that the robot sends */
void play(const recording *r, uint8 sensor, uint16 depth);
void say(const char *text, uint16 as, recording *r); /* records a message of the robot numbered `as` */

#endif
