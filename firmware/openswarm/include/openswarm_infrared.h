/* SPDX-License-Identifier: MIT */
/* Messages between neighbours by infra-red light, and the table of neighbours. Linked where DEVICES names infrared.
 * Contract lines: openswarm.h. How it works: io/infrared/README.md.
 *
 *     SYS_ASSERT(Sys_Start_Infrared());             between Sys_Init_Kernel and Sys_Start_Kernel
 *     Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, on_message, NULL);
 *     Sys_Send_Event(SYS_SEND_NEIGHBOURS, "hello", 5);
 *
 * Every robot in sight receives a message: there are no addresses, no acknowledgements and no guaranteed delivery.
 * Received messages have passed a CRC of 16 bits. Proximity is measured meanwhile, as with analog.h, which cannot be
 * linked as well because both use the converter. Microphones and accelerometer are not sampled.
 *
 * This holds for the e-puck. A Kilobot has one receiver, which detects pulses. It has no bearing (sensor is 0), no
 * repair (corrected is 0), no proximity (SYS_IO_PROXIMITY is not registered) and no threshold
 * (Sys_Set_InfraredThreshold is not linked). All else applies; cycles and stack in the contract lines are the
 * e-puck's. Kilobots and e-pucks cannot exchange messages.
 */
#ifndef OPENSWARM_INFRARED_H
#define OPENSWARM_INFRARED_H

#include "openswarm.h"

#include "../io/analog/analog.h" /* SYS_IO_PROXIMITY, its processor, Sys_Get_Reflection, Sys_Get_AmbientLight */

#ifdef __cplusplus
extern "C" {
#endif

enum {
    SYS_NEIGHBOUR_MESSAGE = 0x18, /* [sys_neighbour_message] */
    SYS_NEIGHBOUR_SEEN = 0x19,    /* [sys_neighbour] heard for the first time, or again */
    SYS_NEIGHBOUR_LOST = 0x1A,    /* [sys_neighbour] not heard for its lifetime, or displaced from a full table */
    SYS_SEND_NEIGHBOURS = 0x1B,   /* [1 to SYS_MESSAGE_BYTES bytes] request to send, from any sender */
    SYS_MESSAGE_BYTES = 8
};

#ifndef SYS_NEIGHBOURS
#define SYS_NEIGHBOURS 10 /* entries of the neighbour table; 1 to 255 */
#endif
#ifndef SYS_INFRARED_QUEUE
#define SYS_INFRARED_QUEUE 4 /* frames waiting to be sent; 1 to 128 */
#endif
#define SYS_NEIGHBOUR_LIFETIME 7000 /* ms without a frame after which a neighbour is lost */
#define SYS_BEACON_PERIOD 2048      /* ms, up to a quarter more: a robot silent for this long sends an empty frame */

typedef struct {
    uint16 source;   /* the sender's number, 1 to 2047; also data->value */
    uint16 strength; /* counts by which its light lowered the sensor; larger is nearer. Kilobot: 0-899 counts of high
                      * gain; when nearer, 1024 plus the counts of low gain */
    uint8 sensor;    /* receiving sensor: 0-7, clockwise from the front */
    uint8 corrected; /* repaired bits */
    uint8 size;      /* bytes of payload */
    uint8 payload[SYS_MESSAGE_BYTES];
} sys_neighbour_message;

typedef struct {
    uint16 source;   /* also data->value */
    uint16 strength; /* strength of the last frame */
    uint16 heard;    /* time of the last frame: low word of the system time */
    uint8 sensor;
} sys_neighbour;

/* Receives each arrived message and may change it; false: no event. ISR context. The default accepts every message. */
typedef bool (*sys_message_processor)(sys_neighbour_message *message);
/* MTHI | no | 6 | 4 | none. */
sys_message_processor Sys_Set_MessageProcessor(sys_message_processor processor);

/* Receives each message before it is queued and may change up to SYS_MESSAGE_BYTES bytes and their number; false:
 * refused. Context of the sender. The default accepts every message. */
typedef bool (*sys_sending_processor)(uint8 *payload, uint8 *size);
/* MTHI | no | 6 | 4 | none. */
sys_sending_processor Sys_Set_SendingProcessor(sys_sending_processor processor);

/* Receives each message one scan (244 us) before its first bit is sent, however long it waited. It may change the
 * bytes, not their number, for example to add the time of sending. ISR context. The default changes nothing. */
typedef void (*sys_leaving_processor)(uint8 *payload, uint8 size);
/* MTHI | no | 6 | 4 | none. */
sys_leaving_processor Sys_Set_LeavingProcessor(sys_leaving_processor processor);

/* M | no | - | 38 | MEMORY.  Between Sys_Init_Kernel and Sys_Start_Kernel. */
bool Sys_Start_Infrared(void);

/* MTHI | no | 126 | 30 | ARGUMENT, BUSY.  Queues a message of 1 to SYS_MESSAGE_BYTES bytes. BUSY: the queue is full. */
bool Sys_Send_Neighbours(const void *payload, uint16 size);

/* MTHI | no | 321 | 12 | none.  Copies up to most neighbours, in no particular order; returns their number. */
uint8 Sys_Get_Neighbours(sys_neighbour *neighbours, uint8 most);

/* MTHI | no | 4 | 4 | none.  This robot's number: the data EEPROM's last word (Kilobot: its UID) if that is 1 to
 * 2047. Otherwise it is drawn at random a quarter of a second after the start, and again if a frame of another robot
 * has it. 0: not drawn yet. */
uint16 Sys_Get_RobotNumber(void);
/* MTHI | no | 32 | 14 | ARGUMENT.  Sets the number, 1 to 2047. It is kept even if another robot has it; before
 * Sys_Start_Infrared it replaces that of the EEPROM. */
bool Sys_Set_RobotNumber(uint16 number);

/* MTHI | no | 45 | 14 | ARGUMENT.  Sets the minimum counts (1 to 100, initially 4) by which light must lower a
 * sensor. */
bool Sys_Set_InfraredThreshold(uint8 counts);

/* MTHI | no | 141 | 4 | none.  Distance in mm, 70 to 600, between the centres of two robots that face each other,
 * from a strength, by the amplitudes that libIrcom's authors measured (swarmcom.md 3.1). Sensors at an angle give
 * larger values. Kilobot: 33 to 98 by the calibration tables in its EEPROM, 0 without them; slow, because it reads
 * the EEPROM. */
uint16 Sys_Estimate_Range(uint16 strength);

typedef struct {
    uint16 sent;        /* frames, including beacons */
    uint16 received;    /* frames with a correct CRC */
    uint16 damaged;     /* frames begun and not received correctly */
    uint16 false_starts; /* light too short for a frame, such as other robots' proximity */
    uint16 adaptations; /* lasting light, taken as the background; 0 on a Kilobot */
    uint16 refused;     /* messages refused because the queue was full */
    uint16 conflicts;   /* frames of another robot with this robot's number */
} sys_infrared_statistics; /* counters saturate */
/* MTHI | no | 4 | 4 | none. */
const sys_infrared_statistics *Sys_Get_InfraredStatistics(void);

#ifdef __cplusplus
}
#endif

#endif
