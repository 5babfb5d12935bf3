/* SPDX-License-Identifier: MIT */
/* Microphones: the last sample on call, loudness as events. */
#include "analog_parts.h"
#include "hal_cpu.h"

#include <string.h>

static sys_sound_processor processor;
static sint16 latest[SYS_MICROPHONES];
static uint16 collected[SYS_MICROPHONES];

uint16 Sys_Default_SoundProcessor(uint8 microphone, sint16 sample, uint16 so_far)
{
    uint16 amplitude = (uint16)(sample < 0 ? -sample : sample);
    (void)microphone;
    return amplitude > so_far ? amplitude : so_far;
}

void sound_init(void)
{
    processor = Sys_Default_SoundProcessor;
    memset(collected, 0, sizeof collected);
}

void sound_measured(const uint16 *microphones)
{
    for (uint8 i = 0; i < SYS_MICROPHONES; i++) {
        latest[i] = (sint16)(microphones[i] - ANALOG_ZERO);
        collected[i] = processor(i, latest[i], collected[i]);
    }
}

void sound_send(void)
{
    (void)Sys_Send_Event(SYS_IO_SOUND, collected, sizeof collected);
    memset(collected, 0, sizeof collected);
}

sys_sound_processor Sys_Set_SoundProcessor(sys_sound_processor wanted)
{
    sys_sound_processor before = processor;
    HAL_STORE(processor, wanted != NULL ? wanted : Sys_Default_SoundProcessor);
    return before;
}

sint16 Sys_Get_Sound(uint8 microphone)
{
    return HAL_LOAD(latest[microphone % SYS_MICROPHONES]);
}
