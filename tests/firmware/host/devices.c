/* Devices: processors, bounded buffers, back-pressure (engines.md §6, kernel.md §2, the paper). */
#include "test.h"

static uint8 line[2][4 * SYS_UART_TX];
static size_t sent[2];
static void capture(uint8 uart, uint8 byte)
{
    line[uart][sent[uart]++] = byte;
}

static uint8 got[1024];
static size_t got_size;
static int messages;
static bool receive(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    memcpy(got + got_size, data->payload, data->size);
    got_size += data->size;
    messages++;
    return true;
}

static int ready_events;
static uint16 ready_bytes;
static bool on_ready(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    ready_events++;
    ready_bytes = data->value;
    return true;
}

TEST(a_send_event_puts_its_bytes_on_the_line, "SYS_SEND_UART1: Listing 1")
{
    boot();
    host_uart_sink(capture);
    Sys_Send_Event(SYS_SEND_UART1, "hello", 5);
    Sys_Send_Event(SYS_SEND_UART2, "there", 5);
    CHECK_EQ(sent[0], 0);
    Sys_Yield();
    CHECK(sent[0] == 5 && memcmp(line[0], "hello", 5) == 0);
    CHECK(sent[1] == 5 && memcmp(line[1], "there", 5) == 0);
}

TEST(a_refused_message_has_room_when_ready_is_said, "openswarm_io.h: back-pressure")
{
    boot();
    host_uart_sink(capture);
    Sys_Subscribe_to_Event(SYS_UART1_READY, 0, on_ready, NULL);
    host_hold_line(true);
    char block[16];
    size_t accepted = 0;
    memset(block, 'x', sizeof block);
    while (Sys_Write_UART1(block, sizeof block)) {
        accepted++;
    }
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_BUSY);
    CHECK_EQ(accepted, SYS_UART_TX / (sizeof(message) + 1 + sizeof block + 1)); /* last 1: even size */
    CHECK_EQ(Sys_Get_UARTStatistics(SYS_UART1)->tx_refused, 1);
    host_tick();
    Sys_Yield();
    CHECK_EQ(ready_events, 0);
    host_hold_line(false);
    host_tick();
    Sys_Yield();
    CHECK_EQ(sent[0], accepted * sizeof block);
    CHECK_EQ(ready_events, 1);
    CHECK_EQ(ready_bytes, SYS_UART_TX);
    CHECK(Sys_Write_UART1(block, sizeof block));
    host_tick();
    Sys_Yield();
    CHECK_EQ(ready_events, 1); /* once */
}

TEST(messages_of_any_size_are_buffered_in_order, "dynamically buffered transmission; a 65-byte message got BUSY for ever")
{
    static uint8 text[SYS_UART_TX];
    boot();
    host_uart_sink(capture);
    Sys_Yield();
    uint16 used = Sys_Get_Statistics()->heap_used;
    for (uint16 i = 0; i < sizeof text; i++) {
        text[i] = (uint8)(i * 7);
    }
    static const uint16 sizes[] = {1, 2, 64, 65, 66, 0, 100, 3};
    size_t total = 0;
    host_hold_line(true);
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        CHECK(Sys_Write_UART1(text + total, sizes[i]));
        total += sizes[i];
    }
    CHECK(Sys_Write_UART2(text, 200));
    CHECK(Sys_Get_Statistics()->heap_used >= used + total + 200);
    CHECK(Sys_Get_Statistics()->heap_used <= used + (total + 200) * 2 + 8 * (sizeof(message) + 2));
    host_hold_line(false);
    CHECK(sent[0] == total && memcmp(line[0], text, total) == 0);
    CHECK(sent[1] == 200 && memcmp(line[1], text, 200) == 0);
    Sys_Yield();
    CHECK_EQ(Sys_Get_Statistics()->heap_used, used);
    CHECK(!Sys_Write_UART1(text, sizeof text)); /* its blocks need more bytes than the transmit limit */
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    CHECK_EQ(Sys_Get_Statistics()->heap_used, used);
    uint16 largest = sizeof text;
    while (!Sys_Write_UART1(text, largest)) {
        largest--;
    }
    CHECK(largest >= SYS_UART_TX / 2);
    CHECK(sent[0] == total + largest && memcmp(line[0] + total, text, largest) == 0);
}

