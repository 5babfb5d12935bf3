/* Makes every call of openswarm_infrared.h and openswarm_remote.h once; `toolchain bounds` analyses them. */
#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_remote.h>

static sys_neighbour neighbours[SYS_NEIGHBOURS];

int main(void)
{
    volatile uint16 result;
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Infrared());
    SYS_ASSERT(Sys_Register_Event(SYS_FIRST_USER_EVENT) && Sys_Share_Event(SYS_FIRST_USER_EVENT, 1));
    SYS_ASSERT(Sys_Send_Neighbours("8 bytes.", SYS_MESSAGE_BYTES));
    result = Sys_Get_Neighbours(neighbours, SYS_NEIGHBOURS);
    result = Sys_Get_RobotNumber();
    SYS_ASSERT(Sys_Set_RobotNumber(result + 1u) && Sys_Set_InfraredThreshold(5));
    result = Sys_Estimate_Range(result);
    SYS_ASSERT(Sys_Get_InfraredStatistics()->sent == 0 && Sys_Get_RemoteStatistics()->shared == 0);
    SYS_ASSERT(Sys_Set_MessageProcessor(NULL) != NULL && Sys_Set_SendingProcessor(NULL) != NULL);
    SYS_ASSERT(Sys_Set_LeavingProcessor(NULL) != NULL);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
