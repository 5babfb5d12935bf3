/* SPDX-License-Identifier: MIT */
/* Messages between neighbours by infra-red light, and who they are; linked where DEVICES names infrared. Contract lines:
 * openswarm.h; io/infrared/README.md tells how it works.
 *
 *     SYS_ASSERT(Sys_Start_Infrared());             between Sys_Init_Kernel and Sys_Start_Kernel
 *     Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, on_message, NULL);
 *     Sys_Send_Event(SYS_SEND_NEIGHBOURS, "hello", 5);
 *
 * Everybody in sight hears a message: there are no addresses, no acknowledgement and no promise that it arrives. What does
 * arrive has passed a CRC of 16 bits. Proximity goes on meanwhile, as with analog.h, which is not linked beside this one: they
 * share the converter. Microphones and accelerometer are not sampled.
 *
 * That is the e-puck. A Kilobot has one receiver, which sees pulses: there is no bearing (sensor is 0), no repair (corrected is
 * 0), no proximity (SYS_IO_PROXIMITY is not registered) and no threshold (Sys_Set_InfraredThreshold is not linked). All else
 * holds; cycles and stack of the contract lines are the e-puck's. Kilobots and e-pucks do not understand each other.
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
    SYS_SEND_NEIGHBOURS = 0x1B,   /* [1 to SYS_MESSAGE_BYTES bytes] request, by anyone */
    SYS_MESSAGE_BYTES = 8
};

#ifndef SYS_NEIGHBOURS
#define SYS_NEIGHBOURS 10 /* that are remembered; 1 to 255 */
#endif
#ifndef SYS_INFRARED_QUEUE
#define SYS_INFRARED_QUEUE 4 /* frames that wait to be sent; 1 to 128 */
#endif
#define SYS_NEIGHBOUR_LIFETIME 7000 /* ms without a word after which a neighbour is lost */
#define SYS_BEACON_PERIOD 2048      /* ms; who has sent nothing for so long, and up to a quarter more, sends an empty frame */

typedef struct {
    uint16 source;   /* the sender's number, 1 to 2047; also data->value */
    uint16 strength; /* counts by which its light lowered the sensor; larger is nearer. Kilobot: 0-899 counts of high gain,
                      * nearer 1024 and more: 1024 and the counts of low gain */
    uint8 sensor;    /* 0-7, clockwise from the front: where it came from */
    uint8 corrected; /* bits that were repaired */
    uint8 size;      /* of payload */
    uint8 payload[SYS_MESSAGE_BYTES];
} sys_neighbour_message;

typedef struct {
    uint16 source;   /* also data->value */
    uint16 strength; /* of the last frame */
    uint16 heard;    /* low word of the system time */
    uint8 sensor;
} sys_neighbour;

/* Sees each message that has arrived; may change it; false: no event. ISR context. The default passes every one on. */
typedef bool (*sys_message_processor)(sys_neighbour_message *message);
sys_message_processor Sys_Set_MessageProcessor(sys_message_processor processor); /* MTHI */

/* Sees each message before it is queued; may change up to SYS_MESSAGE_BYTES bytes and their number; false: refused. Context of
 * the sender. The default passes every one on. */
typedef bool (*sys_sending_processor)(uint8 *payload, uint8 *size);
sys_sending_processor Sys_Set_SendingProcessor(sys_sending_processor processor); /* MTHI */

/* Sees each message when its turn has come, a scan (244 us) before its first light, however long it waited; may change its bytes, not
 * their number: so it can say when it left. ISR context. The default leaves every one as it is. */
typedef void (*sys_leaving_processor)(uint8 *payload, uint8 size);
sys_leaving_processor Sys_Set_LeavingProcessor(sys_leaving_processor processor); /* MTHI */

/* M | no | - | 38 | MEMORY.  Between Sys_Init_Kernel and Sys_Start_Kernel. */
bool Sys_Start_Infrared(void);

/* MTHI | no | 126 | 30 | ARGUMENT, BUSY.  Queues a message of 1 to SYS_MESSAGE_BYTES bytes. BUSY: SYS_INFRARED_QUEUE wait. */
bool Sys_Send_Neighbours(const void *payload, uint16 size);

/* MTHI | no | 321 | 12 | none.  Copies up to most neighbours, in no order; how many. */
uint8 Sys_Get_Neighbours(sys_neighbour *neighbours, uint8 most);

/* MTHI | no | 4 | 4 | none.  The own number: of the data EEPROM's last word (Kilobot: its UID) if that holds 1 to 2047; otherwise
 * drawn at random a quarter of a second after the start, and again when somebody else is heard with it. 0: not drawn yet. */
uint16 Sys_Get_RobotNumber(void);
/* MTHI | no | 32 | 14 | ARGUMENT.  1 to 2047; kept whoever else has it, and
 * before Sys_Start_Infrared whatever the EEPROM holds. */
bool Sys_Set_RobotNumber(uint16 number);

/* MTHI | no | 45 | 14 | ARGUMENT.  Counts (1 to 100, 4 to begin with) that light must take from a sensor, whatever its noise. */
bool Sys_Set_InfraredThreshold(uint8 counts);

/* MTHI | no | 141 | 4 | none.  Millimetres between two robots' middles that face each other, 70 to 600, for a strength: the
 * amplitudes that libIrcom's authors measured (swarmcom.md 3.1). Askew sensors seem farther. Kilobot: 33 to 98 by the tables
 * of its calibration, 0 if the EEPROM has none; slow, it reads them there. */
uint16 Sys_Estimate_Range(uint16 strength);

typedef struct {
    uint16 sent;        /* frames, beacons among them */
    uint16 received;    /* frames that were whole */
    uint16 damaged;     /* begun and not whole at the end */
    uint16 false_starts; /* light too short for a frame, such as others' proximity */
    uint16 adaptations; /* light that stayed, now taken for the room's; 0 on a Kilobot */
    uint16 refused;     /* messages that found the queue full */
    uint16 conflicts;   /* frames of somebody with the own number */
} sys_infrared_statistics; /* they saturate */
const sys_infrared_statistics *Sys_Get_InfraredStatistics(void); /* MTHI */

#ifdef __cplusplus
}
#endif

#endif
