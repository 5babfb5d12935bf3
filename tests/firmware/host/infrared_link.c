/* Neighbour messages by infra-red (openswarm_infrared.h, io/infrared). */
#include "infrared_air.h"

static sys_neighbour_message heard;
static int messages;
static bool hear(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    CHECK_EQ(data->size, sizeof heard);
    memcpy(&heard, data->payload, sizeof heard);
    messages++;
    return true;
}

static uint16 last_seen, last_lost;
static int seen, lost;
static bool on_neighbour(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid;
    if (id == SYS_NEIGHBOUR_SEEN) {
        seen++;
        last_seen = data->value;
    } else {
        lost++;
        last_lost = data->value;
    }
    return true;
}

TEST(every_single_error_of_a_word_is_repaired, "swarmcom.md 2.4: (15,11), all 2048 x 15 cases")
{
    boot();
    for (uint16 data = 0; data < 2048; data++) {
        uint8 repairs = 0;
        uint16 word = coder_encode(data);
        CHECK_EQ(coder_decode(word, &repairs), data);
        CHECK_EQ(repairs, 0);
        for (int bit = 0; bit < CODE_BITS; bit++) {
            CHECK_EQ(coder_decode((uint16)(word ^ 1u << bit), &repairs), data);
            CHECK_EQ(repairs, bit + 1);
        }
    }
}

TEST(two_words_differ_in_three_bits, "linear, so the lightest word tells the distance; whitening is no code word")
{
    boot();
    for (uint16 data = 1; data < 2048; data++) {
        CHECK(__builtin_popcount(coder_encode(data)) >= 3);
    }
    uint8 repairs = 0;
    (void)coder_decode(0x5555, &repairs);
    CHECK_EQ(repairs, 1);
}

TEST(the_checksum_is_the_usual_one, "CRC-16/CCITT-FALSE of 123456789 is 29B1")
{
    boot();
    CHECK_EQ(coder_crc((const uint8 *)"123456789", 9), 0x29B1);
}

static frame_state transfer(frame_buffer *to, const frame *f, int flip_a, int flip_b)
{
    frame_buffer from;
    uint16 word;
    frame_state state = FRAME_MORE;
    frame_pack(&from, f);
    frame_begin(to);
    for (int i = 0; state == FRAME_MORE && frame_next_word(&from, &word); i++) {
        word ^= (uint16)(flip_a / CODE_BITS == i && flip_a >= 0 ? 1u << flip_a % CODE_BITS : 0);
        word ^= (uint16)(flip_b / CODE_BITS == i && flip_b >= 0 ? 1u << flip_b % CODE_BITS : 0);
        state = frame_word(to, word);
    }
    return state;
}

TEST(frames_of_every_size_arrive_with_an_error_in_any_bit, "header 11 + 1 + 4 bits, payload, CRC")
{
    boot();
    static const uint8 text[FRAME_PAYLOAD] = {0, 255, 1, 254, 170, 85, 0, 0, 0, 255, 255, 255, 3, 12, 200};
    for (uint8 size = 0; size <= FRAME_PAYLOAD; size++) {
        frame f = {(uint16)(1 + size * 136u), size & 1u, size, text}, got;
        int bits = (8 * (4 + size) + DATA_BITS - 1) / DATA_BITS * CODE_BITS;
        for (int flip = -1; flip < bits; flip++) {
            frame_buffer b;
            CHECK_EQ(transfer(&b, &f, flip, -1), FRAME_WHOLE);
            frame_unpack(&b, &got);
            CHECK_EQ(b.repairs, flip >= 0);
            CHECK(got.number == f.number && got.kind == f.kind && got.size == size);
            CHECK(memcmp(got.payload, text, size) == 0);
        }
    }
}

