/* Edge following: the robot with UID 0 moves clockwise around robots that stand and send, 50 mm from the nearest one. */
#include <kilolib.h>

enum { WANTED_MM = 50, WINDOW_TICKS = 6, LOST_TICKS = 60 };
enum { STAND, LEFT, RIGHT };

static message_t message;
volatile uint8_t nearest = 255, moving;
static volatile uint32_t heard_at;

static message_t *to_send(void)
{
    return kilo_uid == 0 ? 0 : &message;
}

static void received(message_t *m, distance_measurement_t *d)
{
    (void)m;
    uint8_t distance = estimate_distance(d);
    if (distance < nearest) {
        nearest = distance;
    }
    heard_at = kilo_ticks;
}

static void move(uint8_t how)
{
    static const uint8_t colours[] = {RGB(0, 0, 0), RGB(1, 0, 0), RGB(0, 0, 1)};
    if (moving == how) {
        return;
    }
    moving = how;
    set_color(colours[how]);
    if (how == STAND) {
        set_motors(0, 0);
        return;
    }
    set_motors(how == LEFT ? 255 : 0, how == RIGHT ? 255 : 0);
    delay(15);
    set_motors(how == LEFT ? kilo_turn_left : 0, how == RIGHT ? kilo_turn_right : 0);
}

static void setup(void)
{
    kilo_tx_period = 1200; /* about six messages a second */
    message.type = NORMAL;
    message.crc = message_crc(&message);
    set_color(kilo_uid == 0 ? RGB(0, 0, 0) : RGB(1, 1, 0));
}

static void loop(void)
{
    static uint32_t decided_at;
    if (kilo_uid != 0 || kilo_ticks < decided_at + WINDOW_TICKS) {
        return;
    }
    decided_at = kilo_ticks;
    if (kilo_ticks > heard_at + LOST_TICKS) {
        move(STAND);
    } else if (nearest != 255) {
        move(nearest < WANTED_MM ? LEFT : RIGHT);
        nearest = 255;
    }
}

int main(void)
{
    kilo_init();
    kilo_message_tx = to_send;
    kilo_message_rx = received;
    kilo_start(setup, loop);
    return 0;
}
