/* The paper's idea at work: processors between events and devices, exchanged at run time.
 *
 * A drive event {v, omega} reaches the wheels through a post-processor (a virtual actuator); an unsafe area swaps in a
 * post-processor that halves every speed; the UART swaps plain text for COBS frames under traffic. README.md. */
#include <openswarm.h>
#include <openswarm_io.h>

enum {
    DRIVE = SYS_FIRST_USER_EVENT, /* [drive_command] */
    UNSAFE_AREA,                  /* [uint16: 1 entered, 0 left] */
    AXLE_MM = 53,                 /* epuck.md §3 */
    REPORT_MS = 100
};

typedef struct {
    sint16 v_mm_s;
    sint16 omega_mrad_s; /* counter-clockwise positive */
} drive_command;

/* ---- Post-processors of the motors ------------------------------------------------------------------------------ */

static bool drive(uint16 event, const sys_event_data *data, sys_wheel_speeds *speeds)
{
    if (event != DRIVE) {
        return Sys_Default_MotorProcessor(event, data, speeds);
    }
    const drive_command *command = data->payload;
    sint16 difference = (sint16)((sint32)command->omega_mrad_s * AXLE_MM / 2000);
    speeds->left = (sint16)(command->v_mm_s - difference);
    speeds->right = (sint16)(command->v_mm_s + difference);
    return true;
}

static bool drive_carefully(uint16 event, const sys_event_data *data, sys_wheel_speeds *speeds)
{
    if (!drive(event, data, speeds)) {
        return false;
    }
    speeds->left /= 2;
    speeds->right /= 2;
    return true;
}

static bool on_unsafe_area(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    Sys_Set_MotorProcessor(data->value ? drive_carefully : drive);
    Sys_Set_LED(SYS_LED_FRONT, data->value != 0);
    return true;
}

/* ---- Commands from UART1: 'u' unsafe, 's' safe, 'f' frames, 't' text
 * ------------------------------------------------ */

static bool on_command(uint16 pid, uint16 event, sys_event_data *data)
{
    const uint8 *bytes = data->payload;
    (void)pid;
    (void)event;
    for (uint16 i = 0; i < data->size; i++) {
        switch (bytes[i]) {
        case 'u':
        case 's':
            Sys_Send_IntEvent(UNSAFE_AREA, bytes[i] == 'u');
            break;
        case 'f':
            Sys_Set_TxProcessor(SYS_UART1, Sys_Frame_Tx);
            Sys_Set_RxProcessor(SYS_UART1, Sys_Frame_Rx);
            break;
        case 't':
            Sys_Set_TxProcessor(SYS_UART1, NULL);
            Sys_Set_RxProcessor(SYS_UART1, NULL);
            break;
        default:
            break;
        }
    }
    return true;
}

/* ---- Threads ---------------------------------------------------------------------------------------------------- */

static void pilot(void)
{
    static const drive_command figure_of_eight[2] = {{100, 600}, {100, -600}};
    for (uint16 i = 0;; i ^= 1) {
        Sys_Send_Event(DRIVE, &figure_of_eight[i], sizeof(drive_command));
        Sys_Sleep(1000);
    }
}

static uint8 *put_speed(uint8 *to, sint16 speed)
{
    *to++ = speed < 0 ? '-' : '+';
    speed = (sint16)(speed < 0 ? -speed : speed);
    *to++ = (uint8)('0' + speed / 100);
    *to++ = (uint8)('0' + speed / 10 % 10);
    *to++ = (uint8)('0' + speed % 10);
    return to;
}

static void reporter(void)
{
    for (;;) {
        uint8 line[10];
        uint8 *end = put_speed(line, Sys_Get_MotorSpeed_Left());
        end = put_speed(end, Sys_Get_MotorSpeed_Right());
        *end++ = '\r';
        *end++ = '\n';
        Sys_Send_Event(SYS_SEND_UART1, line, (uint16)(end - line));
        Sys_Sleep(REPORT_MS);
    }
}

int main(void)
{
    Sys_Init_Kernel();
    Sys_Register_Event(DRIVE);
    Sys_Register_Event(UNSAFE_AREA);
    Sys_Set_MotorProcessor(drive);
    SYS_ASSERT(Sys_Connect_Motors(DRIVE));
    SYS_ASSERT(Sys_Subscribe_to_Event(UNSAFE_AREA, 0, on_unsafe_area, NULL));
    SYS_ASSERT(Sys_Subscribe_to_Event(SYS_UART1_RECEIVED, 0, on_command, NULL));
    SYS_ASSERT(Sys_Start_Process(pilot) != 0);
    SYS_ASSERT(Sys_Start_Process(reporter) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
