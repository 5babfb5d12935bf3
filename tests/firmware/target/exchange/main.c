/* Replaces every processor of every device and restores it while the devices run; received data is kept in variables
 * for tests/firmware/drivers/test_processors_on_target.py. */
#include <analog.h>
#include <bluetooth.h>
#include <camera.h>
#include <led.h>
#include <openswarm.h>
#include <openswarm_io.h>
#include <remote.h>

enum { PAUSE_MS = 5, SWAPPED_LED = 5 };

volatile uint16 wanted __attribute__((used)); /* processors: 0 default, 1 replaced, 2 suppress all */
volatile uint16 installed __attribute__((used)) = 0xFFFF, swaps __attribute__((used)), wrong __attribute__((used));
volatile uint16 colour __attribute__((used)), key __attribute__((used)), position __attribute__((used));
volatile uint16 nearest __attribute__((used)), loudness __attribute__((used)), line __attribute__((used));
volatile sint16 up __attribute__((used));
volatile uint16 colours __attribute__((used)), keys __attribute__((used)), positions __attribute__((used));
volatile uint16 lines __attribute__((used)), motions __attribute__((used));

static bool swallow(void)
{
    return wanted != 2;
}

static bool own_camera(const uint8 *frame, sys_colour *seen)
{
    *seen = (frame[0] & 0xF8u) > (frame[1] & 0x1Fu) << 3 ? YELLOW : CYAN;
    return swallow();
}

static bool own_remote(sys_remote_frame *frame)
{
    frame->command = (uint8)(frame->command ^ 1u);
    return swallow();
}

static bool own_selector(uint8 *seen)
{
    *seen = (uint8)(15 - *seen);
    return swallow();
}

static uint8 own_proximity(uint8 sensor, uint16 counts)
{
    (void)counts;
    return (uint8)(100 + sensor);
}

static bool own_acceleration(sys_acceleration *mean)
{
    mean->z = (sint16)-mean->z;
    return swallow();
}

static uint16 own_sound(uint8 microphone, sint16 sample, uint16 so_far)
{
    (void)microphone;
    (void)sample;
    return so_far + 1u;
}

static bool own_led(sys_led_order *order)
{
    order->led = SWAPPED_LED;
    return swallow();
}

static bool own_bluetooth(const char *text, uint16 size)
{
    (void)size;
    return text[0] == 'D'; /* refuse the drive command */
}

static bool own_motors(uint16 event, const sys_event_data *data, sys_wheel_speeds *speeds)
{
    (void)event;
    speeds->left = speeds->right = (sint16)((sint16)data->value / 2);
    return swallow();
}

/* Replaces the processors as `wanted` says; each setter must return the processor that was in force. */
static void swap(void)
{
    static sys_camera_processor camera = Sys_LineOfSight_Processor;
    static sys_proximity_processor proximity = Sys_Default_ProximityProcessor;
    static sys_bluetooth_processor bluetooth = Sys_Default_BluetoothProcessor;
    static sys_motor_processor motors = Sys_Default_MotorProcessor;
    bool own = wanted != 0;
    wrong += Sys_Set_CameraProcessor(own ? own_camera : NULL) != camera;
    camera = own ? own_camera : Sys_LineOfSight_Processor;
    wrong += Sys_Set_ProximityProcessor(own ? own_proximity : NULL) != proximity;
    proximity = own ? own_proximity : Sys_Default_ProximityProcessor;
    wrong += Sys_Set_BluetoothProcessor(own ? own_bluetooth : NULL) != bluetooth;
    bluetooth = own ? own_bluetooth : Sys_Default_BluetoothProcessor;
    wrong += Sys_Set_MotorProcessor(own ? own_motors : NULL) != motors;
    motors = own ? own_motors : Sys_Default_MotorProcessor;
    (void)Sys_Set_RemoteProcessor(own ? own_remote : NULL);
    (void)Sys_Set_SelectorProcessor(own ? own_selector : NULL);
    (void)Sys_Set_AccelerationProcessor(own ? own_acceleration : NULL);
    (void)Sys_Set_SoundProcessor(own ? own_sound : NULL);
    (void)Sys_Set_LEDProcessor(own ? own_led : NULL);
    installed = wanted;
    swaps++;
}

static bool note(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    switch (event) {
    case SYS_IO_1PXSENSOR:
        colour = data->value;
        colours++;
        break;
    case SYS_IO_REMOTECONTROL:
        key = data->value;
        keys++;
        break;
    case SYS_IO_SELECTOR:
        position = data->value;
        positions++;
        break;
    case SYS_IO_PROXIMITY:
        nearest = ((const uint8 *)data->payload)[3];
        break;
    case SYS_IO_ACCELERATION:
        up = ((const sys_acceleration *)data->payload)->z;
        motions++;
        break;
    case SYS_IO_SOUND:
        loudness = ((const uint16 *)data->payload)[1];
        break;
    default: /* SYS_BLUETOOTH_RECEIVED */
        line = data->value;
        lines++;
        break;
    }
    return true;
}

static void swapper(void)
{
    for (;;) {
        if (installed != wanted) {
            swap();
        }
        Sys_Sleep(PAUSE_MS);
    }
}

int main(void)
{
    static const uint16 events[] = {SYS_IO_1PXSENSOR,     SYS_IO_REMOTECONTROL, SYS_IO_SELECTOR, SYS_IO_PROXIMITY,
                                    SYS_IO_ACCELERATION, SYS_IO_SOUND,         SYS_BLUETOOTH_RECEIVED};
    Sys_Init_Kernel();
    Sys_Start_Camera();
    Sys_Start_Remote();
    Sys_Start_Analog();
    Sys_Start_LEDs();
    Sys_Start_Bluetooth();
    for (uint8 i = 0; i < sizeof events / sizeof *events; i++) {
        Sys_Subscribe_to_Event(events[i], 0, note, NULL);
    }
    Sys_Start_Process(swapper);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
