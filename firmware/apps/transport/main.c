/* Transport (README.md): push the red object only where it hides the green goal. After Chen et al., IEEE Transactions on
 * Robotics 31 (2015). It starts at once. */
#include <analog.h>
#include <camera.h>
#include <openswarm.h>
#include <openswarm_io.h>

enum { AHEAD = 120, TURN = 40, ALONG = 78 };                          /* wheel speeds, mm/s */
enum { TOUCH_MM = 38, NEAR_MM = 60, BESIDE_MM = 48 };                 /* to a white surface; others seem farther */
enum { FRONT_RIGHT, RIGHT_AHEAD, RIGHT, LEFT_AHEAD = 6, FRONT_LEFT }; /* proximity sensors, clockwise */
/* Times in ticks of 50 ms: a turn on the spot, with a tenth in reserve; pushing; following the edge; after which an
 * object out of sight is lost; between two changes of a random arc; to approach. */
enum { ROUND = 88, PUSHING = 160, FOLLOWING = 80, LOST = 30, WANDER = 120, PATIENCE = 1200 };

typedef enum { SEARCH, APPROACH, LEAVE, LOOK, PUSH, FOLLOW } state;
static state now = SEARCH;
static uint16 elapsed, unseen; /* ticks in this state, and since the object was in sight */
static bool to_left;           /* direction of turns */
static sys_colour ahead;       /* answer of the line-of-sight sensor */
static sint16 bias;            /* half the difference of the wheel speeds on a random arc, mm/s */
static uint16 chance = 1;      /* state of the random generator, not 0 */

static uint16 draw(void)
{
    chance = (uint16)(chance >> 1 ^ (chance & 1 ? 0xB400 : 0)); /* 16-bit LFSR, x^16 + x^14 + x^13 + x^11 + 1 */
    return chance;
}

static void drive(sint16 left, sint16 right)
{
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, (uint16)left);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)right);
}

static void spin(bool left, sint16 speed)
{
    drive(left ? -speed : speed, left ? speed : -speed);
}

static void enter(state next)
{
    now = next;
    elapsed = 0;
    Sys_Set_LED(SYS_LED_BODY, next == PUSH);
    Sys_Set_LED(SYS_LED_FRONT, next == FOLLOW);
}

static sint16 limited(sint16 value, sint16 most)
{
    return value > most ? most : value < -most ? -most : value;
}

/* Returns by how many mm the distances of two sensors are below NEAR_MM, added up; 0 without a body near. */
static sint16 nearness(uint8 one, uint8 other)
{
    return (sint16)((one < NEAR_MM ? NEAR_MM - one : 0) + (other < NEAR_MM ? NEAR_MM - other : 0));
}

/* Drives, or turns away from a body ahead. */
static void avoid(sint16 left, sint16 right, sint16 on_left, sint16 on_right)
{
    if (on_left + on_right > 0)
        spin(on_left <= on_right, TURN);
    else
        drive(left, right);
}

static void search(sint16 on_left, sint16 on_right)
{
    if (ahead == RED) {
        enter(APPROACH);
        drive(AHEAD, AHEAD);
    } else if (elapsed < ROUND) {
        spin(to_left, TURN);
    } else {
        if (elapsed % WANDER == 0)
            bias = (sint16)(draw() % 41) - 20;
        avoid((sint16)(AHEAD + bias), (sint16)(AHEAD - bias), on_left, on_right);
    }
}

static void approach(bool touches)
{
    if (ahead == RED) {
        drive(AHEAD, AHEAD);
        if (touches)
            enter(LOOK);
    } else if (unseen > 2 * LOST || elapsed > PATIENCE) {
        to_left = !to_left;
        enter(SEARCH);
    } else if (touches) {
        to_left = (draw() & 1) != 0;
        enter(LEAVE);
    } else {
        spin((unseen < LOST / 2) == to_left, TURN / 2);
    }
}

/* Turns away from a body that is not the object, and drives on. */
static void leave(sint16 on_left, sint16 on_right)
{
    if (elapsed < 16)
        spin(!to_left, TURN);
    else if (elapsed < 50)
        avoid(AHEAD, AHEAD, on_left, on_right);
    else
        enter(SEARCH);
}

/* Turns once, and on until the object is ahead. A robot that does not see it in a second turn searches. */
static void look(void)
{
    spin(true, TURN);
    if (ahead == GREEN)
        enter(FOLLOW);
    else if (elapsed >= ROUND && ahead == RED)
        enter(PUSH);
    else if (elapsed >= 2 * ROUND)
        enter(SEARCH);
}

static void push(sint16 on_left, sint16 on_right)
{
    sint16 steer = limited((sint16)(on_right - on_left), 30);
    drive((sint16)(AHEAD + steer), (sint16)(AHEAD - steer));
    if (ahead == GREEN || elapsed > PUSHING)
        enter(LOOK);
    else if (unseen > LOST)
        enter(SEARCH);
}

/* Moves along the edge of the object, which is on the right. */
static void follow(const uint8 *mm)
{
    sint16 steer = limited((sint16)(2 * (BESIDE_MM - (mm[RIGHT] < mm[RIGHT_AHEAD] ? mm[RIGHT] : mm[RIGHT_AHEAD]))), 25);
    if (elapsed > FOLLOWING) {
        to_left = false;
        unseen = 0;
        enter(SEARCH);
    } else if (mm[FRONT_RIGHT] < NEAR_MM || nearness(mm[FRONT_LEFT], mm[LEFT_AHEAD]) > 0) {
        spin(true, TURN);
    } else {
        drive((sint16)(ALONG - steer), (sint16)(ALONG + steer));
    }
}

static bool control(uint16 pid, uint16 event, sys_event_data *data)
{
    const uint8 *mm = data->payload;
    sint16 on_right = nearness(mm[FRONT_RIGHT], mm[RIGHT_AHEAD]), on_left = nearness(mm[FRONT_LEFT], mm[LEFT_AHEAD]);
    bool touches = mm[FRONT_RIGHT] < TOUCH_MM || mm[FRONT_LEFT] < TOUCH_MM;
    (void)pid;
    (void)event;
    chance ^= (uint16)(mm[RIGHT] << 3 ^ mm[LEFT_AHEAD]); /* all robots start with the same number */
    chance |= chance == 0;
    elapsed++;
    unseen = ahead == RED ? 0 : unseen + 1;
    switch (now) {
    case SEARCH:
        search(on_left, on_right);
        break;
    case APPROACH:
        approach(touches);
        break;
    case LEAVE:
        leave(on_left, on_right);
        break;
    case LOOK:
        look();
        break;
    case PUSH:
        push(on_left, on_right);
        break;
    case FOLLOW:
        follow(mm);
        break;
    }
    return true;
}

static bool see(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    ahead = (sys_colour)data->value;
    return true;
}

int main(void)
{
    Sys_Init_Kernel();
    Sys_Start_Analog();
    Sys_Start_Camera();
    Sys_Subscribe_to_Event(SYS_IO_PROXIMITY, 0, control, NULL);
    Sys_Subscribe_to_Event(SYS_IO_1PXSENSOR, 0, see, NULL);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
