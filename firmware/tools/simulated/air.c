/* Infrared channel between several Kilobots (kilobots.py): carries light from emitters to the comparators and
 * converters of other robots, and runs all robots in lock step.
 *
 * Times are cycles since the first robot's power-on. The robot with the earliest time runs up to the time of the next
 * one, so no pulse arrives late, and every run is the same. Light takes DELAY cycles from emitter to comparator, so it
 * arrives in the future even of a receiver that is an instruction ahead.
 *
 * simavr models no conversion that the comparator or a capture starts; this file starts it. simavr reads a channel's
 * voltage when the program reads the result, so the voltage is kept until the next pulse. */
#include "simavr.h"

#include <avr_acomp.h>
#include <avr_adc.h>
#include <avr_ioport.h>
#include <stdbool.h>
#include <stdlib.h>

enum {
    ROBOTS = 32,
    DELAY = 8,       /* cycles */
    STRAY = 9,       /* cycles of a noise pulse, equal to those of the link's pulses */
    EMITTERS = 0xC7, /* of port B */
    DARK_MV = 0,
    REFERENCE_MV = 500, /* of the comparator */
    LIT_MV = 1000,
    AREF_MV = 3300,
    FULL_SCALE = 1023,
    BATTERY_MV = 2000,
    BATTERY_NOISE_MV = 31,
    ADCSRB = 0x7B,
    TRIGGERS = 7,
    BY_COMPARATOR = 1,
    BY_CAPTURE = 7, /* the comparator drives the capture unit */
    SLEEP = 0x9588 /* the instruction */
};

typedef struct air air;

typedef struct {
    struct place *to;
    uint16_t high, low; /* counts at the two gains; both 0: out of reach */
    uint16_t loss;      /* of 65,536 pulses */
    bool is_on;         /* the receiver sees the light */
    bool is_hidden;     /* the current pulse is lost */
} path;

typedef struct place {
    air *air;
    machine *machine;
    uint64_t since; /* time of its power-on */
    uint32_t noise;
    uint8_t lit;  /* number of lights it sees */
    uint8_t pins; /* emitter pins that are on */
    path to[ROBOTS];
    path stray;
} place;

struct air {
    int count;
    uint32_t random;
    place places[ROBOTS];
};

static uint32_t draw(uint32_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 17;
    *state ^= *state << 5;
    return *state;
}

static uint64_t now(const place *p)
{
    return p->since + p->machine->avr->cycle;
}

static void set_mv(place *p, uint32_t kind, int index, uint32_t mv)
{
    avr_raise_irq(avr_io_getirq(p->machine->avr, kind, index), mv);
}

static uint32_t as_mv(uint16_t counts)
{
    return ((uint32_t)counts * AREF_MV + FULL_SCALE - 1) / FULL_SCALE;
}

static avr_cycle_count_t light_comes(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
    path *from = parameter;
    place *p = from->to;
    (void)avr, (void)when;
    from->is_on = true;
    set_mv(p, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0, as_mv(from->high));
    set_mv(p, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC1, as_mv(from->low));
    if (p->lit++ == 0) {
        set_mv(p, AVR_IOCTL_ACOMP_GETIRQ, ACOMP_IRQ_AIN0, LIT_MV);
    }
    return 0;
}

static avr_cycle_count_t light_goes(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
    path *from = parameter;
    place *p = from->to;
    (void)avr, (void)when;
    if (from->is_on) {
        from->is_on = false;
        if (--p->lit == 0) {
            set_mv(p, AVR_IOCTL_ACOMP_GETIRQ, ACOMP_IRQ_AIN0, DARK_MV);
        }
    }
    return 0;
}

static void later(path *way, uint64_t at, avr_cycle_timer_t what)
{
    uint64_t here = now(way->to);
    avr_cycle_timer_register(way->to->machine->avr, at > here ? at - here : 1, what, way);
}

static void emitter_changed(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    place *p = parameter;
    uint8_t before = p->pins, pin = (uint8_t)(1u << irq->irq);
    p->pins = (uint8_t)(value ? before | pin : before & ~pin);
    if ((before == 0) == (p->pins == 0)) {
        return;
    }
    for (int i = 0; i < p->air->count; i++) {
        path *way = &p->to[i];
        if (way->high == 0 && way->low == 0) {
            continue;
        }
        if (p->pins != 0) {
            way->is_hidden = (draw(&p->air->random) & 0xFFFF) < way->loss;
        }
        if (!way->is_hidden) {
            later(way, now(p) + DELAY, p->pins != 0 ? light_comes : light_goes);
        }
    }
}