TEST(ready_also_follows_when_the_heap_was_exhausted, "openswarm_io.h: BUSY")
{
    boot();
    host_uart_sink(capture);
    Sys_Subscribe_to_Event(SYS_UART1_READY, 0, on_ready, NULL);
    static void *all[SYS_HEAP / 8];
    static uint16 sizes[SYS_HEAP / 8];
    size_t blocks = 0;
    for (uint16 size = 160; size != 0; size -= 8) {
        while ((all[blocks] = heap_alloc(size)) != NULL) {
            sizes[blocks++] = size;
        }
    }
    CHECK(!Sys_Write_UART1("hello", 5));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_BUSY);
    host_tick(); /* no memory for the READY event */
    while (blocks-- != 0) {
        heap_free(all[blocks], sizes[blocks]);
    }
    Sys_Yield();
    CHECK_EQ(ready_events, 0);
    host_tick();
    Sys_Yield();
    CHECK_EQ(ready_events, 1);
    CHECK(Sys_Write_UART1("hello", 5));
    CHECK(sent[0] == 5 && memcmp(line[0], "hello", 5) == 0);
}

static bool inner_done;
static bool nesting(const uint8 *text, uint16 size, sys_put put_byte)
{
    for (uint16 i = 0; i < size; i++) {
        put_byte(text[i]);
        if (i == 3 && text[0] == 'o') {
            inner_done = Sys_Write_UART1("inner", 5);
        }
    }
    return true;
}
static bool dying(const uint8 *text, uint16 size, sys_put put_byte)
{
    CHECK(Sys_Raw_Tx(text, size, put_byte));
    Sys_Kill_Process(Sys_Get_ProcessID());
    return true;
}
static bool refusing(const uint8 *text, uint16 size, sys_put put_byte)
{
    (void)Sys_Raw_Tx(text, size, put_byte);
    return false;
}
static void write_long_line(void)
{
    static const char text[90] = "a message of three blocks";
    (void)Sys_Write_UART1(text, sizeof text);
}

TEST(a_message_is_sent_whole_or_not_at_all, "openswarm_io.h: writers that nest, refuse or die")
{
    boot();
    host_uart_sink(capture);
    uint16 used = Sys_Get_Statistics()->heap_used;
    Sys_Set_TxProcessor(SYS_UART1, nesting);
    CHECK(!Sys_Write_UART1("outer message", 13));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    CHECK(inner_done && sent[0] == 5 && memcmp(line[0], "inner", 5) == 0);
    Sys_Set_TxProcessor(SYS_UART1, refusing);
    CHECK(!Sys_Write_UART1("refused", 7));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    Sys_Set_TxProcessor(SYS_UART1, dying);
    CHECK(Sys_Start_Process(write_long_line) != 0);
    Sys_Yield();
    CHECK_EQ(sent[0], 5);
    Sys_Set_TxProcessor(SYS_UART1, NULL);
    CHECK(Sys_Write_UART2("x", 1)); /* frees the memory that the killed writer has left */
    Sys_Yield();
    CHECK_EQ(Sys_Get_Statistics()->heap_used, used);
}

TEST(received_bytes_arrive_as_chunks, "openswarm_io.h: Sys_Chunk_Rx")
{
    boot();
    Sys_Subscribe_to_Event(SYS_UART1_RECEIVED, 0, receive, NULL);
    for (int i = 0; i < SYS_UART_RX + 3; i++) {
        host_receive(SYS_UART1, (uint8)i);
    }
    Sys_Yield();
    CHECK_EQ(messages, 1);
    CHECK_EQ(got_size, SYS_UART_RX);
    host_tick();
    host_tick();
    Sys_Yield();
    CHECK_EQ(messages, 2);
    CHECK_EQ(got_size, SYS_UART_RX + 3);
    CHECK_EQ(got[SYS_UART_RX + 2], SYS_UART_RX + 2);
}

static void loop_back(uint8 uart, uint8 byte)
{
    host_receive(uart, byte);
}

