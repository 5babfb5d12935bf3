/* Drives the wheels at the speeds that the test writes to two variables, which are read every 10 ms. */
#include <openswarm.h>
#include <openswarm_io.h>

enum { PAUSE_MS = 10 };

volatile sint16 wanted_left __attribute__((used)), wanted_right __attribute__((used));
volatile uint16 last_error __attribute__((used));
volatile sint16 left_in_force __attribute__((used)), right_in_force __attribute__((used));

static void driver(void)
{
    for (;;) {
        Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, (uint16)wanted_left);
        Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)wanted_right);
        Sys_Sleep(PAUSE_MS);
        last_error = Sys_Get_LastError();
        left_in_force = Sys_Get_MotorSpeed_Left();
        right_in_force = Sys_Get_MotorSpeed_Right();
    }
}

int main(void)
{
    Sys_Init_Kernel();
    Sys_Start_Process(driver);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
