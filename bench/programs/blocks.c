/*
 * blocks.c - twin of blocks.st.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

enum { LINES = 100 };

typedef struct {
    bool last, q;
} R_TRIG;

typedef struct {
    bool last, q;
    int16_t cv;
} CTU;

typedef struct {
    int32_t start, et;
    bool q, running;
} TON;

extern int64_t now_ms;
uint32_t chk;
static uint32_t noise;
static R_TRIG edges[LINES];
static CTU counters[LINES];
static TON timers[LINES];

void scan_init(void)
{
    memset(edges, 0, sizeof edges);
    memset(counters, 0, sizeof counters);
    memset(timers, 0, sizeof timers);
    noise = 0x2545F491;
    chk = 0;
}

static void r_trig(R_TRIG *t, bool clk)
{
    t->q = clk && !t->last;
    t->last = clk;
}

static void ctu(CTU *c, bool cu, bool reset, int16_t pv)
{
    if (reset)
        c->cv = 0;
    else if (cu && !c->last && c->cv < INT16_MAX)
        c->cv++;
    c->last = cu;
    c->q = c->cv >= pv;
}

static void ton(TON *t, bool in, int32_t pt)
{
    int32_t now = (int32_t)now_ms;

    if (!in) {
        t->running = false;
        t->et = 0;
        t->q = false;
        return;
    }
    if (!t->running) {
        t->running = true;
        t->start = now;
    }
    t->et = now - t->start;
    t->q = t->et >= pt;
    if (t->q)
        t->et = pt;
}

void scan(void)
{
    int32_t sum = 0;

    noise ^= noise << 13;
    noise ^= noise >> 17;
    noise ^= noise << 5;
    for (int i = 0; i < LINES; i++) {
        r_trig(&edges[i], noise >> (i % 32) & 1);
        ctu(&counters[i], edges[i].q, counters[i].q, 7);
        ton(&timers[i], !counters[i].q, 19);
        sum += counters[i].cv;
        if (timers[i].q)
            sum += 100;
    }
    chk = (chk << 1 | chk >> 31) ^ (uint32_t)sum;
}
