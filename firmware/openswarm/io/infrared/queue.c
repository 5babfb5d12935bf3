/* SPDX-License-Identifier: MIT */
/* Frames waiting to be sent: a ring of fixed size, filled in any context and emptied by the link. */
#include "hal_cpu.h"
#include "infrared_parts.h"
#include "kernel.h"

#include <string.h>

waiting_frame queue[SYS_INFRARED_QUEUE];
volatile uint8 queue_first, queue_length;
sys_infrared_statistics infrared_statistics;

static bool has_sent;

static waiting_frame *reserve(void)
{
    waiting_frame *w = NULL;
    hal_lock_state lock = hal_lock_devices();
    if (queue_length < SYS_INFRARED_QUEUE) {
        w = queue + (uint8)(queue_first + queue_length) % SYS_INFRARED_QUEUE;
        queue_length++;
    } else if (infrared_statistics.refused != 0xFFFFu) {
        infrared_statistics.refused++;
    }
    hal_unlock(lock);
    return w;
}

bool queue_frame(frame_kind kind, const uint8 *payload, uint8 size)
{
    hal_lock_state lock = hal_lock_slice(); /* a thread must not be killed between reserving and filling */
    waiting_frame *w = reserve();
    if (w != NULL) {
        w->kind = (uint8)kind;
        w->size = size;
        memcpy(w->payload, payload, size);
        hal_barrier();
        w->is_filled = true;
    }
    hal_unlock(lock);
    return w != NULL;
}

void queue_pack(frame_buffer *b)
{
    waiting_frame *w = queue + queue_first;
    if (w->kind == FRAME_MESSAGE && w->size != 0) {
        infrared_leaving(w->payload, w->size);
    }
    frame f = {infrared_number, w->kind, w->size, w->payload};
    frame_pack(b, &f);
    w->is_filled = false;
    queue_first = (uint8)((queue_first + 1u) % SYS_INFRARED_QUEUE);
    queue_length--;
}

void queue_sent(void)
{
    os_count(&infrared_statistics.sent);
    has_sent = true;
}

bool queue_has_sent(void)
{
    bool answer = has_sent;
    has_sent = false;
    return answer;
}
