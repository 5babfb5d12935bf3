/* SPDX-License-Identifier: MIT */
/* Spellings of the original repository and of the paper's Listing 1, for sources written against them. */
#ifndef OPENSWARM_COMPAT_H
#define OPENSWARM_COMPAT_H

#include "openswarm.h"
#include "openswarm_io.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef sys_function pFunction;
typedef sys_handler pEventHandlerFunction;
typedef sys_condition pConditionFunction;
typedef sys_event_data Sys_event_data;

#define System_Start_Process Sys_Start_Process
#define Sys_Wait_For_Event Sys_Wait_for_Event
#define Sys_Wait_For_Condition Sys_Wait_for_Condition
#define Sys_Get_SystemClock Sys_Get_SystemTime
#define Sys_Get_LeftWheelSpeed Sys_Get_MotorSpeed_Left
#define Sys_Get_RightWheelSpeed Sys_Get_MotorSpeed_Right
#define Sys_Set_LeftWheelSpeed(mm_per_s) ((void)Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, (uint16)(mm_per_s)))
#define Sys_Set_RightWheelSpeed(mm_per_s) ((void)Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)(mm_per_s)))
#define Sys_Unsubscribe_Handler_from_Event(event, handler, pid) Sys_Unsubscribe_Handler((event), (pid), (handler))
#define Sys_Writeto_UART1(data, size) ((void)Sys_Write_UART1((data), (size)))
#define Sys_Writeto_UART2(data, size) ((void)Sys_Write_UART2((data), (size)))

#define SYS_EVENT_IO_MOTOR_LEFT SYS_LEFTMOTOR_SPEED
#define SYS_EVENT_IO_MOTOR_RIGHT SYS_RIGHTMOTOR_SPEED
#define SYS_EVENT_IO_CAMERA SYS_IO_1PXSENSOR
#define SYS_EVENT_IO_REMOECONTROL SYS_IO_REMOTECONTROL
#define SYS_EVENT_IO_TO_BLUETOOTH SYS_SEND_UART1
#define SYS_EVENT_IO_SELECTOR_CHANGE SYS_IO_SELECTOR
#define SYS_EVENT_1ms_CLOCK SYS_1ms_TIMER

#ifdef __cplusplus
}
#endif

#endif
