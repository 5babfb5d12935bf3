/* Gradient: the robot with UID 0 sends 0, every other one the least number it hears plus 1, shown as a colour. */
#include <kilolib.h>

enum { FAR = 255, PATIENCE = 60 };

static message_t message;
volatile uint8_t gradient = FAR, heard = FAR, distance;
static volatile uint32_t heard_at;

static message_t *to_send(void)
{
    message.data[0] = gradient;
    message.type = NORMAL;
    message.crc = message_crc(&message);
    return gradient == FAR ? 0 : &message;
}

static void received(message_t *m, distance_measurement_t *d)
{
    distance = estimate_distance(d);
    if (m->data[0] <= heard) {
        heard = m->data[0];
        heard_at = kilo_ticks;
    }
}

static void setup(void)
{
    gradient = kilo_uid == 0 ? 0 : FAR;
}

static void loop(void)
{
    static const uint8_t colours[] = {RGB(1, 0, 0), RGB(1, 1, 0), RGB(0, 1, 0),
                                      RGB(0, 1, 1), RGB(0, 0, 1), RGB(1, 0, 1)};
    if (kilo_uid != 0) {
        if (kilo_ticks > heard_at + PATIENCE) {
            heard = FAR;
        }
        gradient = heard == FAR ? FAR : heard + 1;
    }
    set_color(gradient == FAR ? RGB(0, 0, 0) : colours[gradient % 6]);
}

int main(void)
{
    kilo_init();
    kilo_message_tx = to_send;
    kilo_message_rx = received;
    kilo_start(setup, loop);
    return 0;
}