TEST(no_two_errors_make_another_frame,
     "a word with two is wrong, and the CRC finds it, unless it is filling; swarmcom.md 8")
{
    boot();
    static const uint8 text[] = {1, 2, 3, 4};
    frame f = {1234, FRAME_MESSAGE, sizeof text, text}, got;
    frame_buffer b;
    for (int one = 0; one < 90; one++) {
        for (int other = 0; other < one; other++) {
            if (transfer(&b, &f, one, other) == FRAME_WHOLE) {
                frame_unpack(&b, &got);
                CHECK(got.number == f.number && got.size == f.size && memcmp(got.payload, text, sizeof text) == 0);
            } else {
                CHECK_EQ(one / CODE_BITS, other / CODE_BITS);
            }
        }
    }
}

TEST(a_message_arrives_from_far_and_near, "openswarm_infrared.h: source, sensor, strength, payload")
{
    static const uint16 depths[] = {6, 10, 20, 50, 300, 1000, 3500};
    recording r;
    begin_link();
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, hear, NULL));
    say("hello", 321, &r);
    CHECK_EQ(r.length, 3 * (7 + 7 * CODE_BITS) + 1); /* 9 bytes: 7 code words; 1: its last scan */
    CHECK(Sys_Set_RobotNumber(5));
    for (unsigned i = 0; i < sizeof depths / sizeof *depths; i++) {
        play(&r, (uint8)i, depths[i]);
        Sys_Yield();
        CHECK_EQ(messages, i + 1);
        CHECK_EQ(heard.source, 321);
        CHECK_EQ(heard.sensor, i);
        CHECK_EQ(heard.corrected, 0);
        CHECK(heard.size == 5 && memcmp(heard.payload, "hello", 5) == 0);
        CHECK(heard.strength * 10 > depths[i] * 9 - 10 && heard.strength <= depths[i]);
    }
    CHECK_EQ(Sys_Get_InfraredStatistics()->received, messages);
}

TEST(a_late_start_costs_nothing, "the bits begin where the ones end: up to 8 of the 18 scans of ones may be missed")
{
    recording r;
    begin_link();
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, hear, NULL));
    say("x", 9, &r);
    CHECK(Sys_Set_RobotNumber(5));
    for (int missed = 0; missed <= 8; missed++) {
        memset(r.lit, 0, (size_t)missed);
        play(&r, 3, 200);
        Sys_Yield();
        CHECK_EQ(messages, missed + 1);
    }
}

TEST(the_own_proximity_costs_no_frame,
     "swarmcom.md 4.2: an own flash in any scan of a frame's beginning, near or faint")
{
    recording r;
    begin_link();
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, hear, NULL));
    say("x", 9, &r);
    CHECK(Sys_Set_RobotNumber(5));
    for (int scans = 0; scans < 240; scans++) {
        uint16 before = Sys_Get_InfraredStatistics()->sent;
        scans_in_the_dark((unsigned)scans);
        if (Sys_Get_InfraredStatistics()->sent != before) { /* other robots wait for 12 dark scans after a frame */
            scans_in_the_dark(12);
            before++;
        }
        play(&r, 3, scans % 2 ? 200 : 7);
        Sys_Yield();
        CHECK_EQ(messages + (Sys_Get_InfraredStatistics()->sent != before), scans + 1); /* received or sent itself */
        messages = scans + 1;
    }
}

TEST(short_light_begins_no_frame, "swarmcom.md 4.2: proximity of others is three scans of light")
{
    begin_link();
    for (unsigned length = 1; length <= 4; length++) {
        for (unsigned i = 0; i < length; i++) {
            scan_with(4, 2000);
        }
        scans_in_the_dark(20);
    }
    CHECK_EQ(Sys_Get_InfraredStatistics()->damaged, 0);
    CHECK(Sys_Get_InfraredStatistics()->false_starts >= 2);
}

