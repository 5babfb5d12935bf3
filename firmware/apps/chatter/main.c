/* Sends numbered infra-red frames, counts received ones (README.md); see docs/tools/infrared/link.py and swarm.py. */
#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>

enum { SENDERS = 30, STEP_MS = 125, RETRY_MS = 4 };

typedef struct {
    uint16 number, sent_ms; /* when it was queued, low word of the sender's clock */
    uint16 filling[2];
} numbered;

typedef struct {
    uint16 source, received, twice, last, repaired;
    sint32 ms; /* sum of own clock at arrival minus sender's clock at queueing */
    sint16 longest; /* the greatest of these differences */
} from_sender;

from_sender senders[SENDERS];
numbered mine = {0, 0, {0x55AA, 0x00FF}};

static bool on_message(uint16 pid, uint16 event, sys_event_data *data)
{
    const sys_neighbour_message *m = data->payload;
    const uint8 *bytes = m->payload;
    uint16 number = (uint16)(bytes[0] | bytes[1] << 8), sent_ms = (uint16)(bytes[2] | bytes[3] << 8);
    (void)pid;
    (void)event;
    for (from_sender *s = senders; s != senders + SENDERS; s++) {
        if (s->source == m->source || s->source == 0) {
            sint16 ms = (sint16)(Sys_Get_SystemTime() - sent_ms);
            s->twice = (uint16)(s->twice + (s->received != 0 && s->last == number));
            s->source = m->source;
            s->longest = s->received == 0 || ms > s->longest ? ms : s->longest;
            s->received++;
            s->last = number;
            s->repaired = (uint16)(s->repaired + m->corrected);
            s->ms += ms;
            return true;
        }
    }
    return true;
}

static void talk(void)
{
    uint16 random = Sys_Get_RobotNumber();
    Sys_Sleep(500);
    for (;;) {
        uint16 step = (uint16)(Sys_Get_Selector() * STEP_MS);
        random = (uint16)(random * 25173u + 13849u + Sys_Get_RobotNumber());
        Sys_Sleep(step != 0 ? (uint16)(step + random % (2 * step)) : RETRY_MS);
        mine.sent_ms = (uint16)Sys_Get_SystemTime();
        if (Sys_Send_Neighbours(&mine, sizeof mine)) {
            mine.number++;
        }
    }
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Infrared());
    Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, on_message, NULL);
    SYS_ASSERT(Sys_Start_Process(talk) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