TEST(frames_survive_any_content, "openswarm_io.h: COBS + CRC-16")
{
    boot();
    host_uart_sink(loop_back);
    Sys_Subscribe_to_Event(SYS_UART1_RECEIVED, 0, receive, NULL);
    Sys_Set_TxProcessor(SYS_UART1, Sys_Frame_Tx);
    Sys_Set_RxProcessor(SYS_UART1, Sys_Frame_Rx);
    uint8 message[SYS_UART_RX - 3];
    srand(1);
    for (int round = 0; round < 3000; round++) {
        uint16 size = (uint16)(1 + rand() % (int)sizeof message);
        for (uint16 i = 0; i < size; i++) {
            message[i] = (uint8)(rand() % 3 == 0 ? 0 : rand());
        }
        got_size = 0;
        CHECK(Sys_Write_UART1(message, size));
        Sys_Yield();
        CHECK_EQ(messages, round + 1);
        CHECK_EQ(got_size, size);
        CHECK(memcmp(got, message, size) == 0);
    }
}

static uint8 encoded[512];
static size_t encoded_size;
static bool collect(uint8 byte)
{
    encoded[encoded_size++] = byte;
    return true;
}

TEST(a_frame_is_what_cobs_and_crc_say, "CRC-16/CCITT-FALSE of 123456789 is 0x29B1; COBS by hand")
{
    boot();
    CHECK(Sys_Frame_Tx((const uint8 *)"123456789", 9, collect));
    static const uint8 wanted[] = {12, '1', '2', '3', '4', '5', '6', '7', '8', '9', 0x29, 0xB1, 0};
    CHECK_EQ(encoded_size, sizeof wanted);
    CHECK(memcmp(encoded, wanted, sizeof wanted) == 0);
    uint8 long_message[300];
    memset(long_message, 7, sizeof long_message);
    encoded_size = 0;
    CHECK(Sys_Frame_Tx(long_message, sizeof long_message, collect));
    CHECK_EQ(encoded[0], 255);
    CHECK_EQ(encoded[255], 300 + 2 - 254 + 1);
    CHECK_EQ(encoded_size, 300 + 2 + 2 + 1);
    CHECK_EQ(encoded[encoded_size - 1], 0);
}

TEST(a_damaged_frame_costs_only_itself, "openswarm_io.h: damaged frames are dropped")
{
    boot();
    Sys_Subscribe_to_Event(SYS_UART1_RECEIVED, 0, receive, NULL);
    Sys_Set_RxProcessor(SYS_UART1, Sys_Frame_Rx);
    Sys_Frame_Tx((const uint8 *)"good", 4, collect);
    for (size_t flip = 0; flip + 1 < encoded_size; flip++) {
        for (size_t i = 0; i < encoded_size; i++) {
            host_receive(SYS_UART1, i == flip ? encoded[i] ^ 0x10 : encoded[i]);
        }
        host_receive(SYS_UART1, 0);
        got_size = 0;
        int before = messages;
        for (size_t i = 0; i < encoded_size; i++) {
            host_receive(SYS_UART1, encoded[i]);
        }
        Sys_Yield();
        CHECK_EQ(messages, before + 1);
        CHECK(got_size == 4 && memcmp(got, "good", 4) == 0);
    }
    CHECK(Sys_Get_UARTStatistics(SYS_UART1)->rx_damaged >= encoded_size - 1);
    for (int i = 0; i < 100; i++) { /* longer than the buffer: discarded at the buffer's end */
        host_receive(SYS_UART1, 9);
    }
    host_receive(SYS_UART1, 0);
    int before = messages;
    for (size_t i = 0; i < encoded_size; i++) {
        host_receive(SYS_UART1, encoded[i]);
    }
    Sys_Yield();
    CHECK_EQ(messages, before + 1);
}

