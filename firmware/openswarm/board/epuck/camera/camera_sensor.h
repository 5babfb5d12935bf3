/* SPDX-License-Identifier: MIT */
/* Camera of the e-puck: one window, frame by frame. Independent of the kernel.
 *
 * 160 x 160 sensor pixels in the centre of 640 x 480, every eighth of them: 20 x 20 pixels RGB565, high byte first
 * (epuck.md §7.5, openswarm-original.md §5.5). Also read by camera_capture.S. */
#ifndef CAMERA_SENSOR_H
#define CAMERA_SENSOR_H

#define CAMERA_WIDTH 20
#define CAMERA_HEIGHT 20
#define CAMERA_PIXEL_BYTES 2
#define CAMERA_FRAME_BYTES (CAMERA_WIDTH * CAMERA_HEIGHT * CAMERA_PIXEL_BYTES)
/* The sensor sends every fourth pixel of every fourth row; the capture stores every second of those. */
#define CAMERA_SKIPPED_LINES 1

#ifndef __ASSEMBLER__
#include <stdbool.h>
#include <stdint.h>

typedef enum { CAMERA_NONE = 0, CAMERA_PO3030K = 0x3030, CAMERA_PO6030K = 0x6030, CAMERA_PO8030D = 0x8030 } camera_type;

/* Resets the sensor, reads its type and programs it over I2C by polling, some 10 ms. Requires i2c_init(). */
camera_type camera_sensor_init(void);
/* Lets the timers count HREF and VSYNC at IPL 6. */
void camera_capture_init(void);
/* Captures the next whole frame into `frame`, CAMERA_FRAME_BYTES; then sets OC8IF (IFS2<3>). */
void camera_capture_next(uint8_t *frame);
void camera_capture_stop(void);
#endif

#endif
