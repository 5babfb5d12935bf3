/* Listing 1 of the paper, in its order and with its names; README.md lists every difference: a reactive controller in an
 * event handler, and a thread that logs "time:(left,right)" every 250 ms. */
#include <openswarm.h>

#include <stdio.h>
#include <string.h>

/* Table of the clustering controller: percent of the maximum wheel speed, 129 mm/s (openswarm-original.md §8). */
#define SPEED(percent) ((uint16)((percent) * 129L / 100))
#define ROBOT_SPEED_L SPEED(89)
#define ROBOT_SPEED_R SPEED(53)
#define OBJECT_SPEED_L SPEED(98)
#define OBJECT_SPEED_R SPEED(50)
#define NOTHING_SPEED_L SPEED(55)
#define NOTHING_SPEED_R SPEED(99)

void loggingThread(void);
bool wait250times(sys_event_data *data);
bool object_clustering(uint16 pid, uint16 eventID, sys_event_data *data);

int main(void)
{
    Sys_Init_Kernel();
    Sys_Subscribe_to_Event(SYS_IO_1PXSENSOR, 0, object_clustering, 0);
    Sys_Start_Process(loggingThread);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
}

bool wait250times(sys_event_data *data)
{
    static uint16 counter = 0;
    (void)data;
    if (++counter < 250) {
        return false;
    }
    counter = 0;
    return true;
}

void loggingThread(void)
{
    char message[29]; /* "4294967295:(-32768,-32768)\r\n" and the final 0: the longest text */
    while (true) {
        sprintf(message, "%lu:(%d,%d)\r\n", (unsigned long)Sys_Get_SystemTime(), Sys_Get_MotorSpeed_Left(),
                Sys_Get_MotorSpeed_Right());
        Sys_Send_Event(SYS_SEND_UART1, message, (uint16)strlen(message));
        sys_event_data *data = Sys_Wait_for_Condition(SYS_1ms_TIMER, wait250times);
        Sys_Clear_EventData(&data);
    }
}

bool object_clustering(uint16 pid, uint16 eventID, sys_event_data *data)
{
    (void)pid;
    (void)eventID;
    switch (data->value) {
    case GREEN: /* another robot */
        Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, ROBOT_SPEED_L);
        Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, ROBOT_SPEED_R);
        break;
    case RED: /* an object */
        Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, OBJECT_SPEED_L);
        Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, OBJECT_SPEED_R);
        break;
    case WHITE: /* nothing, or a wall; any other colour keeps the speed */
        Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, NOTHING_SPEED_L);
        Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, NOTHING_SPEED_R);
        break;
    }
    return true;
}