TEST(ones_in_the_middle_of_a_frame_begin_no_frame,
     "a beginning is 18 scans of light; who takes eight ones for it reads on over the beginning of the next frame")
{
    recording r;
    begin_link();
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, hear, NULL));
    say("x", 9, &r);
    CHECK(Sys_Set_RobotNumber(5));
    for (unsigned length = 22; length <= 36; length++) {
        for (unsigned i = 0; i < length; i++) {
            scan_with(3, 200);
        }
        scans_in_the_dark(15);
        play(&r, 3, 200);
        Sys_Yield();
        CHECK_EQ(messages, length - 21);
    }
    CHECK_EQ(Sys_Get_InfraredStatistics()->damaged, 0);
}

TEST(lasting_light_becomes_the_background, "swarmcom.md 8, 13: steps of the room's light, a neighbour's emitter stuck on")
{
    recording r;
    begin_link();
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, hear, NULL));
    say("x", 9, &r);
    CHECK(Sys_Set_RobotNumber(5));
    for (unsigned i = 0; i < 60; i++) { /* 15 ms */
        scan_with(2, 500);
    }
    CHECK_EQ(Sys_Get_InfraredStatistics()->adaptations, 1);
    for (unsigned i = 0; i < r.length + 40; i++) {
        scan_with(2, (uint16)(500 + (i < r.length && r.lit[i] ? 60 : 0)));
    }
    Sys_Yield();
    CHECK_EQ(messages, 1);
    scans_in_the_dark(100); /* and back */
    play(&r, 2, 60);
    Sys_Yield();
    CHECK_EQ(messages, 2);
}

TEST(the_queue_is_bounded, "fixed pool of SYS_INFRARED_QUEUE frames; openswarm_infrared.h: BUSY, ARGUMENT")
{
    uint16 heap;
    begin_link();
    heap = heap_now();
    for (int i = 0; i < SYS_INFRARED_QUEUE; i++) {
        CHECK(Sys_Send_Neighbours("abcdefgh", 8));
    }
    CHECK(!Sys_Send_Neighbours("x", 1));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_BUSY);
    CHECK(!Sys_Send_Neighbours("123456789", 9));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    CHECK(!Sys_Send_Neighbours("", 0));
    CHECK(!Sys_Send_Neighbours(NULL, 1));
    CHECK_EQ(Sys_Get_InfraredStatistics()->refused, 1);
    uint16 before = Sys_Get_InfraredStatistics()->sent;
    scans_in_the_dark(4096);
    CHECK_EQ(Sys_Get_InfraredStatistics()->sent - before, SYS_INFRARED_QUEUE);
    CHECK_EQ(heap_now(), heap);
}

TEST(robots_listen_before_they_send, "carrier sense: listen before talking, back-off behind others' frames")
{
    recording r;
    begin_link();
    say("abcdefgh", 9, &r);
    CHECK(Sys_Set_RobotNumber(5));
    CHECK(Sys_Send_Neighbours("y", 1));
    for (unsigned i = 0; i < r.length; i++) {
        CHECK(i < 2 || !own_light);
        scan_with(1, r.lit[i] ? 100 : 0);
    }
    for (unsigned i = 0; i < 12; i++) {
        CHECK(!own_light);
        scan_with(0, 0);
    }
    record(&r);
}

TEST(a_request_is_sent_and_processors_see_it,
     "exchangeable at run time, NULL restores; swarmcom.md 2.2: events, no polling")
{
    extern bool shout(uint8 * payload, uint8 * size), refuse(uint8 * payload, uint8 * size),
        mute(sys_neighbour_message * m);
    recording r;
    begin_link();
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, hear, NULL));
    CHECK(Sys_Set_RobotNumber(9));
    CHECK(Sys_Set_SendingProcessor(refuse) == NULL);
    CHECK(!Sys_Send_Neighbours("ab", 2));
    CHECK(Sys_Set_SendingProcessor(shout) == refuse);
    CHECK(Sys_Send_Event(SYS_SEND_NEIGHBOURS, "ab", 2));
    Sys_Yield();
    record(&r);
    CHECK(Sys_Set_SendingProcessor(NULL) == shout);
    CHECK(Sys_Set_RobotNumber(5));
    play(&r, 6, 80);
    Sys_Yield();
    CHECK(messages == 1 && heard.size == 3 && memcmp(heard.payload, "AB!", 3) == 0);
    CHECK(Sys_Set_MessageProcessor(mute) == NULL);
    play(&r, 6, 80);
    Sys_Yield();
    CHECK_EQ(messages, 1);
}

