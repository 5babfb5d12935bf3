/* Scenes: a victim thread calls drivers and options, and INT1 kills it at any instruction (tests/firmware/kills.py).
 * The keeper thread then uses every device and option itself and restores the memory. */
#include <analog.h>
#include <battery.h>
#include <bluetooth.h>
#include <camera.h>
#include <i2c.h>
#include <led.h>
#include <openswarm.h>
#include <openswarm_cleanup.h>
#include <openswarm_interrupt.h>
#include <openswarm_io.h>
#include <openswarm_join.h>
#include <openswarm_mutex.h>
#include <openswarm_scheduler.h>
#include <remote.h>
#include <spi.h>

#include <string.h>

enum { DONE = SYS_FIRST_USER_EVENT, KILL, OTHER, CAMERA = 0x6E, NOBODY = 0x10, SETTLE_MS = 12, VICTIM_STACK = 224 };

volatile uint16 scene __attribute__((used)), rest_ms __attribute__((used)), failures __attribute__((used));
static uint16 victim_pid;

/* Marks functions at which the campaign stops. */
#define PLACE __attribute__((noinline, used))
PLACE void scene_begin(void) { __asm__ volatile("nop"); }
PLACE void scene_end(void) { __asm__ volatile("nop"); }
PLACE void victim_gone(void) { __asm__ volatile("nop"); }
PLACE void rested(void) { __asm__ volatile("nop"); }
PLACE void checked(void) { __asm__ volatile("nop"); }

static void expect(bool condition)
{
    failures += !condition;
}

/* ---- Scenes of the victim thread ----------------------------------------------------------------------------------- */

static const uint8 id_register[1] = {0}, some_bytes[3] = {1, 2, 3};

static void read_bus(void)
{
    uint8 in[2] = {0, 0};
    const i2c_transfer transfer = {CAMERA, 1, 2, id_register, in};
    expect(Sys_I2C_Transfer(&transfer) == I2C_DONE);
}

static void ask_nobody(void)
{
    const i2c_transfer transfer = {NOBODY, 3, 0, some_bytes, NULL};
    expect(Sys_I2C_Transfer(&transfer) == I2C_NO_ACK);
}

static bool turn_round(uint8 *bytes, uint16 size, bool received)
{
    for (uint16 i = 0; i < size; i++) {
        bytes[i] = (uint8)~bytes[i];
    }
    return !received || bytes[0] != 0;
}

static void exchange_words(void)
{
    uint8 in[5];
    (void)Sys_Set_SPIProcessor(turn_round);
    (void)Sys_SPI_Transfer((const uint8 *)"12345", in, sizeof in);
}

static void say_much(void)
{
    char text[70];
    memset(text, 'm', sizeof text);
    (void)Sys_Write_UART1(text, sizeof text);
    (void)Sys_Send_Event(SYS_SEND_UART1, text, 40);
}

static void say_in_frames(void)
{
    (void)Sys_Set_TxProcessor(SYS_UART1, Sys_Frame_Tx);
    (void)Sys_Set_RxProcessor(SYS_UART1, Sys_Frame_Rx);
    (void)Sys_Write_UART1("framed", 6);
}

static bool stay(uint16 event, const sys_event_data *data, sys_wheel_speeds *speeds)
{
    (void)event, (void)data, (void)speeds;
    return false;
}

static void move_and_light(void)
{
    (void)Sys_Set_MotorProcessor(stay);
    (void)Sys_Connect_Motors(OTHER);
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 50);
    (void)Sys_Set_LED(3, true);
    (void)Sys_Toggle_LED(SYS_LED_BODY);
    sys_led_order order = {SYS_LED_ALL, SYS_LED_TOGGLE};
    (void)Sys_Set_LEDProcessor(NULL);
    Sys_Send_Event(SYS_IO_LED, &order, sizeof order);
    (void)Sys_Get_MotorSpeed_Left();
}

static void look_round(void)
{
    (void)Sys_Set_CameraProcessor(Sys_LineOfSight_Processor);
    (void)Sys_Get_CameraFrame();
    (void)Sys_Set_ProximityProcessor(Sys_Default_ProximityProcessor);
    (void)Sys_Set_SoundProcessor(Sys_Default_SoundProcessor);
    (void)Sys_Set_AccelerationProcessor(NULL);
    (void)Sys_Get_Acceleration();
    (void)Sys_Get_Sound(1);
    (void)Sys_Get_Reflection(2);
    (void)Sys_Set_RemoteProcessor(NULL);
    (void)Sys_Set_SelectorProcessor(NULL);
    (void)Sys_Get_Selector();
    (void)Sys_Is_BatteryLow();
    (void)Sys_Set_BluetoothProcessor(NULL);
    (void)Sys_Get_UARTStatistics(SYS_UART2);
}

static sys_mutex mutex = SYS_MUTEX(0);
static sys_cleanup cleanups[2];
static uint16 partner_pid;
static volatile uint16 cleaned[2], rounds; /* runs of each cleanup; times that the rival owned the mutex */

