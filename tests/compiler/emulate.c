/*
 * emulate.c - runs compiled applications under QEMU's user mode and prints the memory they leave.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Freestanding: only the processor, Linux' write and exit, and the compiler's own library. One line per cycle:
 * application, cycle, exception, data area in hex. apps.h holds the applications.
 */
typedef unsigned char u8;
typedef unsigned int u32;
typedef void (*function)(void);

typedef struct {
    long long time_ns;
    int time_ms;
    u32 reserved;
    u8 *area[6];
    const function *imports;
} context_t;

typedef struct {
    const u8 *code;
    u32 data_size, init, task;
    const function *imports;
} app_t;

enum { CYCLES = 3 };

static void raise_exception(u32 code);

#include "apps.h"

static u8 data[4096] __attribute__((aligned(16)));
static context_t context;
static u32 app, cycle, raised;

void *memset(void *to, int value, unsigned long size)
{
    for (u8 *p = to; size > 0; size--)
        *p++ = (u8)value;
    return to;
}

/* The division of libgcc on Linux calls it for a divisor of 0. */
int raise(int signal)
{
    (void)signal;
    return 0;
}

/* ---- what differs between processors ---- */

#if defined(__aarch64__)
static void sys(long number, long a, long b, long c)
{
    register long x8 __asm__("x8") = number, x0 __asm__("x0") = a, x1 __asm__("x1") = b, x2 __asm__("x2") = c;
    __asm__ volatile("svc 0" : "+r"(x0) : "r"(x8), "r"(x1), "r"(x2) : "memory");
}
enum { SYS_WRITE = 64, SYS_EXIT = 93 };

static void call(const app_t *a, u32 offset, u32 argument)
{
    ((void (*)(const context_t *, u32))(a->code + offset))(&context, argument);
}
__asm__(".globl _start\n_start: bl run\n");
#elif defined(__riscv)
static void sys(long number, long a, long b, long c)
{
    register long a7 __asm__("a7") = number, a0 __asm__("a0") = a, a1 __asm__("a1") = b, a2 __asm__("a2") = c;
    __asm__ volatile("ecall" : "+r"(a0) : "r"(a7), "r"(a1), "r"(a2) : "memory");
}
enum { SYS_WRITE = 64, SYS_EXIT = 93 };

static void call(const app_t *a, u32 offset, u32 argument)
{
    register const function *base __asm__("s11") = a->imports;
    register const context_t *a0 __asm__("a0") = &context;
    register u32 a1 __asm__("a1") = argument;
    __asm__ volatile("jalr ra, %2, 0"
                     : "+r"(a0), "+r"(a1)
                     : "r"(a->code + offset), "r"(base)
                     : "ra", "t0", "t1", "t2", "t3", "t4", "t5", "t6", "a2", "a3", "a4", "a5", "a6", "a7", "memory");
}
__asm__(".globl _start\n_start:\n.option push\n.option norelax\nla gp, __global_pointer$\n.option pop\ncall run\n");
#else
static void sys(long number, long a, long b, long c)
{
    register long r7 __asm__("r7") = number, r0 __asm__("r0") = a, r1 __asm__("r1") = b, r2 __asm__("r2") = c;
    __asm__ volatile("svc 0" : "+r"(r0) : "r"(r7), "r"(r1), "r"(r2) : "memory");
}
enum { SYS_WRITE = 4, SYS_EXIT = 1 };

static void call(const app_t *a, u32 offset, u32 argument)
{
    register const function *base __asm__("r9") = a->imports;
    register const context_t *r0 __asm__("r0") = &context;
    register u32 r1 __asm__("r1") = argument;
    __asm__ volatile("blx %2"
                     : "+r"(r0), "+r"(r1)
                     : "r"(a->code + offset), "r"(base)
                     : "r2", "r3", "r12", "lr", "cc", "memory");
}
__asm__(".thumb\n.thumb_func\n.globl _start\n_start: bl run\n");
#endif

/* ---- the same for all ---- */

static char *hex(char *to, u32 value, int digits)
{
    while (digits-- > 0)
        *to++ = "0123456789abcdef"[value >> 4 * digits & 15];
    return to;
}

static void report(void)
{
    static char line[2 * sizeof data + 40];
    char *to = hex(line, app, 8);

    *to++ = ' ';
    to = hex(to, cycle, 8);
    *to++ = ' ';
    to = hex(to, raised, 8);
    *to++ = ' ';
    for (u32 i = 0; i < apps[app].data_size; i++)
        to = hex(to, data[i], 2);
    *to++ = '\n';
    sys(SYS_WRITE, 1, (long)line, to - line);
}

static void start(void)
{
    memset(data, 0, sizeof data);
    for (int i = 0; i < 5; i++)
        context.area[i] = data;
    context.area[5] = (u8 *)apps[app].code;
    context.imports = apps[app].imports;
    call(&apps[app], apps[app].init, 1);
}

/* Runs what is left. An exception comes here again and never returns, which costs only stack. */
void run(void)
{
    for (; app < sizeof apps / sizeof apps[0]; app++, cycle = 0) {
        if (cycle == 0)
            start();
        while (cycle < CYCLES) {
            raised = 0;
            call(&apps[app], apps[app].task, 0);
            report();
            cycle++;
        }
    }
    sys(SYS_EXIT, 0, 0, 0);
}

static void raise_exception(u32 code)
{
    raised = code;
    report();
    cycle++;
    run();
}
