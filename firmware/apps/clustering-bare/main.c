/* Object clustering without a kernel (README.md): a loop that waits for frames. */
#include <stdbool.h>

#include "bare.h"
#include "camera_sensor.h"
#include "controller.h"
#include "i2c_master.h"
#include "line_of_sight.h"
#include "pins.h"

/* 7.3728 MHz crystal, PLL x8 (epuck.md §2). */
_FOSC(CSW_FSCM_OFF & XT_PLL8);
_FWDT(WDT_OFF);
_FBORPOR(PBOR_OFF & MCLR_EN);
_FGS(CODE_PROT_OFF);

static const clustering_controller controllers[2] = {CONTROLLER_A, CONTROLLER_B};
static uint8_t frame[CAMERA_FRAME_BYTES];

static void pins_init(void)
{
    LATC &= (uint16_t)~(PIN_FRONT_LED | PIN_CAMERA_RESET);
    TRISC &= (uint16_t)~(PIN_FRONT_LED | PIN_CAMERA_RESET);
}

static bool set_running(bool wanted)
{
    if (wanted) {
        LATC |= PIN_FRONT_LED;
    } else {
        LATC &= (uint16_t)~PIN_FRONT_LED;
        motors_drive(0, 0);
    }
    return wanted;
}

static void react(const clustering_controller *controller, uint8_t colour)
{
    const wheel_speeds *speeds = colour == SIGHT_RED     ? &controller->object
                                 : colour == SIGHT_GREEN ? &controller->robot
                                                         : &controller->nothing;
    motors_drive(speeds->left, speeds->right);
}

int main(void)
{
    pins_init();
    uint8_t selector = (uint8_t)(PORTG >> PIN_SELECTOR_SHIFT & 15u);
    const clustering_controller *controller = &controllers[selector & SELECT_B];
    motors_init();
    rc5_init();
    bool running = set_running(CLUSTERING_START_AT_ONCE || (selector & SELECT_START) != 0);
    i2c_init();
    if (camera_sensor_init() != CAMERA_NONE) {
        camera_capture_init();
        camera_capture_next(frame);
    }
    for (;;) {
        uint8_t key = rc5_take();
        if (key == KEY_OK) {
            running = set_running(true);
        } else if (key == KEY_STANDBY || key == KEY_SLEEP) {
            running = set_running(false);
        }
        if (IFS2bits.OC8IF) {
            IFS2bits.OC8IF = 0;
            if (running) {
                react(controller, line_of_sight(frame));
            }
            camera_capture_next(frame);
        }
        Idle(); /* the motors' interrupt ends it within 0.1 ms */
    }
}
