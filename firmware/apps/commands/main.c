/* Commands typed on UART1, read with sscanf: README.md lists them. */
#include <openswarm.h>
#include <openswarm_io.h>

#include <stdio.h>
#include <string.h>

enum { LINE = 40, ANSWER = 32, STACK = 512 };

static void say(const char *text)
{
    Sys_Send_Event(SYS_SEND_UART1, text, (uint16)strlen(text));
}

static void obey(const char *line)
{
    char answer[ANSWER];
    char word[8];
    int left, right, used = 0;
    if (sscanf(line, " speed %d , %d %n", &left, &right, &used) == 2 && line[used] == '\0') {
        Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, (uint16)left);
        Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)right);
        say("ok\r\n");
    } else if (sscanf(line, " sum %i %i %n", &left, &right, &used) == 2 && line[used] == '\0') {
        snprintf(answer, sizeof answer, "%d\r\n", left + right);
        say(answer);
    } else if (sscanf(line, " get %7[a-z] %n", word, &used) == 1 && line[used] == '\0' && strcmp(word, "speed") == 0) {
        snprintf(answer, sizeof answer, "%d,%d\r\n", Sys_Get_MotorSpeed_Left(), Sys_Get_MotorSpeed_Right());
        say(answer);
    } else {
        say("?\r\n");
    }
}

static void listen(void *unused)
{
    char line[LINE];
    uint16 used = 0;
    (void)unused;
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(SYS_UART1_RECEIVED);
        const char *bytes = data->payload;
        for (uint16 i = 0; i < data->size; i++) {
            if (bytes[i] == '\r' || bytes[i] == '\n') {
                line[used] = '\0';
                if (used != 0) {
                    obey(line);
                }
                used = 0;
            } else if (used < LINE - 1) {
                line[used++] = bytes[i];
            }
        }
        Sys_Clear_EventData(&data);
    }
}

int main(void)
{
    Sys_Init_Kernel();
    const sys_process_config listener = {.entry = listen, .stack = STACK};
    SYS_ASSERT(Sys_Start_ProcessWith(&listener) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
