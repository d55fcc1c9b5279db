/*
 * tables.c - twin of tables.st.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

uint32_t chk;
static uint32_t noise;
static int16_t curve[33];
static int32_t ring[100];
static int32_t histogram[17];
static int32_t head;
static int32_t sum;

void scan_init(void)
{
    memset(ring, 0, sizeof ring);
    memset(histogram, 0, sizeof histogram);
    for (int i = 0; i <= 32; i++)
        curve[i] = (int16_t)(i * i * 4 - i * 100);
    noise = 0x2545F491;
    head = 0;
    sum = 0;
    chk = 0;
}

void scan(void)
{
    for (int i = 0; i < 50; i++) {
        int32_t x, segment, value, mean;

        noise ^= noise << 13;
        noise ^= noise >> 17;
        noise ^= noise << 5;
        x = (int32_t)(noise & 0x1FFF);
        segment = x / 256;
        value = curve[segment] + (curve[segment + 1] - curve[segment]) * (x % 256) / 256;
        sum += value - ring[head];
        ring[head] = value;
        head = (head + x) % 100;
        mean = sum / (abs(value) + 1);
        mean = mean < -8 ? -8 : mean > 8 ? 8 : mean;
        histogram[mean + 8]++;
    }
    chk = (chk << 1 | chk >> 31) ^ (uint32_t)sum ^ (uint32_t)histogram[3 + 8];
}
