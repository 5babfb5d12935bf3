/* SPDX-License-Identifier: MIT */
/* Programs the image sensor for the window of camera_sensor.h and arms the capture. */
#include "camera_sensor.h"

#include "hal_compiler.h"
#include "i2c_master.h"
#include "pins.h"

enum {
    ADDRESS = 0x6E,       /* 0xDC to write (epuck.md §7.1) */
    BANK = 0x03,          /* register that selects one of A, B, C */
    RESET_LOOPS = 250,    /* over 1,000 Tcy (epuck.md §7.1) */
    TIMER_OFF = 0x0002,   /* counts its pin */
    TIMER_ON = 0x8002,
    PRIORITY = 6
};
INTERRUPT_LEVEL(T4, 6);
INTERRUPT_LEVEL(T5, 6);
RESERVED_LEVEL(6, T4, T5);

typedef struct {
    uint8_t number, value;
} setting;

/* Window x 240..399, y 160..319, RGB565, every 4th pixel and row; one byte each 8 Tcy; exposure automatic, white
 * balance fixed, both mirrors set because the sensor is mounted upside down (openswarm-original.md §5.5, epuck.md
 * §7.1). */
static const setting po6030k[] = {
    {BANK, 1}, {0x50, 0x00}, {0x51, 0x3E},                           /* window start, in output pixels */
    {0x60, 0x00}, {0x61, 0xA4}, {0x62, 0x01}, {0x63, 0xE8},          /* VSYNC from row 164 to 488 */
    {0x38, 0x08}, {0x68, 0x03}, {0x80, 0x80}, {0x81, 0x80}, {0x82, 0x01}, /* RGB565, pixel clock, scale 4 x 4 */
    {BANK, 0}, {0x91, 0x50}, {0x90, 0xC0},                           /* 2 MCLK a column, mirrors */
    {BANK, 2}, {0x04, 0x9E},
};

/* UNVERIFIED: without mirrors, as the library does: its array is read out the other way round (epuck.md §7.1). */
static const setting po8030d[] = {
    {BANK, 0}, {0x5B, 0x00}, {0x6C, 0x00}, {0x09, 0x3B}, {0x08, 0x00},
    {0x10, 0x00}, {0x11, 0xA0}, {0x12, 0x01}, {0x13, 0xE4}, {0x6A, 0x02},
    {BANK, 1}, {0x9E, 0x28}, {0x4E, 0x30}, {0xB7, 0x03}, {0x93, 0x80}, {0x94, 0x80},
};

/* Window start one output pixel and row early: X1 = 240 + 210 - 4, Y1 = 160 + 7 - 4, VSYNC in column X1 + 2
 * (epuck.md §7.5; the library's X1 is one less and gives it column 239); 4 Tcy a column (§7.3); quarter size;
 * RGB565; white balance off, exposure on (§7.2). */
static const setting po3030k[] = {
    {0x1D, 0x20}, {0x20, 0x33}, {0x4E, 0x08},
    {0x08, 0x01}, {0x09, 0xBE}, {0x0A, 0x00}, {0x0B, 0xA3}, {0x0C, 0x03}, {0x0D, 0x53}, {0x0E, 0x01}, {0x0F, 0xE8},
    {0xA5, 0x00}, {0xA6, 0xA3}, {0xA7, 0x01}, {0xA8, 0xE7}, {0xA9, 0x01}, {0xAA, 0xC0}, {0xD4, 0x1C},
};

static bool write_all(const setting *settings, uint8_t count)
{
    i2c_transfer transfer = {ADDRESS, sizeof *settings, 0, 0, 0};
    for (uint8_t i = 0; i < count; i++) {
        transfer.out = &settings[i].number;
        if (i2c_transfer_polled(&transfer) != I2C_DONE) {
            return false;
        }
    }
    return true;
}

static uint8_t read(uint8_t number)
{
    uint8_t value = 0;
    i2c_transfer transfer = {ADDRESS, 1, 1, &number, &value};
    return i2c_transfer_polled(&transfer) == I2C_DONE ? value : 0;
}

static void wait(void)
{
    for (uint16_t i = 0; i < RESET_LOOPS; i++) {
        __asm__ volatile("nop");
    }
}

#define PROGRAM(table) write_all(table, sizeof table / sizeof *table)

camera_type camera_sensor_init(void)
{
    LATC &= (uint16_t)~PIN_CAMERA_RESET;
    wait();
    LATC |= PIN_CAMERA_RESET;
    wait();
    uint16_t type = (uint16_t)(read(0) << 8);
    type |= read(1);
    switch (type) {
    case CAMERA_PO3030K:
        return PROGRAM(po3030k) ? CAMERA_PO3030K : CAMERA_NONE;
    case CAMERA_PO6030K:
        return PROGRAM(po6030k) ? CAMERA_PO6030K : CAMERA_NONE;
    case CAMERA_PO8030D:
        return PROGRAM(po8030d) ? CAMERA_PO8030D : CAMERA_NONE;
    default:
        return CAMERA_NONE;
    }
}

/* ---- Capture: T5 waits for VSYNC, T4 counts HREF (epuck.md §7.5)
 * --------------------------------------------------- */

extern uint8_t *camera_next_byte; /* camera_capture.S */
extern uint16_t camera_lines_left;

void camera_capture_init(void)
{
    T4CON = TIMER_OFF;
    T5CON = TIMER_OFF;
    PR4 = CAMERA_SKIPPED_LINES + 1;
    PR5 = 1;
    IPC5bits.T4IP = PRIORITY;
    IPC5bits.T5IP = PRIORITY;
    IFS1bits.T4IF = 0;
    IFS1bits.T5IF = 0;
    IEC1bits.T4IE = 1;
    IEC1bits.T5IE = 1;
}

void camera_capture_stop(void)
{
    T5CON = TIMER_OFF;
    T4CON = TIMER_OFF;
}

void camera_capture_next(uint8_t *frame)
{
    camera_capture_stop();
    camera_next_byte = frame;
    camera_lines_left = CAMERA_HEIGHT;
    TMR4 = CAMERA_SKIPPED_LINES; /* the first HREF behind VSYNC counts, then every second */
    TMR5 = 0;
    IFS1bits.T4IF = 0;
    IFS1bits.T5IF = 0;
    T5CON = TIMER_ON;
}
