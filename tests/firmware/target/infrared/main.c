/* Sends frame after frame by infra-red while the camera captures. */
#include <camera.h>
#include <openswarm.h>
#include <openswarm_infrared.h>

static void talk(void)
{
    for (;;) {
        Sys_Send_Neighbours("\x00\xFF\x55\xAA\x00\x00\xFF\xFF", SYS_MESSAGE_BYTES);
        Sys_Sleep(40);
    }
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Camera());
    SYS_ASSERT(Sys_Start_Infrared());
    SYS_ASSERT(Sys_Set_RobotNumber(1));
    SYS_ASSERT(Sys_Start_Process(talk) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
