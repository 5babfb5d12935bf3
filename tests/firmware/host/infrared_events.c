/* Events that neighbours share (openswarm_remote.h). */
#include "infrared_air.h"

#include "openswarm_remote.h"

enum { ALARM = 0x140, ME = 5, OTHER = 9, THIRD = 30 };

static int alarms;
static uint8 last[SYS_REMOTE_BYTES];
static bool on_alarm(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    CHECK(data->size <= sizeof last);
    memcpy(last, data->payload, data->size);
    alarms++;
    return true;
}

static void begin_sharing(uint8 hops)
{
    begin_link();
    CHECK(Sys_Register_Event(ALARM));
    CHECK(Sys_Share_Event(ALARM, hops));
    CHECK(Sys_Subscribe_to_Event(ALARM, 0, on_alarm, NULL));
}

/* Records the frame with which another robot shares the event. */
static void record_as(uint16 number, const char *text, recording *r)
{
    CHECK(Sys_Set_RobotNumber(number));
    CHECK(Sys_Send_Event(ALARM, text, (uint16)strlen(text)));
    Sys_Yield();
    record(r);
    CHECK(Sys_Set_RobotNumber(ME));
}

static void hear(const recording *r)
{
    play(r, 2, 200);
    Sys_Yield();
}

TEST(an_event_arrives_once_on_those_who_share_it, "duplicates suppressed; it is not sent back")
{
    recording r;
    begin_sharing(1);
    record_as(OTHER, "fire", &r);
    CHECK_EQ(alarms, 1);
    hear(&r);
    CHECK(alarms == 2 && memcmp(last, "fire", 4) == 0);
    hear(&r);
    CHECK_EQ(alarms, 2);
    uint16 before = Sys_Get_InfraredStatistics()->sent;
    scans_in_the_dark(1000);
    CHECK_EQ(Sys_Get_InfraredStatistics()->sent, before);
    CHECK_EQ(Sys_Get_RemoteStatistics()->shared, 1);
    CHECK_EQ(Sys_Get_RemoteStatistics()->arrived, 1);
    CHECK_EQ(Sys_Get_RemoteStatistics()->duplicates, 1);
}

TEST(the_same_event_of_two_robots_arrives_twice, "known by the robot and its sequence, not by contents")
{
    recording one, another;
    begin_sharing(1);
    record_as(OTHER, "x", &one);
    record_as(THIRD, "x", &another);
    alarms = 0;
    hear(&one);
    hear(&another);
    CHECK_EQ(alarms, 2);
    CHECK(Sys_Send_Event(ALARM, "x", 1)); /* the robot's own equal event is still sent */
    Sys_Yield();
    record(&one);
    CHECK_EQ(Sys_Get_RemoteStatistics()->shared, 3);
}

TEST(events_are_passed_on_as_far_as_their_hops, "hop limit, counted down; the first robot does not hear itself")
{
    recording first, second;
    begin_sharing(2);
    record_as(OTHER, "abc", &first);
    hear(&first);
    CHECK_EQ(Sys_Get_RemoteStatistics()->passed_on, 1);
    record(&second); /* the forwarded frame, with one hop left */
    CHECK(Sys_Set_RobotNumber(OTHER));
    play(&second, 4, 100);
    CHECK_EQ(Sys_Get_RemoteStatistics()->duplicates, 1);
    CHECK_EQ(Sys_Get_RemoteStatistics()->passed_on, 1);
}

TEST(robots_that_do_not_share_only_forward, "the number is known to those who share it alone")
{
    recording r;
    begin_sharing(3);
    record_as(OTHER, "abc", &r);
    CHECK(Sys_Unregister_Event(ALARM));
    alarms = 0;
    hear(&r);
    CHECK_EQ(alarms, 0);
    CHECK_EQ(Sys_Get_RemoteStatistics()->passed_on, 1);
}

TEST(as_many_robots_are_told_apart_as_the_memory_holds, "each arrives at most once; one robot more is refused")
{
    static recording all[SYS_REMOTE_MEMORY + 1];
    begin_sharing(1);
    for (uint16 i = 0; i <= SYS_REMOTE_MEMORY; i++) {
        record_as((uint16)(100 + i), "m", &all[i]);
    }
    alarms = 0;
    for (uint16 i = 0; i < SYS_REMOTE_MEMORY; i++) {
        while (alarms != i + 1) { /* repeat: a robot that sends cannot receive */
            hear(&all[i]);
        }
    }
    uint16 before = Sys_Get_RemoteStatistics()->duplicates;
    for (uint16 i = 0; i < SYS_REMOTE_MEMORY; i++) {
        while (Sys_Get_RemoteStatistics()->duplicates == before) {
            hear(&all[i]);
        }
        before = Sys_Get_RemoteStatistics()->duplicates;
    }
    CHECK_EQ(alarms, SYS_REMOTE_MEMORY);
    while (Sys_Get_RemoteStatistics()->refused == 0) {
        hear(&all[SYS_REMOTE_MEMORY]);
    }
    CHECK_EQ(alarms, SYS_REMOTE_MEMORY);
    scans_in_the_dark(4096 * 8); /* until the records have expired */
    while (alarms == SYS_REMOTE_MEMORY) {
        hear(&all[SYS_REMOTE_MEMORY]);
    }
}

TEST(sharing_is_bounded, "openswarm_remote.h: ARGUMENT, EVENT, BUSY; long payloads stay here")
{
    begin_sharing(1);
    CHECK(!Sys_Share_Event(ALARM, 0) && Sys_Get_LastError() == SYS_ERROR_ARGUMENT);
    CHECK(!Sys_Share_Event(8192, 1) && Sys_Get_LastError() == SYS_ERROR_ARGUMENT);
    CHECK(!Sys_Share_Event(ALARM + 1, 1) && Sys_Get_LastError() == SYS_ERROR_EVENT);
    for (uint16 i = 1; i < SYS_REMOTE_EVENTS; i++) {
        CHECK(Sys_Register_Event((uint16)(ALARM + i)) && Sys_Share_Event((uint16)(ALARM + i), 1));
    }
    CHECK(Sys_Share_Event(ALARM, 2));
    CHECK(Sys_Register_Event(ALARM - 1) && !Sys_Share_Event(ALARM - 1, 1));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_BUSY);
    CHECK(Sys_Unsubscribe_Handler(ALARM, 0, on_alarm));
    CHECK(Sys_Send_Event(ALARM, "123456789", 9));
    Sys_Yield();
    CHECK_EQ(Sys_Get_RemoteStatistics()->too_long, 1);
    CHECK_EQ(Sys_Get_RemoteStatistics()->shared, 0);
}
