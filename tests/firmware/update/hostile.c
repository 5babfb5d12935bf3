/* Neighbours that send true and false messages to a robot with faulty cells: random histories, then one attack of each
 * kind. The robot must only call whole programs, and only send parts of whole programs. */
#include "histories.c"

/* An advertised program that no robot sends does not block an available one, however often it is advertised. */
static void promise(bool is_repeated)
{
    sys_update false_one = {65535, HAL_UPDATE_ROWS, 1};
    hear_advertisement(false_one, false);
    check((want.version == 65535) != IS_AUTHENTICATED, "it is believed at first, if no proof is needed");
    for (int n = 0; n < 4 * MINUTE && have.version != programs[PROGRAMS - 1].facts.version; n++) {
        tick();
        if (is_repeated) {
            hear_advertisement(false_one, false);
        }
        hear_advertisement(programs[PROGRAMS - 1].facts, false);
        hear_what_is_wanted(8);
    }
    check(have.version == programs[PROGRAMS - 1].facts.version, "the true one comes in four minutes");
    forget_kinds();
    for (int n = 0; n < 60 * MINUTE; n++) {
        tick();
        hear_advertisement(false_one, false);
    }
    check((want.version == 65535) != IS_AUTHENTICATED &&
              kinds[REQUESTED] <= (IS_AUTHENTICATED ? 0 : 60 * 60 * 1000 / (PATIENCE << DOUBLINGS)),
          "it is asked for seldom, or never if a proof is needed");
}

/* Of two programs with one version the robot completes the one it has begun, even if it first hears parts of the
 * other. */
static void namesakes(int wanted, int other)
{
    sys_update facts = programs[other].facts;
    check(facts.version == programs[wanted].facts.version && facts.crc != programs[wanted].facts.crc,
          "two of one version");
    hear_advertisement(programs[wanted].facts, false);
    for (int n = 0; n < 100 && have.version != facts.version; n++) {
        for (uint8 part = 0; part < PARTS && row < facts.rows; part++) {
            hear_part(other, row, part);
        }
        hear_what_is_wanted(8);
        hear_advertisement(facts, true);
        tick();
    }
    check(have.version == facts.version && have.crc == programs[wanted].facts.crc, "the one that was begun");
    check(!is_active, "that the other one is activated does not concern it");
    begin_interval(SHORTEST);
    hear_advertisement(facts, false);
    check(heard == 0, "nor has anybody said the same by naming the other");
    for (uint8 r = 0; r < facts.rows; r++) { /* a request for rows of the other program gets no parts */
        uint8 m[SYS_SPREAD_BYTES];
        sys_update own = want;
        want = facts, row = r, lacking = ALL_PARTS;
        ask(m);
        want = own;
        Sys_Hear_Update(now, m);
        check(wanted_parts == 0, "requests are for one program");
    }
}

/* A robot that never stops requesting rows (one row, or all in turn) gets only few parts. Requests of other robots and
 * due messages are still served. */
static void nagged(bool for_all_rows)
{
    int n = PROGRAMS - 1, rows = programs[n].facts.rows, last = rows - 1, requests = 0;
    uint32 got = 0;
    take(n);
    begin_interval(SHORTEST);
    forget_kinds();
    for (int t = 0; t < MOST_SERVED; t++) {
        hear_request(n, (uint8)(t % rows), ALL_PARTS);
        check(wanted_parts != 0, "there is always something to serve");
        tick();
    }
    check(kinds[ADVERTISED] >= 2, "that does not keep it from advertising");
    forget_kinds();
    for (int t = 0; t < 60 * MINUTE; t++) {
        if (t % 6 == 0) {
            hear_request(n, (uint8)(for_all_rows ? requests % rows : 0), ALL_PARTS);
            requests++;
        }
        tick();
    }
    check(kinds[SENT] <= requests + (MOST_SERVED + PARTS + 3600000 / FORGIVEN) * (for_all_rows ? rows : 1),
          "one part for a request");
    check(kinds[ADVERTISED] >= 30, "it advertises all the same");
    for (int t = 0; t < 60 * MINUTE && got != ALL_PARTS; t++) {
        uint8 m[SYS_SPREAD_BYTES];
        if (t % 6 == 0) {
            hear_request(n, 0, ALL_PARTS);
        }
        if (t % 12 == 3) {
            hear_request(n, (uint8)last, ALL_PARTS & ~got);
        }
        now += SYS_SPREAD_TICK;
        if (Sys_Spread(now, m) && (m[0] & KINDS) == DATA && (m[0] & ROW) == last) {
            got |= (uint32)1 << (m[1] >> 3);
        }
    }
    check(got == ALL_PARTS, "who lacks the last row has it in an hour");
    hear_request(n, 0, ALL_PARTS);
    check(wanted_parts != ALL_PARTS, "a row that was served often is not served whole");
    for (int t = 0; t < 60 * MINUTE; t++) {
        tick();
    }
    hear_request(n, 0, ALL_PARTS);
    check(wanted_parts == ALL_PARTS, "but after an hour");
    wanted_parts = 0;
    hear_request(n, 0, 0);
    check(wanted_parts == 0, "a request for no parts gets none");
}

