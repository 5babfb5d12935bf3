/* A round in which a thread makes every call of openswarm.h and openswarm_io.h while all devices run. The tests place
 * the camera's HREF on each cycle of the round (tests/firmware/capture_sweep.py). */
#include <analog.h>
#include <bluetooth.h>
#include <camera.h>
#include <i2c.h>
#include <led.h>
#include <openswarm.h>
#include <openswarm_io.h>
#include <openswarm_scheduler.h>
#include <remote.h>

enum { FIRST = SYS_FIRST_USER_EVENT, SECOND, ABSENT = 0x7FFF, LARGE = 40, STACK = 192 };

volatile uint16 failures __attribute__((used)), rounds __attribute__((used));

#define STOP(name)                                                    \
    __attribute__((noinline, used)) void name(void)                   \
    {                                                                 \
        __asm__ volatile("nop" ::: "memory");                         \
    }
STOP(round_begin)
STOP(round_end)

static void expect(bool holds)
{
    failures += !holds;
}

static bool listener(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    return data->value != 2;
}

static bool once(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    (void)data;
    return false;
}

static bool is_nine(sys_event_data *data)
{
    return data->value == 9;
}

static void sender(void)
{
    Sys_Send_IntEvent(SECOND, 8);
    Sys_Send_IntEvent(SECOND, 9);
}

static void periodic(void *unused)
{
    (void)unused;
    (void)Sys_Wait_for_Period();
    for (;;) {
        Sys_Yield();
    }
}

static void threads(void)
{
    static const sys_process_config config = {periodic, NULL, STACK, 1, SYS_PERIODIC, 2, 2};
    uint16 pid = Sys_Start_ProcessWith(&config);
    expect(pid != 0);
    Sys_Yield();
    expect(Sys_Get_ProcessState(pid) == SYS_BLOCKED);
    Sys_Set_Scheduler(&sys_fixed_priority);
    Sys_Yield();
    Sys_Set_Scheduler(&sys_earliest_deadline);
    Sys_Yield();
    Sys_Set_Scheduler(&sys_round_robin);
    expect(Sys_Get_UnusedStack(pid) != 0);
    expect(Sys_Kill_Process(pid));
    expect(Sys_Get_ProcessState(Sys_Get_ProcessID()) == SYS_RUNNING);
    expect(Sys_Get_UnusedKernelStack() != 0);
}

static void events(void)
{
    static const uint8 large[LARGE];
    expect(Sys_Register_Event(FIRST) && Sys_Register_Event(SECOND));
    expect(Sys_IsEventRegistered(FIRST) && !Sys_IsEventRegistered(ABSENT));
    expect(Sys_Subscribe_to_Event(FIRST, 0, listener, NULL));
    expect(Sys_Subscribe_to_Event(FIRST, 0, once, is_nine));
    expect(Sys_Send_IntEvent(FIRST, 1) && Sys_Send_Event(FIRST, large, sizeof large));
    expect(!Sys_Send_IntEvent(ABSENT, 1));
    Sys_Start_CriticalSection();
    expect(Sys_Send_IntEvent(FIRST, 9));
    Sys_End_CriticalSection();
    expect(Sys_Start_Process(sender) != 0);
    sys_event_data *data = Sys_Wait_for_Event(SECOND);
    expect(data != NULL && data->value == 8);
    Sys_Clear_EventData(&data);
    expect(Sys_Start_Process(sender) != 0);
    data = Sys_Wait_for_Condition(SECOND, is_nine);
    expect(data != NULL && data->value == 9);
    Sys_Clear_EventData(&data);
    expect(Sys_Wait_for_ConditionTimeout(SECOND, NULL, 1) == NULL);
    expect(Sys_Unsubscribe_Handler(FIRST, 0, listener));
    expect(!Sys_Unsubscribe_from_Event(FIRST, 0) || Sys_Send_IntEvent(FIRST, 3));
    expect(Sys_Unregister_Event(SECOND) && Sys_Unregister_Event(FIRST));
    (void)Sys_Get_LostEvents(FIRST);
}

static void information(void)
{
    (void)Sys_Get_Statistics();
    (void)Sys_Get_SystemTime();
    (void)Sys_Get_LastError();
    (void)Sys_Get_MotorSpeed_Left();
    (void)Sys_Get_MotorSpeed_Right();
}

static void devices(void)
{
    static const uint8 type_register = 0;
    static const sys_led_order order = {3, SYS_LED_TOGGLE};
    uint8 type = 0;
    i2c_transfer transfer = {0x6E, sizeof type_register, sizeof type, &type_register, &type};
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 129);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)-128);
    expect(Sys_Connect_Motors(SYS_IO_SELECTOR) && !Sys_Unsubscribe_from_Event(SYS_IO_SELECTOR, 0xFFFF));
    (void)Sys_Set_MotorProcessor(NULL);
    Sys_Write_UART1("sight", 5);
    Sys_Write_UART2("sight", 5);
    Sys_Send_Event(SYS_SEND_UART1, "seen", 4);
    (void)Sys_Set_TxProcessor(SYS_UART2, Sys_Frame_Tx);
    Sys_Write_UART2("framed", 6);
    (void)Sys_Set_TxProcessor(SYS_UART2, NULL);
    (void)Sys_Set_RxProcessor(SYS_UART2, Sys_Frame_Rx);
    (void)Sys_Set_RxProcessor(SYS_UART2, NULL);
    (void)Sys_Get_UARTStatistics(SYS_UART1);
    expect(Sys_Set_LED(2, true) && Sys_Toggle_LED(SYS_LED_BODY) && Sys_Send_Event(SYS_IO_LED, &order, sizeof order));
    (void)Sys_Set_LEDProcessor(NULL);
    (void)Sys_Set_SelectorProcessor(NULL);
    (void)Sys_Get_Selector();
    (void)Sys_Set_RemoteProcessor(NULL);
    (void)Sys_Set_CameraProcessor(NULL);
    (void)Sys_Set_BluetoothProcessor(NULL);
    (void)Sys_Set_ProximityProcessor(NULL);
    (void)Sys_Set_SoundProcessor(NULL);
    (void)Sys_Set_AccelerationProcessor(NULL);
    (void)Sys_Get_Reflection(0);
    (void)Sys_Get_AmbientLight(0);
    (void)Sys_Get_Acceleration();
    (void)Sys_Get_Sound(0);
    expect(Sys_I2C_Transfer(&transfer) == I2C_DONE && type == 0x60);
}

static void watcher(void *unused)
{
    (void)unused;
    for (;;) {
        round_begin();
        threads();
        events();
        information();
        devices();
        Sys_Sleep(1);
        rounds++;
        round_end();
    }
}

int main(void)
{
    static const sys_process_config config = {watcher, NULL, 2 * STACK, 2, 0, 0, 0};
    Sys_Init_Kernel();
    expect(Sys_Start_Camera());
    Sys_Start_Remote();
    Sys_Start_I2C();
    Sys_Start_Analog();
    Sys_Start_LEDs();
    Sys_Start_Bluetooth();
    Sys_Start_ProcessWith(&config);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
