/* SPDX-License-Identifier: MIT */
/* Lower layer of the remote control: edges of the receiver's line with their time. */
#ifndef HAL_REMOTE_H
#define HAL_REMOTE_H

#include <stdbool.h>
#include <stdint.h>

#define HAL_REMOTE_TICKS_PER_S 14745600UL /* Tcy */

void hal_remote_start(void);
void remote_edge(bool falling, uint32_t ticks); /* ISR, io/remote */

#endif