/* A neighbour with an older version is served first, but not for ever. */
static void pushed(void)
{
    enum { SECOND = 1000 / SYS_SPREAD_TICK };
    int n = PROGRAMS - 1;
    uint8 m[SYS_SPREAD_BYTES];
    now += 60000;
    hear_advertisement(programs[n].facts, false);
    check(!Sys_Spread(++now, m) || (m[0] & KINDS) != REQUEST, "it waits from when it hears on, not from when it spoke");
    forget_kinds();
    for (int t = 0; t < 20 * SECOND; t++) {
        tick();
    }
    check(kinds[REQUESTED] >= 4 && kinds[REQUESTED] <= 9, "without answers it requests less and less often");
    for (int t = 0; t < MINUTE && row == 0; t++) {
        tick();
        hear_what_is_wanted(1000);
    }
    check(row == 1, "it is at the second row");
    forget_kinds();
    for (int t = 0; t < 5 * SECOND; t++) {
        hear_request(n, 0, ALL_PARTS);
        tick();
    }
    check(kinds[REQUESTED] > 1, "others' requests for what it has are no reason to wait");
    forget_kinds();
    for (int t = 0; t < 12 * SECOND; t++) {
        hear_part(n, 0, (uint8)chance(PARTS));
        tick();
    }
    check(kinds[REQUESTED] <= 1, "their data are");
    forget_kinds();
    for (int t = 0; t < 20 * SECOND; t++) {
        hear_part(n, 0, (uint8)chance(PARTS));
        hear_request(n, 1, ALL_PARTS);
        tick();
    }
    check(kinds[REQUESTED] > 1, "then it requests, whichever other robot is served or requests");
    forget_kinds();
    for (int t = 0; t < 10 * MINUTE; t++) {
        hear_request(n, 0, ALL_PARTS);
        tick();
    }
    check(kinds[REQUESTED] <= MOST_ASKED, "where there are no more data it ceases");
    forget_kinds();
    hear_advertisement(programs[n].facts, false);
    for (int t = 0; t < MINUTE; t++) {
        tick();
    }
    check(kinds[REQUESTED] == 1, "until another robot advertises it");
}

/* The robot neither requests rows for worn flash nor writes it without end; it uses the other store. */
static void worn_out(void)
{
    worn_stores = 1;
    serve(PROGRAMS - 1, 4000);
    check(have.version == programs[PROGRAMS - 1].facts.version,
          "where one store does not change the other one is used");
    begin_history(false);
    boot();
    worn_stores = 3;
    serve(PROGRAMS - 1, 1000);
    changes = 0;
    check(serve(PROGRAMS - 1, 4000) == 0 && changes == 0, "a robot without a writable store requests nothing");
    worn_stores = 0;
    check(serve(PROGRAMS - 1, 4000) == 0, "until the next start");
    boot();
    serve(PROGRAMS - 1, 4000);
    check(have.version == programs[PROGRAMS - 1].facts.version, "which tries again");
}

