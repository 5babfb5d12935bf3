/* Kilobot infrared: the test sets messages to send and reads received ones in variables (test_kilobot_pulses.py). */
#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_remote.h>

#include <string.h>

enum { SHARED = SYS_FIRST_USER_EVENT, HOPS = 3, LOOK_MS = 3, NOTHING = 0, MESSAGE = 1, EVENT = 2 };

#define FOR_TEST __attribute__((used))
volatile uint8 wanted FOR_TEST;    /* MESSAGE or EVENT; set to NOTHING when it is sent */
volatile uint8 text[SYS_MESSAGE_BYTES] FOR_TEST, length FOR_TEST; /* of it */
volatile uint8 refused FOR_TEST;
volatile uint16 messages FOR_TEST, events FOR_TEST, sightings FOR_TEST, losses FOR_TEST;
sys_neighbour_message last_message FOR_TEST;
sys_neighbour last_seen FOR_TEST, last_lost FOR_TEST;
uint8 last_event[SYS_REMOTE_BYTES] FOR_TEST;
volatile uint16 event_size FOR_TEST;

static bool note(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    switch (event) {
    case SYS_NEIGHBOUR_MESSAGE:
        memcpy(&last_message, data->payload, sizeof last_message);
        messages++;
        break;
    case SYS_NEIGHBOUR_SEEN:
        memcpy(&last_seen, data->payload, sizeof last_seen);
        sightings++;
        break;
    case SYS_NEIGHBOUR_LOST:
        memcpy(&last_lost, data->payload, sizeof last_lost);
        losses++;
        break;
    default: /* SHARED */
        memcpy(last_event, data->payload, data->size);
        event_size = data->size;
        events++;
        break;
    }
    return true;
}

static void say(void)
{
    for (;;) {
        if (wanted == MESSAGE) {
            refused += !Sys_Send_Neighbours((const void *)text, length);
        } else if (wanted == EVENT) {
            refused += !Sys_Send_Event(SHARED, (const void *)text, length);
        }
        wanted = NOTHING;
        Sys_Sleep(LOOK_MS);
    }
}

int main(void)
{
    static const uint16 notable[] = {SYS_NEIGHBOUR_MESSAGE, SYS_NEIGHBOUR_SEEN, SYS_NEIGHBOUR_LOST, SHARED};
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Infrared());
    SYS_ASSERT(Sys_Register_Event(SHARED) && Sys_Share_Event(SHARED, HOPS));
    for (uint8 i = 0; i < sizeof notable / sizeof *notable; i++) {
        SYS_ASSERT(Sys_Subscribe_to_Event(notable[i], 0, note, NULL));
    }
    SYS_ASSERT(Sys_Start_Process(say) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
