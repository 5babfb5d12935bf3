/* Five threads, UART and camera: every allocation and switch can be counted by hand. */
#include <camera.h>
#include <openswarm.h>
#include <openswarm_io.h>

enum { EVENT_PARCEL = SYS_FIRST_USER_EVENT, PARCEL_BYTES = 10 };

static volatile uint16 parcels, frames, lines;

__attribute__((noinline)) static bool on_parcel(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event;
    parcels += data->size;
    return true;
}

static void courier(void)
{
    static const uint8 parcel[PARCEL_BYTES];
    for (;;) {
        for (uint16 i = 0; i < 3; i++) {
            Sys_Send_Event(EVENT_PARCEL, parcel, sizeof parcel);
        }
        Sys_Sleep(20);
    }
}

static void watcher(void)
{
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(SYS_IO_CAMERA);
        frames++;
        Sys_Clear_EventData(&data);
    }
}

static void console(void)
{
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(SYS_UART1_RECEIVED);
        lines++;
        Sys_Send_Event(SYS_SEND_UART1, data->payload, data->size);
        Sys_Clear_EventData(&data);
    }
}

static void left(void)
{
    for (;;) {
        Sys_Yield();
    }
}

static void right(void)
{
    for (;;) {
        Sys_Yield();
    }
}

int main(void)
{
    static const sys_process_config roomy = {.entry = (void (*)(void *))console, .stack = 200};
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Camera());
    SYS_ASSERT(Sys_Register_Event(EVENT_PARCEL));
    SYS_ASSERT(Sys_Subscribe_to_Event(EVENT_PARCEL, 0, on_parcel, NULL));
    SYS_ASSERT(Sys_Start_Process(courier));
    SYS_ASSERT(Sys_Start_Process(watcher));
    SYS_ASSERT(Sys_Start_ProcessWith(&roomy));
    SYS_ASSERT(Sys_Start_Process(left));
    SYS_ASSERT(Sys_Start_Process(right));
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
}
