/* Limits of openswarm_infrared.h and openswarm_remote.h: calls before the start, full queues, and after a reset. */
#include "infrared_air.h"

#include "openswarm_quota.h"
#include "openswarm_remote.h"

enum { ALARM = 0x140, OTHER = 9, ME = 5, BEHIND_A_FRAME = 10, PREAMBLE_SCANS = 18 };

static int alarms;
static bool on_alarm(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    alarms++;
    return true;
}

static void begin_early(void)
{
    host_use_virtual_time();
    Sys_Init_Kernel();
    CHECK(Sys_Start_Infrared());
    CHECK(Sys_Register_Event(ALARM) && Sys_Share_Event(ALARM, 2));
    CHECK(Sys_Subscribe_to_Event(ALARM, 0, on_alarm, NULL));
    Sys_Start_Kernel();
}

static void send_alarm(uint8 contents)
{
    CHECK(Sys_Send_Event(ALARM, &contents, 1));
    Sys_Yield();
}

/* Delivers an alarm of one byte to the program, as if a whole frame of robot OTHER had arrived. */
static void receive_alarm_of(uint8 origin, uint8 hops, uint8 sequence, uint8 contents)
{
    const uint8 payload[] = {ALARM & 0xFF, (uint8)(ALARM >> 8 | hops << 5), origin, (uint8)(sequence << 3), contents};
    const frame f = {OTHER, FRAME_EVENT, sizeof payload, payload};
    frame_buffer b;
    frame_pack(&b, &f);
    infrared_received(&b, 2, 200);
}

static void receive_alarm(uint8 sequence, uint8 contents)
{
    receive_alarm_of(OTHER, 1, sequence, contents);
}

TEST(an_event_before_the_number_is_drawn_is_its_senders, "openswarm_remote.h: each arrives once, the own not at all")
{
    recording early, passed_on;
    begin_early();
    CHECK_EQ(Sys_Get_RobotNumber(), 0);
    send_alarm('x');
    record(&early);
    record(&passed_on); /* skips the first beacon */
    CHECK(alarms == 1 && Sys_Set_RobotNumber(ME));
    receive_alarm_of(0, 2, 1, 'x');
    Sys_Yield();
    CHECK_EQ(alarms, 2);
    record(&passed_on);
    scans_in_the_dark(4096 * 8); /* until the memory of arrived events has expired */
    CHECK(Sys_Set_RobotNumber(OTHER));
    play(&passed_on, 2, 200);
    Sys_Yield();
    CHECK(alarms == 2 && Sys_Get_RemoteStatistics()->duplicates == 1);
    play(&early, 2, 200); /* received by a third robot */
    Sys_Yield();
    CHECK_EQ(alarms, 3);
}

TEST(the_number_is_drawn_in_a_quarter_of_a_second, "openswarm_infrared.h")
{
    host_use_virtual_time();
    Sys_Init_Kernel();
    CHECK(Sys_Start_Infrared());
    Sys_Start_Kernel();
    while (Sys_Get_RobotNumber() == 0) {
        scan_with(0, 0);
    }
    CHECK_EQ(Sys_Get_SystemTime(), 250);
}

TEST(a_robot_that_began_again_is_heard, "its sequence restarts as well: arrivals expire")
{
    begin_early();
    scans_in_the_dark(2 * EARLY);
    receive_alarm(1, 'x');
    scans_in_the_dark(4096 * 6);
    receive_alarm(1, 'x');
    Sys_Yield();
    CHECK(alarms == 1 && Sys_Get_RemoteStatistics()->duplicates == 1);
    scans_in_the_dark(4096 * 2);
    receive_alarm(1, 'x');
    Sys_Yield();
    CHECK_EQ(alarms, 2);
}

TEST(arrivals_are_not_sent_back_however_long_they_wait, "their handlers held back; sequences wrap meanwhile")
{
    begin_early();
    scans_in_the_dark(2 * EARLY);
    Sys_Start_CriticalSection();
    for (uint8 i = 0; i < 64; i++) {
        receive_alarm(i, i);
    }
    Sys_End_CriticalSection();
    Sys_Yield();
    CHECK_EQ(alarms, 64);
    CHECK_EQ(Sys_Get_RemoteStatistics()->shared, 0);
}

TEST(frames_overtake_each_other, "openswarm_remote.h: each event arrives at most once")
{
    static const uint8 order[] = {3, 1, 2, 5, 4, 3, 20, 5, 18, 18, 4, 30, 29};
    begin_early();
    scans_in_the_dark(2 * EARLY);
    for (uint8 i = 0; i < sizeof order; i++) {
        receive_alarm(order[i], order[i]);
    }
    Sys_Yield();
    CHECK_EQ(alarms, 9); /* 3 1 2 5 4 20 18 30 29 */
    CHECK_EQ(Sys_Get_RemoteStatistics()->duplicates, 4);
}

