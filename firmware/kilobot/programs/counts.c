/* Counts: each robot sends its UID as often as it may, and counts what it sends and receives in 4,800 ticks. */
#include <kilolib.h>

enum { ROBOTS = 25, TICKS = 4800 };

static message_t message;
volatile uint16_t sent, received[ROBOTS];
volatile uint32_t first_tick;
volatile uint8_t is_over;

static message_t *to_send(void)
{
    return is_over ? 0 : &message;
}

static void sent_one(void)
{
    sent++;
}

static void received_one(message_t *m, distance_measurement_t *d)
{
    (void)d;
    if (m->data[0] < ROBOTS && !is_over) {
        received[m->data[0]]++;
    }
}

static void setup(void)
{
    first_tick = kilo_ticks;
    message.data[0] = (uint8_t)kilo_uid;
    message.type = NORMAL;
    message.crc = message_crc(&message);
}

static void loop(void)
{
    is_over = kilo_ticks - first_tick >= TICKS;
    set_color(is_over ? RGB(0, 1, 0) : RGB(1, 0, 0));
}

int main(void)
{
    kilo_init();
    kilo_message_tx = to_send;
    kilo_message_tx_success = sent_one;
    kilo_message_rx = received_one;
    kilo_start(setup, loop);
    return 0;
}
