/*
 * tanks.c - the tanks example in C, as a careful C programmer would write it; the yardstick for the compiled ST.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The same algorithm, in the same order and in single precision: after the same cycles both hold the same levels, bit for bit
 * (compile with -ffp-contract=off). Run plant_cycle and control_cycle every 10 ms, the plant first.
 */
#include "tanks.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define CONTROL_STEP 0.010f
#define PLANT_STEP 0.010f

/* ---- standard function blocks ---- */

typedef struct {
    bool q, running;
    int32_t et, start;
} timer_on;

static bool ton(timer_on *t, bool in, int32_t pt, int32_t now)
{
    if (!in) {
        t->q = false;
        t->et = 0;
        t->running = false;
    } else if (!t->q) {
        if (!t->running) {
            t->running = true;
            t->start = now;
        }
        t->et = now - t->start;
        if (t->et >= pt) {
            t->et = pt;
            t->q = true;
        }
    }
    return t->q;
}

static bool rise(bool *last, bool clk)
{
    bool q = clk && !*last;
    *last = clk;
    return q;
}

static float limit(float low, float value, float high)
{
    float least = value > low ? value : low;
    return least < high ? least : high;
}

/* ---- the controller's blocks ---- */

typedef struct {
    float gain, integral_time, derivative_time;
} pid_parameters;

typedef struct {
    float integral, last_actual;
} pid_state;

static float pid(pid_state *s, const pid_parameters *p, float setpoint, float actual, bool hold)
{
    const float low = 0.0f, high = 100.0f;
    float error = setpoint - actual;
    float slope = (actual - s->last_actual) / CONTROL_STEP;
    float wanted = p->gain * (error - p->derivative_time * slope) + s->integral;
    float output = limit(low, wanted, high);

    s->last_actual = actual;
    if (!hold && (wanted == output || (wanted > high) == (error < 0.0f))) {
        s->integral = limit(low, s->integral + p->gain * error * CONTROL_STEP / p->integral_time, high);
    }
    return output;
}

static bool hysteresis(bool *on, float value, float on_limit, float off_limit)
{
    if (value > on_limit) {
        *on = true;
    } else if (value < off_limit) {
        *on = false;
    }
    return *on;
}

typedef struct {
    bool run;
    uint32_t starts;
    timer_on on, off;
} motor_guard;

static bool guard_motor(motor_guard *g, bool request, bool permit, int32_t now)
{
    bool on_long_enough = ton(&g->on, g->run, 1000, now);
    bool off_long_enough = ton(&g->off, !g->run, 500, now);

    if (!permit) {
        g->run = false;
    } else if (g->run) {
        g->run = request || !on_long_enough;
    } else if (request && off_long_enough) {
        g->run = true;
        g->starts++;
    }
    return g->run;
}

typedef struct {
    timer_on low, high;
    bool appeared, acknowledged, pending;
} level_alarm;

static void watch_level(level_alarm *a, float level, float low_limit, float high_limit, bool acknowledge, int32_t now)
{
    bool low = ton(&a->low, level < low_limit, 2000, now);
    bool high = ton(&a->high, level > high_limit, 2000, now);
    bool appeared = rise(&a->appeared, low || high);
    bool acknowledged = rise(&a->acknowledged, acknowledge);

    a->pending = appeared || (a->pending && !acknowledged);
}

/* ---- the signals between the two ---- */

static struct {
    float level1, level2, speed;
    bool inlet, pump;
} field;

/* ---- controller ---- */

enum { MODE_OFF, MODE_MANUAL, MODE_AUTOMATIC };

static struct {
    float setpoint, manual_speed;
    int mode;
    bool plant_ok, acknowledge;
    pid_parameters parameters;
    bool pump, inlet, alarm_low, alarm_high, alarm_supply, alarm_plant, horn;
    float speed;
    pid_state pid;
    bool supply_ok, supply_full, worth_pumping;
    motor_guard guard;
    level_alarm process_alarm, supply_alarm;
} control;