bool shout(uint8 *payload, uint8 *size);
bool shout(uint8 *payload, uint8 *size)
{
    payload[0] -= 32;
    payload[1] -= 32;
    payload[(*size)++] = '!';
    return true;
}

bool refuse(uint8 *payload, uint8 *size);
bool refuse(uint8 *payload, uint8 *size)
{
    (void)payload, (void)size;
    return false;
}

bool mute(sys_neighbour_message *m);
bool mute(sys_neighbour_message *m)
{
    (void)m;
    return false;
}

static uint8 moment, departures;
void tell_moment(uint8 *payload, uint8 size);
void tell_moment(uint8 *payload, uint8 size)
{
    payload[0] = moment;
    payload[2] = size;
    departures++;
}

TEST(a_message_says_when_it_leaves, "a processor on the way out sees a message when its turn has come, and no beacon")
{
    recording r;
    begin_link();
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, hear, NULL));
    CHECK(Sys_Set_RobotNumber(9));
    CHECK(Sys_Set_LeavingProcessor(tell_moment) == NULL);
    moment = 10;
    CHECK(Sys_Send_Neighbours("abc", 3));
    moment = 20;
    record(&r);
    moment = 30;
    CHECK_EQ(departures, 1);
    CHECK(Sys_Set_RobotNumber(5));
    play(&r, 6, 80);
    Sys_Yield();
    CHECK(messages == 1 && heard.size == 3 && memcmp(heard.payload, "\24b\3", 3) == 0);
    scans_in_the_dark(4096 * 3);
    CHECK(Sys_Get_InfraredStatistics()->sent >= 2 && departures == 1);
    CHECK(Sys_Set_LeavingProcessor(NULL) == tell_moment);
}

TEST(neighbours_are_seen_and_lost, "a table of fixed size with ageing: the oldest goes, silence is loss")
{
    recording r;
    sys_neighbour near[SYS_NEIGHBOURS + 1];
    begin_link();
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_SEEN, 0, on_neighbour, NULL));
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_LOST, 0, on_neighbour, NULL));
    for (uint16 number = 100; number <= 100 + SYS_NEIGHBOURS; number++) {
        say("x", number, &r);
        CHECK(Sys_Set_RobotNumber(5));
        play(&r, 1, 100);
        play(&r, 7, 120);
        Sys_Yield();
        CHECK_EQ(last_seen, number);
    }
    CHECK_EQ(seen, SYS_NEIGHBOURS + 1);
    CHECK(lost == 1 && last_lost == 100);
    CHECK_EQ(Sys_Get_Neighbours(near, SYS_NEIGHBOURS + 1), SYS_NEIGHBOURS);
    CHECK_EQ(Sys_Get_Neighbours(near, 3), 3);
    CHECK_EQ(near[1].sensor, 7);
    scans_in_the_dark(4096 * 8);
    Sys_Yield();
    CHECK_EQ(lost, SYS_NEIGHBOURS + 1);
    CHECK_EQ(Sys_Get_Neighbours(near, SYS_NEIGHBOURS), 0);
}

TEST(a_number_is_drawn_again_on_a_conflict, "random numbers with conflict detection; a fixed one is kept")
{
    recording r;
    uint16 drawn;
    begin_link();
    drawn = Sys_Get_RobotNumber();
    CHECK(drawn >= 1 && drawn <= 2047);
    CHECK(Sys_Send_Neighbours("x", 1));
    record(&r);
    play(&r, 0, 100);
    CHECK(Sys_Get_RobotNumber() != drawn);
    CHECK_EQ(Sys_Get_InfraredStatistics()->conflicts, 1);
    CHECK(!Sys_Set_RobotNumber(0) && !Sys_Set_RobotNumber(2048));
    CHECK(Sys_Set_RobotNumber(drawn));
    play(&r, 0, 100);
    CHECK_EQ(Sys_Get_RobotNumber(), drawn);
    CHECK_EQ(Sys_Get_InfraredStatistics()->conflicts, 2);
}

