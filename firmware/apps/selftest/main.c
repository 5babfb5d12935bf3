/* Asks every device and reports on UART1. README.md. */
#include <analog.h>
#include <battery.h>
#include <bluetooth.h>
#include <camera.h>
#include <i2c.h>
#include <led.h>
#include <openswarm.h>
#include <openswarm_io.h>
#include <remote.h>

#include <stdio.h>
#include <string.h>

enum { LINE = 48, PAUSE_MS = 20, LED_MS = 30, REVOLUTION_MS = 1000, SPEED = SYS_MAXIMUM_SPEED, REST = 200 };

static bool camera;

static void say(const char *line)
{
    Sys_Send_Event(SYS_SEND_UART1, line, (uint16)strlen(line));
    Sys_Sleep(PAUSE_MS); /* the line is sent before the next one needs the buffer */
}

static void report(const char *device, sint16 a, sint16 b, sint16 c, bool good)
{
    char line[LINE];
    snprintf(line, sizeof line, "%s %d %d %d%s\r\n", device, a, b, c, good ? "" : " FAIL");
    say(line);
}

static void report_proximity(void)
{
    for (uint8 sensor = 0; sensor < SYS_PROXIMITY_SENSORS; sensor++) {
        uint16 dark = Sys_Get_AmbientLight(sensor);
        report("proximity", sensor, (sint16)Sys_Get_Reflection(sensor), (sint16)dark, dark != 0);
    }
}

static void report_rest(void)
{
    sys_acceleration a = Sys_Get_Acceleration();
    report("acceleration", a.x, a.y, a.z, a.z > REST || a.z < -REST || a.x > REST || a.x < -REST || a.y > REST || a.y < -REST);
    report("sound", Sys_Get_Sound(0), Sys_Get_Sound(1), Sys_Get_Sound(2), true);
}

/* The camera's type over I2C while everything runs; result 0 is I2C_DONE. */
static void report_i2c(void)
{
    enum { CAMERA = 0x6E /* epuck.md §7.1 */ };
    static const uint8 type_register = 0;
    uint8 type = 0;
    i2c_transfer transfer = {CAMERA, sizeof type_register, sizeof type, &type_register, &type};
    i2c_result result = Sys_I2C_Transfer(&transfer);
    report("i2c", (sint16)result, type, 0, result == I2C_DONE);
}

static void light_leds(void)
{
    sys_led_order order;
    for (order.led = 0; order.led < SYS_LEDS; order.led++) {
        order.action = SYS_LED_ON;
        Sys_Send_Event(SYS_IO_LED, &order, sizeof order);
        Sys_Sleep(LED_MS);
        order.action = SYS_LED_OFF;
        Sys_Send_Event(SYS_IO_LED, &order, sizeof order);
    }
    say("leds done\r\n");
}

static void turn_wheels(void)
{
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, SPEED);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, SPEED);
    Sys_Sleep(REVOLUTION_MS);
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 0);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, 0);
    say("motors done\r\n");
}

static void report_uart(void)
{
    const sys_uart_statistics *s = Sys_Get_UARTStatistics(SYS_UART1);
    report("uart", (sint16)s->tx_refused, (sint16)s->rx_lost, (sint16)s->rx_damaged, true);
}

/* Bluetooth commands besides those of the driver: N proximity, A accelerometer and microphones, U errors of the
 * UART. */
static void answer(const char *line)
{
    if (line[0] == 'N') {
        report_proximity();
    } else if (line[0] == 'A') {
        report_rest();
    } else if (line[0] == 'U') {
        report_uart();
    }
}

static void test(void)
{
    say("selftest\r\n");
    report("selector", Sys_Get_Selector(), 0, 0, true);
    say(Sys_Is_BatteryLow() ? "battery low\r\n" : "battery ok\r\n");
    char line[LINE];
    snprintf(line, sizeof line, "camera %04x%s\r\n", Sys_Get_CameraType(), camera ? "" : " FAIL");
    say(line);
    report_i2c();
    report_proximity();
    report_rest();
    light_leds();
    turn_wheels();
    say("end\r\n");
    for (;;) {
        sys_event_data *asked = Sys_Wait_for_Event(SYS_BLUETOOTH_RECEIVED);
        if (asked != NULL) {
            answer(asked->payload);
        }
    }
}

static bool tell(uint16 pid, uint16 event, sys_event_data *data)
{
    static const char *const colours[] = {"black", "blue", "green", "cyan", "red", "magenta", "yellow", "white"};
    static uint16 last = 0xFFFF;
    (void)pid;
    (void)event;
    if (data->value != last) {
        last = data->value;
        const char *name = colours[last & 7u];
        Sys_Write_UART1(name, (uint16)strlen(name));
    }
    return true;
}

static bool tell_key(uint16 pid, uint16 event, sys_event_data *data)
{
    uint8 digits[] = {'k', 'e', 'y', ' ', (uint8)('0' + data->value / 10), (uint8)('0' + data->value % 10), '\r', '\n'};
    (void)pid;
    (void)event;
    Sys_Write_UART1(digits, sizeof digits);
    return true;
}

int main(void)
{
    Sys_Init_Kernel();
    camera = Sys_Start_Camera();
    Sys_Start_Remote();
    Sys_Start_I2C();
    Sys_Start_Analog();
    Sys_Start_LEDs();
    Sys_Start_Bluetooth();
    SYS_ASSERT(Sys_Subscribe_to_Event(SYS_IO_1PXSENSOR, 0, tell, NULL));
    SYS_ASSERT(Sys_Subscribe_to_Event(SYS_IO_REMOTECONTROL, 0, tell_key, NULL));
    SYS_ASSERT(Sys_Start_Process(test) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