/* A program with a CRC that no data can match is not requested without end. */
static void false_sum(void)
{
    programs[PROGRAMS - 1].facts.crc ^= 1;
    serve(PROGRAMS - 1, 4000);
    check(serve(PROGRAMS - 1, 4000) == 0, "what has failed some times is not asked for");
    programs[PROGRAMS - 1].facts.crc ^= 1;
    serve(PROGRAMS - 1, 4000);
    check(have.version == programs[PROGRAMS - 1].facts.version, "but the true one is");
}

/* Flags that cannot change: a program that cannot be tried blocks neither the working program nor the next one. */
static void stuck_bits(void)
{
    enum { FIRST = 0, SECOND = 2, THIRD = 4 };
    take(FIRST);
    check(Sys_Offer_Activation(1), "activated");
    boot();
    check(running != NONE && Sys_Confirm_Update(), "it runs, confirmed");
    take(SECOND);
    check(Sys_Offer_Activation(2), "activated");
    stuck_flags = 1;
    check(Sys_Start_Update() == 2, "a try that cannot be counted in one bit is counted in another");
    stuck_flags = TRIES;
    check(Sys_Start_Update() == 1, "tries that cannot be counted are none: the one before runs");
    check(Sys_Get_NextVersion() == 1, "and is known to");
    stuck_flags = 0;
    Sys_Start_Spreading(1);
    take(THIRD);
    stuck_flags = NOT_ACTIVE;
    check(!Sys_Activate_Update(3), "what is not active is not said to be");
    hear_advertisement(programs[THIRD].facts, true);
    changes = 0;
    hear_advertisement(programs[THIRD].facts, true);
    check(!Sys_Activate_Update(3) && !Sys_Offer_Activation(3) && changes == 0,
          "nor is it tried at each advertisement");
    stuck_flags = 0;
    check(!Sys_Activate_Update(3) && Sys_Start_Update() == 1 && Sys_Activate_Update(3), "but at the next start");
    changes = 0;
    check(Sys_Activate_Update(3) && changes == 0, "what is done is not done again");
    check(Sys_Start_Update() == 3, "it runs");
    stuck_flags = NOT_CONFIRMED;
    check(!Sys_Confirm_Update(), "what is not confirmed is not said to be");
    changes = 0;
    check(!Sys_Confirm_Update() && changes == 0, "nor is that tried each time");
    stuck_flags = 0;
}

/* While a program is on trial the robot begins no transfer, however long the trial lasts and whatever the robot hears.
 * Afterwards it begins one. */
static void long_trial(void)
{
    take(0);
    check(Sys_Offer_Activation(1), "activated");
    boot();
    check(running != NONE, "on trial");
    changes = 0;
    check(serve(PROGRAMS - 1, 60 * MINUTE) == 0 && changes == 0, "an hour of it");
    check(Sys_Confirm_Update(), "confirmed");
    take(PROGRAMS - 1);
}

/* The version numbers end: no version above the last one exists, and lower ones are not accepted. */
static void last_versions(void)
{
    for (int n = 0; n < 4; n++) {
        programs[n].facts.version = (uint16)(n == 3 ? 1 : 65533 + n);
        finish(n);
    }
    for (int n = 0; n < 3; n++) {
        take(n);
        check(Sys_Offer_Activation(programs[n].facts.version), "activated");
        boot();
        check(Sys_Confirm_Update() && have.version == programs[n].facts.version, "it runs");
    }
    changes = 0;
    for (int n = 0; n < 4; n++) {
        check(serve(n, 4000) == 0, "nothing is newer than the last");
    }
    sys_update nothing = {0, 0, 0xFFFFFFFF};
    hear_advertisement(nothing, false);
    check(changes == 0 && have.version == 65535, "nor is nothing");
}

int main(void)
{
    histories();
    for (int n = 0; n < 11; n++) {
        begin_history(false);
        boot();
        switch (n) {
        case 0:
        case 1:
            promise(n != 0);
            break;
        case 2:
            namesakes(6, 7);
            break;
        case 3:
            worn_out();
            break;
        case 4:
            false_sum();
            break;
        case 5:
            stuck_bits();
            break;
        case 6:
        case 7:
            nagged(n == 7);
            break;
        case 8:
            long_trial();
            break;
        case 9:
            last_versions();
            break;
        default:
            pushed();
        }
    }
    printf("%ld messages, %ld calls\n", sent, calls);
    return 0;
}
