/* Helper functions that the host tests and the on-target tests share. */
#include "test.h"

char trace[64];
static size_t noted;

void note(char c)
{
    if (noted + 1 < sizeof trace) {
        trace[noted++] = c;
    }
}

void note_letter(void *letter)
{
    note(*(const char *)letter);
}

void boot(void)
{
    host_use_virtual_time();
    Sys_Init_Kernel();
    Sys_Start_Kernel();
}

uint16 heap_now(void)
{
    return Sys_Get_Statistics()->heap_used;
}

bool lists_are_well_formed(void)
{
    unsigned members = 0;
    for (const sys_pcb *p = os_ring; p != NULL; p = p->next != os_ring ? p->next : NULL) {
        if (++members > 1000 || (p->status & OS_OFF_RING)) {
            return false;
        }
    }
    for (const sys_pcb *p = os_blocked; p != NULL; p = p->next) {
        if (++members > 1000 || (p->status & OS_STATE) < SYS_BLOCKED) {
            return false;
        }
    }
    return members >= 1;
}

int deliveries;
bool count_delivery(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    deliveries++;
    return true;
}

void yield_for_ever(void)
{
    for (;;) {
        Sys_Yield();
    }
}

void sleep_for_ever(void *unused)
{
    (void)unused;
    for (;;) {
        Sys_Sleep(1000);
    }
}

uint16 start_thread(void (*entry)(void *), const void *arg)
{
    sys_process_config config = {entry, (void *)arg, 0, 0, 0, 0, 0};
    return Sys_Start_ProcessWith(&config);
}
