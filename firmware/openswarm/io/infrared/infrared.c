/* SPDX-License-Identifier: MIT */
/* Messages to and from neighbours: events, processors, the robot's number. */
#include "infrared_parts.h"
#include "kernel.h"

#include <string.h>

enum { HOUSEKEEPINGS = 64 /* per second */, DRAWN_AFTER = 16 };

uint16 infrared_number;
frame_sink infrared_event_sink;

static bool number_is_kept;
static uint8 housekeepings;
static uint16 beacon_at;   /* low word of the system time */
static sys_message_processor message_processor;
static sys_sending_processor sending_processor;
static sys_leaving_processor leaving_processor;

BOUNDS_AT("while (", loop 1); /* the e-puck never draws 0 twice in a row */
static void draw_number(void)
{
    if (!number_is_kept) {
        do {
            infrared_number = link_random() & NUMBER_MASK;
        } while (infrared_number == 0);
    }
}

BOUNDS_AT("message_processor(&m)", calls sys_message_processor);
static void pass_on(const frame *f, uint8 repairs, uint8 sensor, uint16 strength)
{
    sys_neighbour_message m = {f->number, strength, sensor, repairs, f->size, {0}};
    memcpy(m.payload, f->payload, f->size);
    if (message_processor == NULL || message_processor(&m)) {
        (void)Sys_Send_Event(SYS_NEIGHBOUR_MESSAGE, &m, sizeof m);
    }
}

BOUNDS_AT("infrared_event_sink(&f)", calls frame_sink);
void infrared_received(const frame_buffer *b, uint8 sensor, uint16 strength)
{
    frame f;
    frame_unpack(b, &f);
    if (f.number == 0) { /* no robot has this number */
        return;
    }
    if (f.number == infrared_number) {
        os_count(&infrared_statistics.conflicts);
        draw_number();
    }
    neighbours_heard(f.number, sensor, strength);
    if (f.kind == FRAME_EVENT && infrared_event_sink != NULL) {
        infrared_event_sink(&f);
    } else if (f.kind == FRAME_MESSAGE && f.size != 0 && f.size <= SYS_MESSAGE_BYTES) {
        pass_on(&f, b->repairs, sensor, strength);
    }
}

BOUNDS_AT("leaving_processor(payload", calls sys_leaving_processor);
void infrared_leaving(uint8 *payload, uint8 size)
{
    if (leaving_processor != NULL) {
        leaving_processor(payload, size);
    }
}

static void keep_alive(void)
{
    uint16 now = clock_now();
    if (queue_has_sent()) {
        beacon_at = (uint16)(now + SYS_BEACON_PERIOD + (link_random() & (SYS_BEACON_PERIOD / 4 - 1)));
    } else if ((sint16)(now - beacon_at) >= 0) {
        beacon_at = (uint16)(now + SYS_BEACON_PERIOD);
        (void)queue_frame(FRAME_MESSAGE, &housekeepings, 0);
    }
}

void infrared_housekeeping(void)
{
    if (housekeepings < DRAWN_AFTER && ++housekeepings == DRAWN_AFTER && infrared_number == 0) {
        draw_number();
    }
    neighbours_age();
    keep_alive();
}

BOUNDS_AT("!processor(", calls sys_sending_processor);
bool Sys_Send_Neighbours(const void *payload, uint16 size)
{
    uint8 changed[SYS_MESSAGE_BYTES];
    uint8 bytes = (uint8)size;
    if (payload == NULL || size == 0 || size > SYS_MESSAGE_BYTES) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    memcpy(changed, payload, size);
    sys_sending_processor processor = HAL_LOAD(sending_processor);
    if (processor != NULL && (!processor(changed, &bytes) || bytes == 0 || bytes > SYS_MESSAGE_BYTES)) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    return queue_frame(FRAME_MESSAGE, changed, bytes) || os_fail(SYS_ERROR_BUSY);
}

static bool on_request(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    (void)Sys_Send_Neighbours(data->payload, data->size);
    return true;
}

sys_message_processor Sys_Set_MessageProcessor(sys_message_processor processor)
{
    sys_message_processor before = message_processor;
    HAL_STORE(message_processor, processor);
    return before;
}

sys_sending_processor Sys_Set_SendingProcessor(sys_sending_processor processor)
{
    sys_sending_processor before = sending_processor;
    HAL_STORE(sending_processor, processor);
    return before;
}

sys_leaving_processor Sys_Set_LeavingProcessor(sys_leaving_processor processor)
{
    sys_leaving_processor before = leaving_processor;
    HAL_STORE(leaving_processor, processor);
    return before;
}

uint16 Sys_Get_RobotNumber(void)
{
    return HAL_LOAD(infrared_number);
}

static bool keep_number(uint16 number)
{
    if (number == 0 || number > NUMBER_MASK) {
        return false;
    }
    number_is_kept = true; /* first, so that the link's interrupt draws no other number */
    hal_barrier();
    HAL_STORE(infrared_number, number);
    return true;
}

bool Sys_Set_RobotNumber(uint16 number)
{
    return keep_number(number) || os_fail(SYS_ERROR_ARGUMENT);
}

const sys_infrared_statistics *Sys_Get_InfraredStatistics(void)
{
    return &infrared_statistics;
}

bool Sys_Start_Infrared(void)
{
    bool is_ready = link_init();
    if (!number_is_kept) {
        (void)keep_number(hal_infrared_number());
    }
    hal_infrared_start();
    return is_ready && Sys_Register_Event(SYS_NEIGHBOUR_MESSAGE) && Sys_Register_Event(SYS_NEIGHBOUR_SEEN) &&
           Sys_Register_Event(SYS_NEIGHBOUR_LOST) && Sys_Register_Event(SYS_SEND_NEIGHBOURS) &&
           event_connect(SYS_SEND_NEIGHBOURS, on_request);
}
