/* Synchronised blinking: each robot blinks every 50 ticks, sends its phase, and moves its own toward those it hears. */
#include <kilolib.h>

enum { PERIOD = 50, WEIGHT = 4, SHARE = 120, MOST = 30, BLINK_TICKS = 3 };

static message_t message;
volatile uint32_t blinks;
static volatile int32_t correction;
static uint32_t next = PERIOD;

static uint8_t phase(void)
{
    int32_t left = (int32_t)(next - kilo_ticks);
    return (uint8_t)(left > PERIOD ? 0 : left < 0 ? PERIOD - 1 : PERIOD - left);
}

static message_t *to_send(void)
{
    message.type = NORMAL;
    message.data[0] = phase();
    message.crc = message_crc(&message);
    return &message;
}

static void received(message_t *m, distance_measurement_t *d)
{
    (void)d;
    int16_t difference = (int16_t)m->data[0] - phase();
    if (difference > PERIOD / 2) {
        difference -= PERIOD;
    } else if (difference < -PERIOD / 2) {
        difference += PERIOD;
    }
    correction -= difference * WEIGHT;
}

static void setup(void)
{
    next = kilo_ticks + PERIOD + (kilo_uid * 7) % PERIOD;
}

static void loop(void)
{
    if ((int32_t)(kilo_ticks - next) < 0) {
        return;
    }
    int32_t by = correction / SHARE;
    correction = 0;
    by = by > MOST ? MOST : by < -MOST ? -MOST : by;
    next += PERIOD + by;
    blinks++;
    set_color(RGB(1, 1, 1));
    delay(BLINK_TICKS * 33);
    set_color(RGB(0, 0, 0));
}

int main(void)
{
    kilo_init();
    kilo_message_tx = to_send;
    kilo_message_rx = received;
    kilo_start(setup, loop);
    return 0;
}
