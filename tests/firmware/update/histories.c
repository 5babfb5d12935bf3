/* Random histories: true and false advertisements, requests, and data of all programs, half of the histories with two
 * programs of one version; power failures and resets. Finally all neighbours fall silent. */
#include "neighbours.c"

enum { HISTORIES = 150, STEPS = 3000 };

static void something(void)
{
    int n = (int)chance(PROGRAMS);
    sys_update facts = programs[n].facts;
    uint8 m[SYS_SPREAD_BYTES];
    for (int i = 0; i < SYS_SPREAD_BYTES; i++) {
        m[i] = (uint8)chance(256);
    }
    switch (chance(16)) {
    case 0:
    case 1:
        hear_advertisement(facts, chance(2));
        break;
    case 2: /* a false advertisement */
        facts.rows = (uint8)chance(256);
        facts.version = (uint16)(chance(3) == 0 ? 65535 : chance(20));
        hear_advertisement(facts, chance(2));
        break;
    case 3: /* a request for the stored program */
        m[0] = (uint8)(REQUEST | (m[0] & ROW));
        m[1] = (uint8)have.version;
        m[2] = (uint8)(have.version >> 8);
        m[6] = (uint8)identity(&have);
        m[7] = (uint8)(identity(&have) >> 8);
        Sys_Hear_Update(now, m);
        break;
    case 4:
        hear_part(n, (uint8)chance(facts.rows), (uint8)chance(PARTS));
        break;
    case 5:
    case 6:
    case 7:
        hear_what_is_wanted(8);
        break;
    case 8:
        Sys_Offer_Activation(have.version);
        break;
    case 9:
        Sys_Confirm_Update();
        break;
    case 10:
        cut_in = chance(4) == 0 ? (int)chance(12) : cut_in;
        break;
    case 11:
        stuck = sticks && chance(8) == 0 ? cells[chance(SLOTS)][chance(5)] : NULL;
        break;
    case 12:
        if (chance(8) == 0) {
            boot();
        }
        break;
    case 13:
        Sys_Hear_Update(now, m);
        break;
    default:
        for (uint32 ticks = chance(6); ticks-- != 0;) {
            tick();
        }
    }
}

/* After any history a robot that receives no message sends few, and after some minutes only its advertisement. */
static void silence(void)
{
    forget_kinds();
    for (int n = 0; n < 10 * MINUTE; n++) {
        tick();
    }
    check(kinds[REQUESTED] <= MOST_ASKED && kinds[SENT] <= PARTS && kinds[ADVERTISED] <= 20,
          "in silence it falls silent");
    forget_kinds();
    for (int n = 0; n < 10 * MINUTE; n++) {
        tick();
    }
    check(kinds[REQUESTED] == 0 && kinds[SENT] == 0 && kinds[ADVERTISED] <= 11, "and stays so");
    check(kinds[PROVED] == (IS_AUTHENTICATED && have.version != 0 ? kinds[ADVERTISED] : 0), "each is proved");
}

static void histories(void)
{
    while (history < HISTORIES) {
        static int steps;
        begin_history(history % 3 == 2);
        steps = 0;
        setjmp(power_off);
        cut_in = NEVER;
        for (boot(); steps < STEPS; steps++) {
            something();
        }
        cut_in = NEVER;
        silence();
    }
}