TEST(a_quota_does_not_hold_back_what_is_shared, "openswarm_remote.h, Sys_Share_Event")
{
    static sys_quota latest;
    begin_early();
    scans_in_the_dark(2 * EARLY);
    CHECK(Sys_Keep_Latest(&latest, ALARM));
    Sys_Start_CriticalSection();
    for (int i = 0; i < SYS_INFRARED_QUEUE / 2; i++) {
        receive_alarm(i, 'x');                 /* replaces the waiting message */
        CHECK(Sys_Send_Event(ALARM, "x", 1)); /* replaces the waiting message, too */
    }
    Sys_End_CriticalSection();
    Sys_Yield();
    CHECK_EQ(alarms, 1);
    CHECK_EQ(Sys_Get_RemoteStatistics()->arrived, SYS_INFRARED_QUEUE / 2);
    CHECK_EQ(Sys_Get_RemoteStatistics()->shared, SYS_INFRARED_QUEUE / 2);
    CHECK(Sys_Unregister_Event(ALARM) && Sys_Register_Event(ALARM));
    send_alarm('x');
    CHECK_EQ(Sys_Get_RemoteStatistics()->shared, SYS_INFRARED_QUEUE / 2); /* unregistering ended it */
    CHECK(Sys_Share_Event(ALARM, 1));
    send_alarm('x');
    CHECK_EQ(Sys_Get_RemoteStatistics()->shared, SYS_INFRARED_QUEUE / 2 + 1);
}

TEST(an_event_that_finds_the_queue_full_is_not_shared, "openswarm_remote.h: sys_remote_statistics")
{
    begin_early();
    for (uint8 i = 0; i < 3 * SYS_INFRARED_QUEUE; i++) {
        send_alarm(i);
    }
    CHECK_EQ(Sys_Get_RemoteStatistics()->shared, SYS_INFRARED_QUEUE);
    CHECK_EQ(Sys_Get_InfraredStatistics()->refused, 2 * SYS_INFRARED_QUEUE);
}

TEST(robots_that_send_send_no_beacons, "SYS_BEACON_PERIOD; the counters saturate")
{
    unsigned on = 0, off = BEHIND_A_FRAME, frames = 0;
    begin_link();
    scans_in_the_dark(4096);
    infrared_statistics.sent = 0xFFFF;
    for (unsigned i = 0; i < 4096 * 10; i++) {
        if (i % 4096 == 0) {
            CHECK(Sys_Send_Neighbours("x", 1));
        }
        scan_with(0, 0);
        if (own_light && ++on == PREAMBLE_SCANS && off >= BEHIND_A_FRAME) {
            frames++;
        } else if (!own_light) {
            off = on != 0 ? 1 : off + 1;
            on = 0;
        }
    }
    CHECK_EQ(frames, 10);
}

TEST(settings_made_before_the_start_hold, "openswarm_infrared.h: main may call it")
{
    fixed_number = 77;
    host_use_virtual_time();
    Sys_Init_Kernel();
    CHECK(Sys_Set_RobotNumber(ME) && Sys_Set_InfraredThreshold(100));
    CHECK(Sys_Start_Infrared());
    Sys_Start_Kernel();
    CHECK_EQ(Sys_Get_RobotNumber(), ME);
    scans_in_the_dark(3 * EARLY);
    for (int i = 0; i < 60; i++) {
        scan_with(2, 50);
    }
    CHECK_EQ(Sys_Get_InfraredStatistics()->adaptations, 0);
}

static int messages;
static bool hear(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    messages++;
    return true;
}

TEST(no_robot_has_number_0, "openswarm_infrared.h: source, 1 to 2047")
{
    const frame f = {0, FRAME_MESSAGE, 1, (const uint8 *)"x"};
    frame_buffer b;
    begin_link();
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, hear, NULL));
    frame_pack(&b, &f);
    infrared_received(&b, 2, 200);
    Sys_Yield();
    CHECK_EQ(messages, 0);
}

TEST(ranges_are_within_bounds, "openswarm_infrared.h: 70 to 600 mm for every strength")
{
    boot();
    CHECK_EQ(Sys_Estimate_Range(0), 600);
    for (uint32 strength = 0; strength <= 0xFFFF; strength++) {
        uint16 mm = Sys_Estimate_Range((uint16)strength);
        CHECK(mm >= 70 && mm <= 600);
    }
}
