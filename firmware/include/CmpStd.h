/*
 * CmpStd.h - the types every component uses.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Headers marked "shared with the host" are read twice: by the C compiler, and (through the preprocessor with RTS_CFFI
 * defined) by the host tool. They hold only typedefs, structs, enums and prototypes, so that both sides have one
 * definition.
 */
#ifndef CMPSTD_H
#define CMPSTD_H

#ifndef RTS_CFFI
#include <stddef.h>
#include <stdint.h>
#include <stdbool.h>
#endif

typedef uint8_t RTS_UI8;
typedef uint16_t RTS_UI16;
typedef uint32_t RTS_UI32;
typedef uint64_t RTS_UI64;
typedef int8_t RTS_I8;
typedef int16_t RTS_I16;
typedef int32_t RTS_I32;
typedef int64_t RTS_I64;
typedef float RTS_REAL32;
typedef double RTS_REAL64;
typedef size_t RTS_SIZE;

/* Result of every function that can fail: ERR_OK or another number of CmpErrors.h. */
typedef RTS_UI32 RTS_RESULT;

/* Names an object of a component: a small index (plus generation), never a pointer. */
typedef RTS_UI32 RTS_HANDLE;
#define RTS_INVALID_HANDLE ((RTS_HANDLE) - 1)

/* Any function; cast to the right type before the call. */
typedef void (*RTS_PFN)(void);

#ifndef RTS_CFFI
/* Fails to compile when cond is false (C99 has no _Static_assert). */
#define RTS_STATIC_ASSERT(cond, name) typedef char rts_assert_##name[(cond) ? 1 : -1]
#define RTS_COUNT(array) (sizeof(array) / sizeof((array)[0]))
#define RTS_UNUSED(x) ((void)(x))
/* Of a function whose frame or whose name is needed, by what measures it, when the program is optimised as a whole. */
#ifdef __GNUC__
#define RTS_NOINLINE __attribute__((noinline))
/* Of a small function that runs in each cycle, also where the compiler saves room. */
#define RTS_INLINE inline __attribute__((always_inline))
/* Of a function with a format, which is argument `number`: the compiler checks those from `first` on, and refuses a text
 * in its place that is no literal: it may be of a client. */
#define RTS_FORMAT(number, first) __attribute__((format(printf, number, first)))
#else
#define RTS_NOINLINE
#define RTS_INLINE inline
#define RTS_FORMAT(number, first)
#endif
#endif

#endif