TEST(swapping_processors_under_traffic_loses_nothing, "the paper: Rx- and Tx-processors are exchanged at run time")
{
    boot();
    host_uart_sink(loop_back);
    Sys_Subscribe_to_Event(SYS_UART1_RECEIVED, 0, receive, NULL);
    char text[8];
    size_t total = 0;
    for (int round = 0; round < 200; round++) {
        for (int i = 0; i < 3; i++) {
            int n = snprintf(text, sizeof text, "%d.", round * 3 + i);
            CHECK(Sys_Write_UART1(text, (uint16)n));
            total += (size_t)n;
            Sys_Yield();
        }
        bool frame = round % 2 == 0; /* exchanged in the middle of a received chunk */
        CHECK(Sys_Set_TxProcessor(SYS_UART1, frame ? Sys_Frame_Tx : NULL) == (frame ? Sys_Raw_Tx : Sys_Frame_Tx));
        CHECK(Sys_Set_RxProcessor(SYS_UART1, frame ? Sys_Frame_Rx : NULL) == (frame ? Sys_Chunk_Rx : Sys_Frame_Rx));
        Sys_Yield();
        CHECK_EQ(got_size, total);
        got_size = total = 0;
    }
    CHECK_EQ(Sys_Get_UARTStatistics(SYS_UART1)->rx_lost, 0);
    CHECK_EQ(Sys_Get_UARTStatistics(SYS_UART1)->rx_damaged, 0);
}

enum { DRIVE = E1 };
static bool virtual_actuator(uint16 id, const sys_event_data *data, sys_wheel_speeds *speeds)
{
    const sint16 *v = data->payload;
    if (id != DRIVE) {
        return Sys_Default_MotorProcessor(id, data, speeds);
    }
    speeds->left = (sint16)(v[0] - v[1]);
    speeds->right = (sint16)(v[0] + v[1]);
    return true;
}
static bool safety(uint16 id, const sys_event_data *data, sys_wheel_speeds *speeds)
{
    bool moved = virtual_actuator(id, data, speeds);
    speeds->left /= 4;
    speeds->right /= 4;
    return moved;
}

TEST(motor_post_processors_are_exchanged_at_run_time, "the paper: a safety post-processor in an unsafe area")
{
    boot();
    Sys_Register_Event(DRIVE);
    CHECK(Sys_Connect_Motors(DRIVE));
    CHECK(Sys_Set_MotorProcessor(virtual_actuator) == Sys_Default_MotorProcessor);
    sint16 drive[2] = {100, 20};
    Sys_Send_Event(DRIVE, drive, sizeof drive);
    Sys_Yield();
    CHECK(host_left() == 80 && host_right() == 120);
    CHECK(Sys_Set_MotorProcessor(safety) == virtual_actuator);
    Sys_Send_Event(DRIVE, drive, sizeof drive);
    Sys_Yield();
    CHECK(host_left() == 20 && host_right() == 30);
    CHECK(Sys_Set_MotorProcessor(NULL) == safety);
    Sys_Send_Event(DRIVE, drive, sizeof drive);
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 1000);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)-1000);
    Sys_Yield();
    CHECK(host_left() == SYS_MAXIMUM_SPEED && host_right() == -SYS_MAXIMUM_SPEED);
}

static uint8 positions[8];
static int position_count;
static bool on_selector(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    CHECK_EQ(data->size, 1);
    positions[position_count++] = (uint8)data->value;
    return true;
}
static bool mirror(uint8 *position)
{
    *position = (uint8)(15 - *position);
    return *position != 0;
}

TEST(the_selector_is_debounced_and_preprocessed, "the paper: pre-processors of input devices")
{
    boot();
    Sys_Subscribe_to_Event(SYS_IO_SELECTOR, 0, on_selector, NULL);
    host_set_selector(3);
    Sys_Sleep(20);
    host_set_selector(2);
    Sys_Sleep(5);
    host_set_selector(3);
    Sys_Sleep(20);
    CHECK_EQ(position_count, 0);
    Sys_Sleep(10);
    CHECK_EQ(position_count, 1);
    CHECK_EQ(positions[0], 3);
    CHECK_EQ(Sys_Get_Selector(), 3);
    Sys_Set_SelectorProcessor(mirror);
    host_set_selector(5);
    Sys_Sleep(40);
    host_set_selector(15);
    Sys_Sleep(40);
    CHECK_EQ(position_count, 2);
    CHECK_EQ(positions[1], 10);
}

TEST(leds_are_switched_one_by_one, "openswarm_io.h: LEDs")
{
    boot();
    CHECK(Sys_Set_LED(3, true) && Sys_Toggle_LED(SYS_LED_FRONT));
    CHECK(hal_led_get(3) && hal_led_get(SYS_LED_FRONT) && !hal_led_get(2));
    CHECK(Sys_Toggle_LED(3) && !hal_led_get(3));
    CHECK(!Sys_Set_LED(SYS_LEDS, true));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
}