static void comparator_changed(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    place *p = parameter;
    avr_t *avr = p->machine->avr;
    (void)irq;
    uint8_t trigger = avr->data[ADCSRB] & TRIGGERS;
    if (value != 0 && (trigger == BY_COMPARATOR || trigger == BY_CAPTURE)) {
        avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_IN_TRIGGER), 1);
    }
}

static void conversion_begins(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    place *p = parameter;
    (void)irq, (void)value;
    set_mv(p, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC6, BATTERY_MV + (draw(&p->noise) & BATTERY_NOISE_MV));
}

air *air_open(uint32_t seed)
{
    air *a = calloc(1, sizeof *a);
    if (a != NULL) {
        a->random = seed * 2654435761u | 1u;
    }
    return a;
}

/* The caller that opened the machines owns them. */
void air_close(air *a)
{
    free(a);
}

/* Adds a robot with a power-on time; returns its index, or -1: full. It is not in reach of any robot yet. */
int air_join(air *a, machine *m, uint64_t since)
{
    if (a->count == ROBOTS) {
        return -1;
    }
    place *p = &a->places[a->count];
    p->air = a;
    p->machine = m;
    p->since = since;
    p->noise = draw(&a->random);
    p->stray.to = p;
    m->avr->aref = AREF_MV;
    for (int i = 0; i <= a->count; i++) {
        p->to[i].to = &a->places[i];
        a->places[i].to[a->count].to = p;
    }
    for (int pin = 0; pin < 8; pin++) {
        if (EMITTERS & 1 << pin) {
            avr_irq_register_notify(avr_io_getirq(m->avr, AVR_IOCTL_IOPORT_GETIRQ('B'), pin), emitter_changed, p);
        }
    }
    avr_irq_register_notify(avr_io_getirq(m->avr, AVR_IOCTL_ACOMP_GETIRQ, ACOMP_IRQ_OUT), comparator_changed, p);
    avr_irq_register_notify(avr_io_getirq(m->avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_OUT_TRIGGER), conversion_begins, p);
    set_mv(p, AVR_IOCTL_ACOMP_GETIRQ, ACOMP_IRQ_AIN1, REFERENCE_MV);
    return a->count++;
}

/* Sets the counts at which `to` receives `from`, and the lost pulses of 65,536; both may be the same robot. */
void air_link(air *a, int from, int to, uint16_t high, uint16_t low, uint16_t loss)
{
    path *way = &a->places[from].to[to];
    way->high = high;
    way->low = low;
    way->loss = loss;
}

/* Adds a noise pulse at one robot, `after` cycles from now. */
void air_flash(air *a, int at, uint32_t after, uint16_t high, uint16_t low)
{
    path *way = &a->places[at].stray;
    uint64_t when = now(way->to) + after;
    way->high = high;
    way->low = low;
    later(way, when, light_comes);
    avr_cycle_timer_register(way->to->machine->avr, after + STRAY, light_goes, way);
}

static avr_cycle_count_t wake(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
    (void)avr, (void)when, (void)parameter;
    return 0;
}

/* Returns the earliest time at which a robot acts: if it sleeps, when its next timer is due. */
static uint64_t acts_at(const place *p)
{
    const avr_t *avr = p->machine->avr;
    if (avr->state != cpu_Sleeping || avr->cycle_timers.timer == NULL || avr->cycle_timers.timer->when <= avr->cycle) {
        return now(p);
    }
    return p->since + avr->cycle_timers.timer->when;
}

static int advance(place *p, uint64_t others)
{
    avr_t *avr = p->machine->avr;
    uint64_t here = now(p);
    bool falls_asleep = avr->flash[avr->pc] == (SLEEP & 0xFF) && avr->flash[avr->pc + 1] == SLEEP >> 8;
    if (avr->state == cpu_Sleeping || falls_asleep) { /* in this step; ends before another robot acts */
        avr_cycle_timer_register(avr, others > here + 2 ? others - here : 2, wake,
                                 p); /* behind the sleep instruction */
    }
    return machine_step(p->machine);
}

/* Runs all robots until a time. Returns -1, or the index of a robot that stopped or crashed. */
int air_run(air *a, uint64_t until)
{
    for (;;) {
        uint64_t first = until, second = until;
        place *next = NULL;
        for (int i = 0; i < a->count; i++) {
            uint64_t at = acts_at(&a->places[i]);
            if (at < first) {
                second = first;
                first = at;
                next = &a->places[i];
            } else if (at < second) {
                second = at;
            }
        }
        if (next == NULL) {
            return -1;
        }
        if (advance(next, second) != RUNS_ON) {
            return (int)(next - a->places);
        }
    }
}
