/*
 * SysAtomic.h - flags and counters shared between main, tasks and interrupts.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Objects of at most 32 bits. Load acquires, Store releases: what was written before a Store is seen after the Load that
 * reads it. Add returns the value before; a core without exclusive access instructions (Cortex-M0) supplies
 * __atomic_fetch_add_4 with interrupts masked. Fence keeps reads and writes before it from mixing with those after it, for
 * a number that is changed, or looked at, both before and after the data it stands for.
 */
#ifndef SYSATOMIC_H
#define SYSATOMIC_H

#define SysAtomicLoad(object) __atomic_load_n((object), __ATOMIC_ACQUIRE)
#define SysAtomicStore(object, value) __atomic_store_n((object), (value), __ATOMIC_RELEASE)
#define SysAtomicAdd(object, value) __atomic_fetch_add((object), (value), __ATOMIC_ACQ_REL)
#define SysAtomicFence() __atomic_thread_fence(__ATOMIC_ACQ_REL)

#endif
