/* Foraging (README.md): wander until the camera shows food, which is red, drive at it, carry it to the lamp over the
 * nest. The arena reports by Bluetooth that the robot has found food ("food") or has reached the nest ("nest"). The
 * robot starts at once. */
#include <analog.h>
#include <bluetooth.h>
#include <camera.h>
#include <openswarm.h>
#include <openswarm_io.h>

enum { CRUISE = 100, SPIN = 60, NEAR_MM = 40, BLOCKED = 50 };
enum { FRONT_RIGHT, RIGHT, BACK_RIGHT, REAR_RIGHT, REAR_LEFT, BACK_LEFT, LEFT, FRONT_LEFT, AROUND };
enum { STRAIGHT_TICKS = 50, TURN_TICKS = 16, AWAY_TICKS = 24 }; /* of 50 ms */

static bool loaded, sees_food;
static uint8 turning; /* ticks left */
static bool to_left;
static uint16 chance = 1;

static void drive(sint16 left, sint16 right)
{
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, (uint16)left);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)right);
}

static uint16 draw(void)
{
    chance = (uint16)(chance >> 1 ^ (chance & 1 ? 0xB400 : 0)); /* 16-bit LFSR, x^16 + x^14 + x^13 + x^11 + 1 */
    return chance;
}

static void spin(void)
{
    drive(to_left ? -SPIN : SPIN, to_left ? SPIN : -SPIN);
}

static void wander(void)
{
    static uint8 straight;
    if (turning > 0) {
        turning--;
        spin();
    } else if (straight == 0) {
        straight = (uint8)(STRAIGHT_TICKS + (draw() & 63));
        turning = (uint8)(draw() % TURN_TICKS);
        to_left = (draw() & 1) != 0;
    } else {
        straight--;
        drive(CRUISE, CRUISE);
    }
}

/* Light lowers a sensor's counts. If the lamp is behind the robot, it turns on the spot; else it steers to the lamp. */
static void seek_light(void)
{
    sint16 right = 0, left = 0, front, rear;
    for (uint8 sensor = FRONT_RIGHT; sensor < AROUND; sensor++) {
        sint16 dark = (sint16)Sys_Get_AmbientLight(sensor);
        *(sensor < REAR_LEFT ? &right : &left) += dark / 4;
    }
    front = (sint16)(Sys_Get_AmbientLight(FRONT_RIGHT) / 2 + Sys_Get_AmbientLight(FRONT_LEFT) / 2);
    rear = (sint16)(Sys_Get_AmbientLight(REAR_RIGHT) / 2 + Sys_Get_AmbientLight(REAR_LEFT) / 2);
    if (rear < front) {
        to_left = left < right;
        spin();
    } else {
        sint16 bend = (sint16)((right - left) / 8); /* positive: the lamp is to the left */
        bend = bend > CRUISE / 2 ? CRUISE / 2 : bend < -CRUISE / 2 ? -CRUISE / 2 : bend;
        drive((sint16)(CRUISE - CRUISE / 4 - bend), (sint16)(CRUISE - CRUISE / 4 + bend));
    }
}

static sint16 nearness(const uint8 *mm, uint8 sensor)
{
    return mm[sensor] < NEAR_MM ? (sint16)(NEAR_MM - mm[sensor]) : 0;
}

static bool live(uint16 pid, uint16 event, sys_event_data *data)
{
    const uint8 *mm = data->payload;
    sint16 right = (sint16)(2 * nearness(mm, FRONT_RIGHT) + nearness(mm, RIGHT));
    sint16 left = (sint16)(2 * nearness(mm, FRONT_LEFT) + nearness(mm, LEFT));
    (void)pid;
    (void)event;
    chance ^=
        (uint16)(Sys_Get_AmbientLight(BACK_LEFT) << 3); /* robots at other places draw other random numbers */
    chance |= chance == 0;
    if (sees_food && !loaded) {
        drive(CRUISE, CRUISE);
    } else if (right + left > BLOCKED || (turning > 0 && right + left > 0)) {
        to_left = right >= left;
        spin();
    } else if (right + left > 0) {
        drive((sint16)(CRUISE - 2 * right), (sint16)(CRUISE - 2 * left));
    } else if (loaded) {
        seek_light();
    } else {
        wander();
    }
    return true;
}

static bool look(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    sees_food = (sys_colour)data->value == RED;
    Sys_Set_LED(SYS_LED_FRONT, sees_food);
    return true;
}

static bool listen(uint16 pid, uint16 event, sys_event_data *data)
{
    const char *word = data->payload;
    (void)pid;
    (void)event;
    if (data->size >= 4 && (word[0] == 'f' || word[0] == 'n')) {
        loaded = word[0] == 'f';
        turning = loaded ? 0 : AWAY_TICKS;
        Sys_Set_LED(SYS_LED_BODY, loaded);
    }
    return true;
}

int main(void)
{
    Sys_Init_Kernel();
    Sys_Start_Analog();
    Sys_Start_Camera();
    Sys_Start_Bluetooth();
    Sys_Subscribe_to_Event(SYS_IO_PROXIMITY, 0, live, NULL);
    Sys_Subscribe_to_Event(SYS_IO_1PXSENSOR, 0, look, NULL);
    Sys_Subscribe_to_Event(SYS_BLUETOOTH_RECEIVED, 0, listen, NULL);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
