/*
 * OneUart.h - SysCom and BoardHasWork for a board with one serial line (OneUart.c), and what the board's UART gives.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef ONEUART_H
#define ONEUART_H

#include "SysCom.h"

/* To be called by the UART's interrupt, after what it does not clear by itself has been cleared. */
void OneUartInterrupt(void);

/* Main has something to do: of other interrupts of the board. */
void OneUartNoteWork(void);

/* ---- what the board writes; all but UartStart, UartStop and UartIsOn with interrupts masked ---- */

/* Forgets what is in the FIFOs, and sends and receives from now on, with an interrupt for a received byte and for room to
 * send. False when it cannot run like that. */
bool UartStart(const SYSCOM_SETTINGS *settings);
void UartStop(void);
bool UartIsOn(void);

/* Takes a received byte; false when there is none. */
bool UartTake(RTS_UI8 *byte);

/* Whether there is room for a byte to send, and sends one. */
bool UartHasRoom(void);
void UartSend(RTS_UI8 byte);

#endif
