/* A turret on the SPI bus (README.md): asks it for a measurement every 100 ms and logs the answer. The SPI processor
 * adds and verifies a check byte at the end of each message; commands on UART1 exchange the processor at run time. */
#include <openswarm.h>
#include <openswarm_io.h>
#include <spi.h>

#include <stdio.h>
#include <string.h>

enum { PERIOD_MS = 100, MEASURE = 0x01, MESSAGE = 4 /* command, two bytes of measurement, check byte */, STACK = 256 };

static uint8 sum_of(const uint8 *bytes, uint16 size)
{
    uint8 sum = 0;
    while (size-- != 0) {
        sum += *bytes++;
    }
    return sum;
}

/* SPI processor: the last byte makes the sum of all bytes 0. */
static bool checked(uint8 *bytes, uint16 size, bool received)
{
    if (received) {
        return sum_of(bytes, size) == 0;
    }
    bytes[size - 1] = (uint8)-sum_of(bytes, (uint16)(size - 1));
    return true;
}

static bool on_command(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    char command = (char)data->value;
    if (command == 'c' || command == 'r') {
        (void)Sys_Set_SPIProcessor(command == 'c' ? checked : NULL);
    }
    return true;
}

static void ask(void *unused)
{
    uint8 message[MESSAGE];
    char line[16];
    (void)unused;
    for (;;) {
        memset(message, 0, sizeof message);
        message[0] = MEASURE;
        if (Sys_SPI_Transfer(message, message, sizeof message)) {
            snprintf(line, sizeof line, "%u\r\n", (unsigned)(message[1] << 8 | message[2]));
        } else {
            snprintf(line, sizeof line, "error %u\r\n", (unsigned)Sys_Get_LastError());
        }
        (void)Sys_Write_UART1(line, (uint16)strlen(line));
        Sys_Sleep(PERIOD_MS);
    }
}

int main(void)
{
    static const sys_process_config config = {ask, NULL, STACK, 0, 0, 0, 0};
    Sys_Init_Kernel();
    Sys_Start_SPI();
    SYS_ASSERT(Sys_Subscribe_to_Event(SYS_UART1_RECEIVED, 0, on_command, NULL));
    SYS_ASSERT(Sys_Start_ProcessWith(&config) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
