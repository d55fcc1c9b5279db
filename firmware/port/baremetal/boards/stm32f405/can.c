/*
 * can.c - CAN1 at PB8 and PB9, for BxCan.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * QEMU's netduinoplus2 has no CAN: BxCan.c is tested on a model of its registers (tests/c/test_bxcan.c).
 */
#include "BareMetal.h"
#include "BxCan.h"
#include "OneUart.h"

#define CAN1 0x40006400u
#define RCC_AHB1ENR REG32(0x40023830u)
#define RCC_APB1ENR REG32(0x40023840u)
#define GPIOB 0x40020400u
#define GPIO_MODER(port) REG32((port) + 0x00)
#define GPIO_AFR(port, pin) REG32((port) + 0x20 + (pin) / 8 * 4)

enum { APB1_HZ = 42000000, BANKS = 28 };

/* CAN2 is not used, so CAN1 has all banks of the pair. */
const BXCAN BoardCan[BOARD_CAN_COUNT] = {{CAN1, APB1_HZ, CAN1, 0, BANKS, BANKS}};

static void give_pin(RTS_UI32 pin)
{
    enum { ALTERNATE = 2, AF_CAN1 = 9 };
    GPIO_MODER(GPIOB) = (GPIO_MODER(GPIOB) & ~(3u << 2 * pin)) | (RTS_UI32)ALTERNATE << 2 * pin;
    GPIO_AFR(GPIOB, pin) = (GPIO_AFR(GPIOB, pin) & ~(0xFu << pin % 8 * 4)) | (RTS_UI32)AF_CAN1 << pin % 8 * 4;
}

void BoardCanStart(RTS_UI32 index)
{
    enum { AHB1_GPIOB = 1 << 1, APB1_CAN1 = 1 << 25, RX_PIN = 8, TX_PIN = 9 };
    RTS_UNUSED(index);
    RCC_AHB1ENR |= AHB1_GPIOB;
    RCC_APB1ENR |= APB1_CAN1;
    (void)RCC_APB1ENR; /* as in start_timers of board.c */
    give_pin(RX_PIN);
    give_pin(TX_PIN);
    IrqEnable(IRQ_CAN1_TX, LEVEL_DEVICE);
    IrqEnable(IRQ_CAN1_RX0, LEVEL_DEVICE);
    IrqEnable(IRQ_CAN1_RX1, LEVEL_DEVICE);
}

void CanIrq(void)
{
    BxCanInterrupt(0);
    OneUartNoteWork();
}
