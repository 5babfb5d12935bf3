/* Orbit: the star (UID 0) stands and sends; a planet keeps 60 mm around it, and below 40 mm goes straight. */
#include <kilolib.h>

enum { NEAR_MM = 40, WANTED_MM = 60, LOST_TICKS = 60 };
enum { STAND, LEFT, RIGHT, STRAIGHT };

static message_t message;
volatile uint8_t distance, moving;
static volatile uint8_t is_new;
static volatile uint32_t heard_at;

static message_t *to_send(void)
{
    return kilo_uid == 0 ? &message : 0;
}

static void received(message_t *m, distance_measurement_t *d)
{
    (void)m;
    distance = estimate_distance(d);
    heard_at = kilo_ticks;
    is_new = 1;
}

static void move(uint8_t how)
{
    static const uint8_t colours[] = {RGB(0, 0, 0), RGB(1, 0, 0), RGB(0, 0, 1), RGB(0, 1, 0)};
    if (moving == how) {
        return;
    }
    moving = how;
    set_color(colours[how]);
    if (how == STAND) {
        set_motors(0, 0);
        return;
    }
    uint8_t left = how != RIGHT, right = how != LEFT;
    set_motors(left ? 255 : 0, right ? 255 : 0);
    delay(15);
    set_motors(how == STRAIGHT ? kilo_straight_left : left ? kilo_turn_left : 0,
               how == STRAIGHT ? kilo_straight_right : right ? kilo_turn_right : 0);
}

static void setup(void)
{
    kilo_tx_period = 700; /* ten messages a second */
    message.type = NORMAL;
    message.crc = message_crc(&message);
}

static void loop(void)
{
    if (kilo_uid == 0) {
        set_color(RGB(1, 1, 0));
        return;
    }
    if (kilo_ticks > heard_at + LOST_TICKS) {
        move(STAND);
    } else if (is_new) {
        is_new = 0;
        move(distance < NEAR_MM ? STRAIGHT : distance < WANTED_MM ? LEFT : RIGHT);
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