static void clean(void *runs)
{
    bool is_free = mutex.owner == NULL || Sys_Pid_Of(mutex.owner) != victim_pid; /* perhaps the rival's by now */
    expect(++*(volatile uint16 *)runs == 1 && is_free);
}

static void own_and_join(void)
{
    cleaned[0] = cleaned[1] = 0;
    expect(Sys_Push_Cleanup(&cleanups[0], clean, (void *)&cleaned[0]) && Sys_Lock_Mutex(&mutex));
    expect(Sys_Push_Cleanup(&cleanups[1], clean, (void *)&cleaned[1]) && !Sys_JoinTimeout(partner_pid, 2));
    expect(Sys_Pop_Cleanup(false) && Sys_Unlock_Mutex(&mutex) && Sys_Pop_Cleanup(true));
}

static void (*const scenes[])(void) = {read_bus,      ask_nobody,     exchange_words, say_much,
                                       say_in_frames, move_and_light, look_round,     own_and_join};
enum { SCENES = sizeof scenes / sizeof *scenes };

static void victim(void *unused)
{
    (void)unused;
    scene_begin();
    scenes[scene]();
    scene_end();
    Sys_Send_IntEvent(DONE, 0);
}

/* ---- The keeper ------------------------------------------------------------------------------------------------------ */

static void int1(void)
{
    Sys_Send_IntEvent(KILL, 0);
}
SYS_INTERRUPT(INT1, 4, int1)

static bool on_kill(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    if (Sys_Kill_Process(victim_pid)) {
        victim_gone();
        Sys_Send_IntEvent(DONE, 1);
    }
    return true;
}

static void rival(void *unused)
{
    (void)unused;
    for (;;) {
        expect(Sys_Lock_Mutex(&mutex) && Sys_Unlock_Mutex(&mutex));
        rounds++;
        Sys_Sleep(3);
    }
}

static void partner(void *unused)
{
    (void)unused;
    for (;;) {
        Sys_Sleep(60000);
    }
}

static void check_options(void)
{
    uint16 before = rounds;
    expect(Sys_Lock_MutexTimeout(&mutex, SETTLE_MS) && Sys_Unlock_Mutex(&mutex));
    for (uint8 i = 0; i < 2; i++) { /* fails if one is still pushed */
        expect(Sys_Push_Cleanup(&cleanups[i], clean, NULL) && Sys_Pop_Cleanup(false));
    }
    Sys_Sleep(SETTLE_MS);
    expect(rounds != before);
}

static void check_devices(void)
{
    uint8 in[5] = {0};
    (void)Sys_Set_SPIProcessor(NULL);
    (void)Sys_Set_TxProcessor(SYS_UART1, NULL);
    (void)Sys_Set_RxProcessor(SYS_UART1, NULL);
    (void)Sys_Set_MotorProcessor(NULL);
    (void)Sys_Unsubscribe_from_Event(OTHER, 0);
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 0);
    const i2c_transfer transfer = {CAMERA, 1, 2, id_register, in};
    expect(Sys_I2C_Transfer(&transfer) == I2C_DONE && in[0] == 0x60); /* reads the camera */
    expect(Sys_SPI_Transfer((const uint8 *)"abcde", in, sizeof in) && memcmp(in, "abcde", sizeof in) == 0);
    expect(Sys_Write_UART2("ok", 2) && Sys_Write_UART1(".", 1));
    for (uint8 led = 0; led < SYS_LEDS; led++) {
        (void)Sys_Set_LED(led, false);
    }
    check_options();
}

int main(void)
{
    static const sys_process_config config = {victim, NULL, VICTIM_STACK, 0, 0, 0, 0};
    static const sys_process_config others[] = {{rival, NULL, 0, 0, 0, 0, 0}, {partner, NULL, 0, 0, 0, 0, 0}};
    Sys_Init_Kernel();
    Sys_Register_Event(DONE);
    Sys_Register_Event(KILL);
    Sys_Register_Event(OTHER);
    Sys_Subscribe_to_Event(KILL, 0, on_kill, NULL);
    expect(Sys_Start_Camera());
    Sys_Start_I2C();
    Sys_Start_SPI();
    Sys_Start_Remote();
    Sys_Start_LEDs();
    Sys_Enable_Interrupt(INT1);
    expect(Sys_Start_ProcessWith(&others[0]) != 0);
    partner_pid = Sys_Start_ProcessWith(&others[1]);
    expect(partner_pid != 0);
    Sys_Start_Kernel();
    for (;;) {
        Sys_Sleep(SETTLE_MS); /* until written data is sent */
        checked();
        scene = (uint16)((scene + 1u) % SCENES);
        victim_pid = Sys_Start_ProcessWith(&config);
        expect(victim_pid != 0);
        sys_event_data *done = Sys_Wait_for_Event(DONE);
        Sys_Clear_EventData(&done);
        Sys_Sleep(rest_ms);
        rested();
        check_devices();
    }
}
