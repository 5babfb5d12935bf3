/* Robots that reprogram each other or take programs from a host (README.md): a thread sends, handlers queue messages */
#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>
#include <stdio.h>
#include <string.h>

#include "lamp.h" /* rows of lamp/main.c */
#include "spread.h"

enum { LOOK_MS = 20, HEARD = 16, CONFIRM_MS = 1000, RESTART_MS = 3000, OFFER_MS = 8000, LINE = 24 };
enum { STACK = 300 + SYS_UPDATE_STACK };

static uint8 messages[HEARD][SYS_SPREAD_BYTES];
static volatile uint8 first, last; /* indices of the queued messages */
static volatile bool has_host;
static volatile bool is_waiting; /* a message is not sent yet: a second one would be out of date when it is sent */

static bool keep(const uint8 *message, uint16 size)
{
    uint8 next = (uint8)((last + 1u) % HEARD);
    bool is_one = size == SYS_SPREAD_BYTES && (message[0] & SYS_SPREAD_KIND) != 0;
    if (is_one && next != first) {
        memcpy(messages[last], message, SYS_SPREAD_BYTES);
        last = next;
    }
    return is_one;
}

static bool on_message(uint16 pid, uint16 event, sys_event_data *data)
{
    const sys_neighbour_message *m = data->payload;
    (void)pid;
    (void)event;
    keep(m->payload, m->size);
    return true;
}

static bool on_host(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    if (keep(data->payload, data->size)) {
        has_host = true; /* from now on the host receives all messages to neighbours */
    }
    return true;
}

static void on_leaving(uint8 *payload, uint8 size)
{
    (void)payload;
    (void)size;
    is_waiting = false;
}

static void send(const uint8 *message)
{
    is_waiting = true;
    if (!Sys_Send_Neighbours(message, SYS_SPREAD_BYTES)) {
        is_waiting = false;
    }
    if (has_host) {
        Sys_Write_UART1(message, SYS_SPREAD_BYTES);
    }
}

static void say(const char *what, uint16 version)
{
    char line[LINE];
    snprintf(line, sizeof line, "%s %u\n", what, version);
    Sys_Send_Event(SYS_SEND_UART1, line, (uint16)strlen(line));
}

/* Stores the lamp program under a version, unless the version is 0 or the kernel refuses the update. */
static void provide(uint16 version)
{
    sys_update facts = {version, sizeof lamp / sizeof *lamp, 0xFFFFFFFFu};
    for (uint8 row = 0; row < facts.rows; row++) {
        facts.crc = Sys_Add_UpdateCrc(facts.crc, lamp[row], sizeof *lamp);
    }
    facts.crc = ~facts.crc;
    bool is_taken = version != 0 && Sys_Begin_Update(&facts);
    for (uint8 row = 0; row < facts.rows && is_taken; row++) {
        is_taken = Sys_Put_UpdateRow(row, lamp[row]);
    }
    if (is_taken) {
        Sys_End_Update();
    }
}

static void spread(void *unused)
{
    (void)unused;
    uint16 running = Sys_Start_Update(), stored = 0, in_vain = 0;
    uint32 next = 0, restart_at = 0;
    bool is_active = false;
    say("runs", running);
    while (Sys_Get_RobotNumber() == 0) {
        Sys_Sleep(LOOK_MS);
    }
    provide((uint16)Sys_Get_Selector());
    Sys_Start_Spreading(Sys_Get_RobotNumber());
    for (;;) {
        uint8 message[SYS_SPREAD_BYTES];
        Sys_Sleep(LOOK_MS);
        for (; first != last; first = (uint8)((first + 1u) % HEARD)) {
            Sys_Hear_Update(Sys_Get_SystemTime(), messages[first]);
        }
        uint32 now = Sys_Get_SystemTime();
        if (now >= CONFIRM_MS && running != 0) {
            Sys_Confirm_Update();
        }
        if (now >= next && !is_waiting && Sys_Spread(now, message)) {
            send(message);
            next = now + SYS_SPREAD_TICK;
        }
        uint16 version = Sys_Get_StoredVersion(&is_active);
        if (version != stored) {
            stored = version;
            say("has", version);
        }
        if (Sys_Get_Selector() != 0 && version != 0 && !is_active && now >= OFFER_MS) {
            Sys_Offer_Activation(version);
        }
        if (version != running && is_active && version != in_vain) {
            restart_at = restart_at != 0 ? restart_at : now + RESTART_MS; /* time for the neighbours to learn of it */
            if (now >= restart_at) {
                if (Sys_Get_NextVersion() != running) {
                    __asm__ volatile("reset");
                }
                in_vain = version; /* it was tried before, or its flag cannot be written */
                restart_at = 0;
            }
        }
    }
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Infrared());
    Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, on_message, NULL);
    Sys_Subscribe_to_Event(SYS_UART1_RECEIVED, 0, on_host, NULL);
    Sys_Set_RxProcessor(SYS_UART1, Sys_Frame_Rx);
    Sys_Set_TxProcessor(SYS_UART1, Sys_Spread_Tx);
    Sys_Set_LeavingProcessor(on_leaving);
    const sys_process_config thread = {.entry = spread, .stack = STACK};
    SYS_ASSERT(Sys_Start_ProcessWith(&thread) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
