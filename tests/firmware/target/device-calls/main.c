/* Makes every call of the device headers of io/ once; `toolchain bounds` analyses them. */
#include <openswarm.h>

#include <analog.h>
#include <battery.h>
#include <bluetooth.h>
#include <camera.h>
#include <i2c.h>
#include <led.h>
#include <remote.h>
#include <spi.h>

static void transfer(void)
{
    static uint8 byte;
    const i2c_transfer one = {.address = 0xC0, .out = &byte, .out_size = 1};
    SYS_ASSERT(Sys_I2C_Transfer(&one) != I2C_BUSY);
    SYS_ASSERT(Sys_SPI_Transfer(&byte, NULL, 1));
}

int main(void)
{
    volatile uint16 result;
    volatile sys_acceleration acceleration;
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Analog() && Sys_Start_LEDs() && Sys_Start_Bluetooth() && Sys_Start_Remote());
    Sys_Start_I2C();
    Sys_Start_SPI();
    result = Sys_Start_Camera() ? Sys_Get_CameraType() : 0;
    result = *Sys_Get_CameraFrame();
    result = Sys_Is_BatteryLow();
    result = Sys_Get_Reflection(result) + Sys_Get_AmbientLight(result);
    acceleration = Sys_Get_Acceleration();
    result = (uint16)Sys_Get_Sound(0);
    (void)acceleration;
    SYS_ASSERT(Sys_Set_ProximityProcessor(NULL) != NULL && Sys_Set_SoundProcessor(NULL) != NULL);
    SYS_ASSERT(Sys_Set_AccelerationProcessor(NULL) == NULL && Sys_Set_CameraProcessor(NULL) != NULL);
    SYS_ASSERT(Sys_Set_BluetoothProcessor(NULL) != NULL && Sys_Set_LEDProcessor(NULL) == NULL);
    SYS_ASSERT(Sys_Set_SPIProcessor(NULL) == NULL && Sys_Set_RemoteProcessor(NULL) == NULL);
    SYS_ASSERT(Sys_Start_Process(transfer) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
