/* Starts the stored program, then executes the commands that the test writes to `command`. */
#include "update.h"

enum { RECEIVE = 1, ACTIVATE, CONFIRM, ROWS = 1 };

volatile uint16 command, version, refused;
sys_update facts;
uint8 bytes[ROWS][HAL_UPDATE_ROW];

static void receive(void)
{
    refused += !Sys_Begin_Update(&facts);
    for (uint8 row = 0; row < ROWS; row++) {
        refused += !Sys_Put_UpdateRow(row, bytes[row]);
    }
    refused += !Sys_End_Update();
}

void __attribute__((noinline)) ready(void)
{
    __asm__ volatile("nop" : : "r"(&facts), "r"(bytes) : "memory"); /* volatile: the test writes them */
}

int main(void)
{
    version = Sys_Start_Update();
    for (;;) {
        ready();
        while (command == 0) {
        }
        if (command == RECEIVE) {
            receive();
        } else if (command == ACTIVATE) {
            refused += !Sys_Activate_Update(facts.version);
        } else {
            refused += !Sys_Confirm_Update();
        }
        command = 0;
    }
}