void control_cycle(int32_t now_ms)
{
    float output = pid(&control.pid, &control.parameters, limit(0.0f, control.setpoint, 85.0f), field.level2,
                       !control.pump || control.mode != MODE_AUTOMATIC);
    float wanted_speed = 0.0f;

    if (control.mode == MODE_MANUAL) {
        wanted_speed = limit(0.0f, control.manual_speed, 100.0f);
    } else if (control.mode == MODE_AUTOMATIC) {
        wanted_speed = output;
    }

    hysteresis(&control.supply_ok, field.level1, 12.0f, 6.0f);
    hysteresis(&control.worth_pumping, wanted_speed, 5.0f, 1.0f);
    control.pump = guard_motor(&control.guard, control.worth_pumping,
                               control.plant_ok && control.supply_ok && field.level2 < 95.0f, now_ms);
    control.speed = control.pump ? wanted_speed : 0.0f;
    hysteresis(&control.supply_full, field.level1, 85.0f, 60.0f);
    control.inlet = control.plant_ok && !control.supply_full;

    watch_level(&control.process_alarm, field.level2, 10.0f, 90.0f, control.acknowledge, now_ms);
    watch_level(&control.supply_alarm, field.level1, 10.0f, 95.0f, control.acknowledge, now_ms);
    control.alarm_low = control.process_alarm.low.q;
    control.alarm_high = control.process_alarm.high.q;
    control.alarm_supply = control.supply_alarm.low.q || control.supply_alarm.high.q;
    control.alarm_plant = !control.plant_ok;
    control.horn = control.process_alarm.pending || control.supply_alarm.pending;

    field.pump = control.pump;
    field.speed = control.speed;
    field.inlet = control.inlet;
}

/* ---- plant ---- */

typedef struct {
    float volume, level;
} tank;

static struct {
    float demand, pump_speed;
    tank supply, process;
} plant;

static float fill(tank *t, float capacity, float inflow, float outflow)
{
    t->volume = limit(0.0f, t->volume + (inflow - outflow) * PLANT_STEP, capacity);
    t->level = t->volume / capacity * 100.0f;
    return t->level;
}

void plant_cycle(int32_t now_ms)
{
    float inlet_flow = field.inlet ? 15.0f : 0.0f;
    float pump_flow, consumer_flow;

    (void)now_ms;
    plant.pump_speed = plant.pump_speed + ((field.pump ? field.speed : 0.0f) - plant.pump_speed) * PLANT_STEP / 0.3f;
    pump_flow = plant.supply.level > 0.0f ? 20.0f * plant.pump_speed / 100.0f : 0.0f;
    consumer_flow = 10.0f * limit(0.0f, plant.demand, 1.0f) * sqrtf(plant.process.level / 100.0f);
    field.level1 = fill(&plant.supply, 400.0f, inlet_flow, pump_flow);
    field.level2 = fill(&plant.process, 200.0f, pump_flow, consumer_flow);
}

/* ---- harness ---- */

void tanks_init(void)
{
    memset(&field, 0, sizeof field);
    memset(&control, 0, sizeof control);
    memset(&plant, 0, sizeof plant);
    control.plant_ok = true;
    control.setpoint = 50.0f;
    control.manual_speed = 30.0f;
    control.mode = MODE_AUTOMATIC;
    control.parameters.gain = 8.0f;
    control.parameters.integral_time = 4.0f;
    plant.demand = 1.0f;
    plant.supply.volume = 280.0f;
    plant.process.volume = 10.0f;
}

void tanks_set(float setpoint)
{
    control.setpoint = setpoint;
}

void tanks_levels(float *level1, float *level2)
{
    *level1 = field.level1;
    *level2 = field.level2;
}

uint32_t tanks_checksum(void)
{
    uint32_t bits1, bits2;
    memcpy(&bits1, &field.level1, sizeof bits1);
    memcpy(&bits2, &field.level2, sizeof bits2);
    return bits1 * 31u + bits2;
}
