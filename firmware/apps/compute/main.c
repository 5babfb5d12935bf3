/* Eight threads that compute without pause and a ninth that logs over UART1: the load of bench/emulator/jit.py. */
#include <openswarm.h>

#include <stdio.h>
#include <string.h>

enum { WORKERS = 8, LOG_PERIOD_MS = 250, MESSAGE = 24, LOGGER_STACK = 192 };

static volatile uint16 checksum[WORKERS];

/* CRC-16/ARC of a pseudo-random sequence that no branch predictor learns. */
static void compute(uint16 me)
{
    uint16 random = (uint16)(me * 40503u + 1u);
    uint16 crc = 0xFFFF;
    for (;;) {
        random = (uint16)(random * 25173u + 13849u);
        crc ^= random >> 8;
        for (uint16 bit = 0; bit < 8; bit++) {
            crc = (crc & 1) ? (uint16)((crc >> 1) ^ 0xA001) : (uint16)(crc >> 1);
        }
        checksum[me] = crc;
    }
}

static void worker(void)
{
    compute((uint16)((Sys_Get_ProcessID() - 1) % WORKERS));
}

static bool every250(sys_event_data *data)
{
    static uint16 counter = 0;
    (void)data;
    counter = (uint16)(counter + 1 == LOG_PERIOD_MS ? 0 : counter + 1);
    return counter == 0;
}

static void logger(void *unused)
{
    (void)unused;
    char message[MESSAGE];
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Condition(SYS_1ms_TIMER, every250);
        Sys_Clear_EventData(&data);
        snprintf(message, sizeof message, "%lu %x\r\n", (unsigned long)Sys_Get_SystemTime(), checksum[0]);
        Sys_Send_Event(SYS_SEND_UART1, message, (uint16)strlen(message));
    }
}

int main(void)
{
    Sys_Init_Kernel();
    for (uint16 n = 0; n < WORKERS; n++) {
        Sys_Start_Process(worker);
    }
    static const sys_process_config logging = {.entry = logger, .stack = LOGGER_STACK};
    Sys_Start_ProcessWith(&logging);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
