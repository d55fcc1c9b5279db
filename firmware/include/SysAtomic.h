/*
 * SysAtomic.h - flags and counters shared between main, tasks and interrupts.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Objects of type RTS_UI32. Load acquires, Store releases: what was written before a Store is seen after the Load that
 * reads it. Add returns the previous value, Replace whether it was the one expected and is now the other; a core without
 * exclusive access instructions (Cortex-M0) supplies __atomic_fetch_add_4 and __atomic_compare_exchange_4 with
 * interrupts masked. Fence keeps reads and writes before it from mixing with those after it,
 * for a number that is changed, or looked at, both before and after the data it stands for.
 */
#ifndef SYSATOMIC_H
#define SYSATOMIC_H

#include "CmpStd.h"
#include "rts_config.h"

/* Shorter than a call also where the compiler looks at size. */
#define SYSATOMIC_INLINE static inline __attribute__((always_inline))

#if RTS_ONE_CORE
#define SysAtomicFence() __atomic_signal_fence(__ATOMIC_ACQ_REL)
#else
#define SysAtomicFence() __atomic_thread_fence(__ATOMIC_ACQ_REL)
#endif

SYSATOMIC_INLINE RTS_UI32 SysAtomicLoad(const RTS_UI32 *object)
{
#if RTS_ONE_CORE
    RTS_UI32 value = __atomic_load_n(object, __ATOMIC_RELAXED);

    SysAtomicFence();
    return value;
#else
    return __atomic_load_n(object, __ATOMIC_ACQUIRE);
#endif
}

SYSATOMIC_INLINE void SysAtomicStore(RTS_UI32 *object, RTS_UI32 value)
{
#if RTS_ONE_CORE
    SysAtomicFence();
    __atomic_store_n(object, value, __ATOMIC_RELAXED);
#else
    __atomic_store_n(object, value, __ATOMIC_RELEASE);
#endif
}

SYSATOMIC_INLINE RTS_UI32 SysAtomicAdd(RTS_UI32 *object, RTS_UI32 value)
{
#if RTS_ONE_CORE
    RTS_UI32 before;

    SysAtomicFence();
    before = __atomic_fetch_add(object, value, __ATOMIC_RELAXED);
    SysAtomicFence();
    return before;
#else
    return __atomic_fetch_add(object, value, __ATOMIC_ACQ_REL);
#endif
}

SYSATOMIC_INLINE bool SysAtomicReplace(RTS_UI32 *object, RTS_UI32 expected, RTS_UI32 value)
{
#if RTS_ONE_CORE
    bool replaced;

    SysAtomicFence();
    replaced = __atomic_compare_exchange_n(object, &expected, value, false, __ATOMIC_RELAXED, __ATOMIC_RELAXED);
    SysAtomicFence();
    return replaced;
#else
    return __atomic_compare_exchange_n(object, &expected, value, false, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE);
#endif
}

/* Gives the bits of `mask` in a byte the values they have in `value`; what a task writes to its other bits at the same
 * time is not undone. Within SysLock, which on one core, such as one without instructions for it, keeps the tasks out. */
SYSATOMIC_INLINE void SysAtomicSetBits(RTS_UI8 *byte, RTS_UI8 mask, RTS_UI8 value)
{
#if RTS_ONE_CORE || !defined(__GCC_HAVE_SYNC_COMPARE_AND_SWAP_1)
    *(volatile RTS_UI8 *)byte = (RTS_UI8)((*(volatile RTS_UI8 *)byte & ~mask) | (value & mask));
#else
    (void)__atomic_fetch_and(byte, (RTS_UI8)(value | ~mask), __ATOMIC_RELAXED);
    (void)__atomic_fetch_or(byte, (RTS_UI8)(value & mask), __ATOMIC_RELAXED);
#endif
}

#endif
