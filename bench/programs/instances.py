"""Makes the benchmark 'instances' in both languages: 100 lines of R_TRIG, CTU and TON, each block a variable of its
own, as programs of people are written. The twin keeps the inputs in the struct of the block too."""

from __future__ import annotations

LINES = 100

_ST = """(* 300 calls of standard function blocks, each instance a variable of its own. *)
PROGRAM Bench
VAR
    chk : DWORD;
    noise : DWORD := 16#2545F491;
    sum : DINT;
    {declarations}
END_VAR
noise := noise XOR SHL(noise, 13);
noise := noise XOR SHR(noise, 17);
noise := noise XOR SHL(noise, 5);
sum := 0;
{calls}
chk := ROL(chk, 1) XOR DINT_TO_DWORD(sum);
END_PROGRAM

CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK Cycle(INTERVAL := T#1ms, PRIORITY := 1);
        PROGRAM Main WITH Cycle : Bench;
    END_RESOURCE
END_CONFIGURATION
"""

_ST_CALLS = """rise{n}(CLK := noise.{bit});
counter{n}(CU := rise{n}.Q, R := counter{n}.Q, PV := {limit});
timer{n}(IN := NOT counter{n}.Q, PT := T#{delay}ms);
sum := sum + counter{n}.CV;
IF timer{n}.Q THEN
    sum := sum + {weight};
END_IF;"""

_C = """#include <stdbool.h>
#include <stdint.h>
#include <string.h>

typedef struct {{ bool clk, q, last; }} R_TRIG;
typedef struct {{ bool cu, r; int16_t pv; bool q; int16_t cv; bool last; }} CTU;
typedef struct {{ bool in; int32_t pt; bool q; int32_t et; bool running; int32_t start; }} TON;

extern int64_t now_ms;
uint32_t chk;
static struct {{
    uint32_t noise;
    {declarations}
}} v;

static void r_trig(R_TRIG *t)
{{
    t->q = t->clk && !t->last;
    t->last = t->clk;
}}

static void ctu(CTU *c)
{{
    if (c->r)
        c->cv = 0;
    else if (c->cu && !c->last && c->cv < INT16_MAX)
        c->cv++;
    c->last = c->cu;
    c->q = c->cv >= c->pv;
}}

static void ton(TON *t, int32_t now)
{{
    if (!t->in) {{
        t->q = false;
        t->et = 0;
        t->running = false;
    }} else if (!t->q) {{
        if (!t->running) {{
            t->running = true;
            t->start = now;
        }}
        t->et = now - t->start;
        if (t->et >= t->pt) {{
            t->et = t->pt > 0 ? t->pt : 0;
            t->q = true;
        }}
    }}
}}

void scan_init(void) {{ memset(&v, 0, sizeof v); v.noise = 0x2545F491; chk = 0; }}

void scan(void)
{{
    int32_t sum = 0, now = (int32_t)now_ms;
    v.noise ^= v.noise << 13;
    v.noise ^= v.noise >> 17;
    v.noise ^= v.noise << 5;
    {calls}
    chk = (chk << 1 | chk >> 31) ^ (uint32_t)sum;
}}
"""

_C_CALLS = """v.rise{n}.clk = v.noise >> {bit} & 1;
    r_trig(&v.rise{n});
    v.counter{n}.cu = v.rise{n}.q;
    v.counter{n}.r = v.counter{n}.q;
    v.counter{n}.pv = {limit};
    ctu(&v.counter{n});
    v.timer{n}.in = !v.counter{n}.q;
    v.timer{n}.pt = {delay};
    ton(&v.timer{n}, now);
    sum += v.counter{n}.cv;
    if (v.timer{n}.q)
        sum += {weight};"""


def texts() -> tuple[str, str]:
    """The program in ST and its twin in C."""
    numbers = [{"n": n, "bit": n % 32, "limit": 5 + n % 11, "delay": 3 + n % 17, "weight": n + 1} for n in range(LINES)]
    st = _ST.format(
        declarations="\n    ".join(f"rise{n} : R_TRIG; counter{n} : CTU; timer{n} : TON;" for n in range(LINES)),
        calls="\n".join(_ST_CALLS.format(**line) for line in numbers),
    )
    c = _C.format(
        declarations="\n    ".join(f"R_TRIG rise{n}; CTU counter{n}; TON timer{n};" for n in range(LINES)),
        calls="\n    ".join(_C_CALLS.format(**line) for line in numbers),
    )
    return st, c