TEST(a_number_of_the_robot_is_used, "from the data EEPROM, as the lower layer says")
{
    fixed_number = 77;
    begin_link();
    CHECK_EQ(Sys_Get_RobotNumber(), 77);
}

TEST(silence_is_broken_by_beacons, "SYS_BEACON_PERIOD and up to a quarter more")
{
    begin_link();
    scans_in_the_dark(4096 * 3);
    uint16 before = Sys_Get_InfraredStatistics()->sent;
    scans_in_the_dark(4096 * 21);
    uint16 beacons = (uint16)(Sys_Get_InfraredStatistics()->sent - before);
    CHECK(beacons >= 8 && beacons <= 10);
}

static uint8 distance[8];
static int measured;
static bool feel(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    memcpy(distance, data->payload, sizeof distance);
    measured++;
    return true;
}

/* One scan with an object in front of sensor 3, which reflects the robot's own light; `others` is additional light. */
static void scan_near(uint16 others)
{
    scan_with(3, (uint16)((own_light ? 205 : 0) + others));
}

TEST(proximity_is_measured_between_frames, "analog.h: mm every 50 ms; not while others light up")
{
    begin_link();
    CHECK(Sys_Subscribe_to_Event(SYS_IO_PROXIMITY, 0, feel, NULL));
    for (int i = 0; i < 4096; i++) {
        scan_near(0);
    }
    Sys_Yield();
    CHECK(measured >= 17 && measured <= 20);
    CHECK_EQ(distance[3], 50);
    CHECK(distance[2] == SYS_OUT_OF_RANGE && distance[4] == SYS_OUT_OF_RANGE);
    measured = 0;
    for (int i = 0, light = 0; i < 4096; i++) { /* another robot lights up after each flash */
        light = own_light ? 6 : light - (light > 0);
        scan_near(light > 0 ? 300 : 0);
    }
    Sys_Yield();
    CHECK_EQ(measured, 0);
}

TEST(range_falls_with_strength, "swarmcom.md 3.1: libIrcom's amplitudes at 8, 10, 15, 20 cm")
{
    boot();
    static const uint16 counts[] = {2104, 376, 66, 20}, mm[] = {80, 100, 150, 200};
    for (unsigned i = 0; i < 4; i++) {
        CHECK(labs((long)Sys_Estimate_Range(counts[i]) - mm[i]) <= 5);
    }
    for (uint16 strength = 1; strength < 4000; strength++) {
        CHECK(Sys_Estimate_Range(strength) <= Sys_Estimate_Range((uint16)(strength - 1)));
    }
}

TEST(any_light_is_survived, "random readings for a minute: no state is left for good")
{
    recording r;
    uint32 random = 1;
    begin_link();
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, hear, NULL));
    say("x", 9, &r);
    CHECK(Sys_Set_RobotNumber(5));
    for (long i = 0; i < 60 * 4096L; i++) {
        random = random * 1664525u + 1013904223u;
        unsigned kind = random >> 20 & 7u;
        for (uint8 k = 0; k < HAL_INFRARED_SENSORS; k++) {
            readings[k] = kind == 0 ? 0 : kind == 1 ? 4095 : (random >> k & 0xFFFu);
        }
        host_device(scan_isr);
        if (i % 64 == 0) {
            Sys_Yield();
        }
    }
    scans_in_the_dark(4096);
    messages = 0;
    for (int tries = 0; tries < 3 && messages == 0; tries++) { /* repeat: the robot itself may be sending */
        play(&r, 2, 300);
        Sys_Yield();
    }
    CHECK_EQ(messages, 1);
}
