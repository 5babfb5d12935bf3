/* Firmware that stores a separately built program in the update slot, starts it, and continues to run. */
#include <openswarm.h>

#include "talker.h"
#include "update.h"

enum { VERSION = 7, ROWS = sizeof talker / sizeof *talker, STACK = 700 };

volatile uint16 started = 0xFFFF; /* result of Sys_Start_Update */

static bool store(void)
{
    sys_update facts = {VERSION, ROWS, 0xFFFFFFFFu};
    for (uint8 row = 0; row < ROWS; row++) {
        facts.crc = Sys_Add_UpdateCrc(facts.crc, talker[row], sizeof *talker);
    }
    facts.crc = ~facts.crc;
    bool is_taken = Sys_Begin_Update(&facts);
    for (uint8 row = 0; row < ROWS; row++) {
        is_taken = is_taken && Sys_Put_UpdateRow(row, talker[row]);
    }
    return is_taken && Sys_End_Update() && Sys_Activate_Update(VERSION);
}

static void start(void *unused)
{
    (void)unused;
    (void)store(); /* fails if the program is already stored */
    started = Sys_Start_Update();
    Sys_Confirm_Update();
}

int main(void)
{
    Sys_Init_Kernel();
    const sys_process_config thread = {.entry = start, .stack = STACK};
    SYS_ASSERT(Sys_Start_ProcessWith(&thread) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
