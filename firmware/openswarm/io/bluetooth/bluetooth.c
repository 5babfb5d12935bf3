/* SPDX-License-Identifier: MIT */
/* Bluetooth: commands and events as lines of text (bluetooth.h). */
#include "bluetooth.h"

#include "bluetooth_text.h"
#include "kernel.h"

#include <string.h>

enum {
    STEPS_PER_S = 1000, /* at SYS_MAXIMUM_SPEED (epuck.md §3) */
    OFF = 0,
    TOGGLE = 2,
    ANSWER = 16 /* the longest is "!65535,65535" */
};

static sys_bluetooth_processor processor;

static void write_words(const char *words)
{
    (void)Sys_Write_UART1(words, (uint16)strlen(words));
}

/* One line: a character and `count` numbers. */
static void write_line(char first, uint8 count, sint32 a, sint32 b)
{
    char text[ANSWER];
    text_line line = {text, 0, sizeof text};
    text_character(&line, first);
    if (count > 0) {
        if (first != '!') {
            text_character(&line, ',');
        }
        text_number(&line, a);
    }
    if (count > 1) {
        text_character(&line, ',');
        text_number(&line, b);
    }
    (void)Sys_Write_UART1(text, line.size);
}

/* ---- Wheels and LEDs
 * ------------------------------------------------------------------------------------------------ */

static sint16 nearest_quotient(sint32 number, sint16 divisor)
{
    return (sint16)((number + (number < 0 ? -divisor / 2 : divisor / 2)) / divisor);
}

static bool drive(sint32 left, sint32 right)
{
    if (left < -STEPS_PER_S || left > STEPS_PER_S || right < -STEPS_PER_S || right > STEPS_PER_S) {
        return false;
    }
    sint16 left_mm_s = nearest_quotient(left * SYS_MAXIMUM_SPEED, STEPS_PER_S);
    sint16 right_mm_s = nearest_quotient(right * SYS_MAXIMUM_SPEED, STEPS_PER_S);
    return Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, (uint16)left_mm_s) &&
           Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)right_mm_s);
}

static sint16 steps_per_s(sint16 mm_s)
{
    return nearest_quotient((sint32)mm_s * STEPS_PER_S, SYS_MAXIMUM_SPEED);
}

static bool light(sint32 led, sint32 action)
{
    if (led < 0 || led >= SYS_LEDS || action < OFF || action > TOGGLE) {
        return false;
    }
    return action == TOGGLE ? Sys_Toggle_LED((uint8)led) : Sys_Set_LED((uint8)led, action != OFF);
}

static void stop(void)
{
    (void)drive(0, 0);
    for (uint8 led = 0; led < SYS_LEDS; led++) {
        (void)Sys_Set_LED(led, false);
    }
}

/* ---- Events by number
 * ------------------------------------------------------------------------------------------------ */

static bool on_reported(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    write_line('!', 2, event, data->value);
    return true;
}

static bool report(sint32 event, bool wanted)
{
    uint16 number = (uint16)event;
    return wanted ? event_connect(number, on_reported)
                  : Sys_Unsubscribe_Handler(number, OS_DRIVERS, on_reported);
}

/* ---- Commands
 * -------------------------------------------------------------------------------------------------------- */

typedef struct {
    char letter;
    uint8 arguments;
} command;

static const command commands[] = {{'D', 2}, {'E', 0}, {'L', 2}, {'B', 1}, {'F', 1}, {'C', 0},
                                   {'S', 0}, {'V', 0}, {'H', 0}, {'!', 2}, {'+', 1}, {'-', 1}};

/* Commands whose answer has more than the letter. */
static bool tell(char letter)
{
    switch (letter) {
    case 'E':
        write_line('e', 2, steps_per_s(Sys_Get_MotorSpeed_Left()), steps_per_s(Sys_Get_MotorSpeed_Right()));
        return true;
    case 'C':
        write_line('c', 1, Sys_Get_Selector(), 0);
        return true;
    case 'V':
        write_words("v,OpenSwarm");
        return true;
    case 'H':
        write_words("h,D,l,r E L,n,v B,v F,v C S V !e,v +e -e");
        return true;
    default:
        return false;
    }
}

static bool act(char letter, const sint32 *arguments)
{
    switch (letter) {
    case 'D':
        return drive(arguments[0], arguments[1]);
    case 'L':
        return light(arguments[0], arguments[1]);
    case 'B':
        return light(SYS_LED_BODY, arguments[0]);
    case 'F':
        return light(SYS_LED_FRONT, arguments[0]);
    case '!':
        return arguments[0] >= 0 && Sys_Send_IntEvent((uint16)arguments[0], (uint16)arguments[1]);
    case '+':
    case '-':
        return arguments[0] >= 0 && report(arguments[0], letter == '+');
    default: /* 'S' */
        stop();
        return true;
    }
}

static char small(char letter)
{
    return letter >= 'A' && letter <= 'Z' ? (char)(letter - 'A' + 'a') : letter;
}

bool Sys_Default_BluetoothProcessor(const char *line, uint16 size)
{
    sint32 arguments[TEXT_ARGUMENTS];
    for (uint8 i = 0; i < sizeof commands / sizeof *commands; i++) {
        if (line[0] != commands[i].letter) {
            continue;
        }
        if (text_arguments(line + 1, (uint16)(size - 1), arguments) != commands[i].arguments) {
            write_line('?', 0, 0, 0);
        } else if (!tell(line[0])) {
            write_line(act(line[0], arguments) ? small(line[0]) : '?', 0, 0, 0);
        }
        return true;
    }
    return false;
}

static bool on_line(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    if (!processor(data->payload, data->size)) {
        (void)Sys_Send_Event(SYS_BLUETOOTH_RECEIVED, data->payload, data->size);
    }
    return true;
}

sys_bluetooth_processor Sys_Set_BluetoothProcessor(sys_bluetooth_processor wanted)
{
    hal_lock_state lock = hal_lock_slice();
    sys_bluetooth_processor before = processor;
    processor = wanted != NULL ? wanted : Sys_Default_BluetoothProcessor;
    hal_unlock(lock);
    return before;
}

bool Sys_Start_Bluetooth(void)
{
    processor = Sys_Default_BluetoothProcessor;
    (void)Sys_Set_RxProcessor(SYS_UART1, Sys_Line_Rx);
    (void)Sys_Set_TxProcessor(SYS_UART1, Sys_Line_Tx);
    return Sys_Register_Event(SYS_BLUETOOTH_RECEIVED) &&
           event_connect(SYS_UART1_RECEIVED, on_line);
}
