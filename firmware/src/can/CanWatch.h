/*
 * CanWatch.h - ends bus off, and says so in the log.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * For the one owner of a controller: CmpCan, or the block driver where it is the only user. From main.
 */
#ifndef CANWATCH_H
#define CANWATCH_H

#include "CmpItf.h"
#include "CmpLog.h"
#include "SysCan.h"

typedef struct {
    bool off;           /* `changed_ms` since when, or when it was started again */
    RTS_UI16 times_off; /* in this trouble; 0: none, 0xFFFF: as often or more */
    RTS_UI32 changed_ms;
} CAN_WATCH;

/* A trouble lasts until the bus has been on for a while, and is two entries of the log, however often it goes off. */
static inline void CanWatchGoOff(CAN_WATCH *watch, RTS_UI32 component)
{
    if (watch->times_off == 0)
        LogAdd(component, LOG_WARNING, ERR_DEVICE, "CAN: bus off; check the bit rate and the cable");
    if (watch->times_off < 0xFFFF)
        watch->times_off++;
}

static inline void CanWatchEndTrouble(CAN_WATCH *watch, RTS_UI32 component)
{
    LogAdd(component, LOG_INFO, ERR_OK, "CAN: the bus is back (times off: %u)", (unsigned)watch->times_off);
    watch->times_off = 0;
}

/* In each pass. The controller tries again after a while; if the bus is still bad, it goes off again. Returns true if
 * the bus has just gone off, or has just come back. */
static inline bool CanWatchPoll(CAN_WATCH *watch, RTS_UI32 index, RTS_UI32 component, RTS_UI32 now_ms)
{
    CAN_STATE state;

    SysCanGetState(index, &state);
    bool off = state.bus == CAN_BUS_OFF;
    bool changed = off != watch->off;
    RTS_UI32 since_ms = now_ms - watch->changed_ms;
    if (changed) {
        watch->changed_ms = now_ms;
        if (off)
            CanWatchGoOff(watch, component);
    } else if (off && since_ms >= CAN_RESTART_MS) {
        watch->changed_ms = now_ms;
        SysCanRestart(index);
    } else if (!off && watch->times_off != 0 && since_ms >= CAN_STEADY_MS) {
        CanWatchEndTrouble(watch, component);
    }
    watch->off = off;
    return changed;
}

#endif
