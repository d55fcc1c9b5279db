/*
 * Sim.h - the simulator: the whole runtime in one process, on a virtual clock (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Time passes only in SimAdvance and SimRunCycles. Everything but one supervising thread runs in the caller's thread:
 * call from one thread only. What is in flash survives SimStart; all else is lost, as it is when power comes back.
 *
 * A function that runs the runtime returns SIM_POWER_CUT when a planned power cut hit it, and does nothing but return
 * that until SimStart.
 */
#ifndef SIM_H
#define SIM_H

#include "CmpErrors.h"
#include "CmpStd.h"
#include "IoConfig.h"
#include "SysStart.h"

enum { SIM_POWER_CUT = 0x8001 };

/* ---- power ---- */

/* Power on; when it is on already, it was off for a moment. Time starts at 0, the boot project runs. ERR_* of the
 * component that does not start up. */
RTS_RESULT SimStart(void);

/* What SysStartGet says at the next SimStart, and only there: after that it is SYS_START_POWER again. At most 31
 * characters of the text are kept. */
void SimSetStart(const SYS_START *start);

/* Shuts down in good order. Does nothing when it is off. */
void SimStop(void);

/* Whether power is on. */
bool SimIsOn(void);

/* ---- time ---- */

/*
 * Lets `ns` of virtual time pass: each task runs when it is due (by time, then priority), event tasks as soon as the
 * cycle that set their variable is over, background work (CH_COMM_CYCLE) runs at least once at the end. ERR_NOTINITIALIZED when power is off,
 * ERR_PARAMETER for a negative time and when the clock would pass 292 years.
 */
RTS_RESULT SimAdvance(RTS_I64 ns);

/* The same, but what is due at the very end does not run yet: ten times 10 ms are ten cycles of a 10 ms task. */
RTS_RESULT SimRunFor(RTS_I64 ns);

/* Lets time pass until the first task of the application has run `cycles` more cycles. ERR_INVALID_STATE when the
 * application does not run, ERR_EXCEPTION when it stopped on the way, ERR_TIMEOUT when the task did not run for
 * SIM_RUN_LIMIT_MS of virtual time. */
enum { SIM_RUN_LIMIT_MS = 3600 * 1000 };
RTS_RESULT SimRunCycles(RTS_UI32 cycles);

/* The same, but not beyond the time `until_ns`, which is ERR_PENDING; what is due then does not run yet. */
RTS_RESULT SimRunCyclesUntil(RTS_UI32 cycles, RTS_I64 until_ns);

/* Lets `ns` of virtual time pass for devices alone: it is called by SIM_FUNCTION, whose cycle lasts until it returns.
 * Outputs leave, and inputs come, at once, at the end, and as often as the first task runs otherwise. Errors as
 * SimAdvance; ERR_INVALID_STATE when there is no task. */
RTS_RESULT SimRunDevices(RTS_I64 ns);

/* One round of background work (communication, exceptions); no time passes. */
RTS_RESULT SimCommCycle(void);

/* Virtual time since SimStart [ns]. */
RTS_I64 SimNow(void);

enum { SIM_CLOCK_FIRST_S = 946684800 }; /* 2000-01-01 in s since 1970-01-01 */

/* Sets the wall clock of the device, UTC as ns since 1970-01-01; SIM_CLOCK_FIRST_S if never set. It follows virtual time,
 * also over SimStart. */
void SimSetClock(RTS_I64 utc_ns);

/* Cycles that take longer than this in time of the processor [ms] are aborted as endless; the default, and what 0 sets,
 * is SIM_CYCLE_LIMIT_MS. */
void SimSetCycleLimit(RTS_UI32 ms);

/* ---- the device ---- */

/* Who the device is from now on; the default is plctool's target for the machine it runs on. */
void SimSetTarget(RTS_UI32 type, RTS_UI32 id, RTS_UI32 version);
void SimSetBoard(const char *name); /* the text stays; NULL: any board */

enum { SIM_EVENT_NAME_SIZE = 64 };

/* Gives the device an external event that tasks may wait for; it has it until they are all forgotten. ERR_PARAMETER for
 * a name that is empty or too long, ERR_NOMEMORY when it has SCHED_MAX_EXTERNAL_EVENTS. */
RTS_RESULT SimAddEvent(const char *name);
void SimForgetEvents(void);

/* The event happens now: the task that waits for it runs when time passes, or passes on. ERR_NO_OBJECT when the device
 * has no such event. */
RTS_RESULT SimPostEvent(const char *name);

/* Whether IEC code can call a C function of this name (lower case). While power is off nothing can be called. */
bool SimHasExternal(const char *name);

enum { SIM_MAX_PASSED = 64 };

/*
 * A function of the program that the host implements: its number, the addresses of its parameters (at most
 * SIM_MAX_PASSED), and where its result goes (NULL for none). Returns RTSEXCPT_NOEXCEPTION, or what the program ends
 * with. It is called in the thread that lets time pass; it must let time pass by SimRunDevices only, and not switch power.
 */
typedef RTS_UI32 (*SIM_FUNCTION)(RTS_UI32 number, RTS_UI8 **parameters, RTS_UI8 *result);

/* All functions of the program that the host implements; NULL: it implements none. Kept when power is off. */
void SimSetFunction(SIM_FUNCTION function);

/*
 * Real time one call of a task takes [ns], both the best of several batches: its code alone, called back to back with
 * the time of the task advancing by its interval; and a complete IecTaskCycle with the clock readings around it. Starts
 * the application; its timers go on from the virtual time reached. ERR_INVALIDID no such task, ERR_EXCEPTION it failed.
 */
RTS_RESULT SimBench(RTS_UI32 task, RTS_UI32 cycles, double *code_ns, double *cycle_ns);

/* ---- flash ---- */

/* When power is cut, relative to a flash operation (program or erase): it did not happen; it did; half of its bytes
 * did. */
enum { SIM_CUT_BEFORE = 0, SIM_CUT_AFTER = 1, SIM_CUT_TORN = 2, SIM_FAULT = 3 };
/* SIM_FAULT is not a cut: half of the bytes are done, the operation returns ERR_DEVICE, power stays. */

/* A new, erased flash. From power off. ERR_PARAMETER for a geometry that SysFlash.h does not allow, ERR_NOMEMORY. */
RTS_RESULT SimFlashConfigure(RTS_UI32 size, RTS_UI32 sector_size, RTS_UI32 program_size, RTS_UI8 erased);

/* Bytes of it for files (FileStore.h), whole sectors at its end, two of them for the catalog; the default is 0. Before
 * SimStart; it stays. */
void SimSetFileStore(RTS_UI32 size);

/* Bytes of it for the log that is kept (CmpLogKeep.h), two halves of whole sectors at its very end; the default is 0. Before
 * SimStart; it stays. */
void SimSetKeptLog(RTS_UI32 size);

/* Bytes of RAM that keeps its content while the power is off (SysSram.h), at most 16 KiB, with anything in it; the default is 0.
 * From power off. */
void SimSetSram(RTS_UI32 size);

/* A file, as a program or a tool writes it. While power is on. Errors as FileStoreBegin; ERR_INVALID_STATE: one is being
 * written. */
RTS_RESULT SimPutFile(const char *name, const RTS_UI8 *data, RTS_UI32 size);
/* Name and size of file `index`; "" for an entry that is free. ERR_OUT_OF_LIMITS past the last entry. */
RTS_RESULT SimGetFile(RTS_UI32 index, char name[36], RTS_UI32 *size);
/* Reads all of a file. ERR_NO_OBJECT; ERR_SIZE_MISMATCH: it has another size. */
RTS_RESULT SimReadFile(const char *name, RTS_UI8 *data, RTS_UI32 size);

/* ---- serial ports of programs ---- */

/* Bytes for the program, and from it, on port `number`, from 1 on: how many were taken, or there were. */
RTS_UI32 SimComPutPort(RTS_UI32 number, const RTS_UI8 *data, RTS_UI32 size);
RTS_UI32 SimComGetPort(RTS_UI32 number, RTS_UI8 *data, RTS_UI32 size);

/* ---- network ---- */

enum { SIM_NET_DATA = 2048 };

/* Packets of the simulated network. A connection is asked for, and then accepted or refused; data and its end follow, in
 * order. */
enum { SIM_NET_DATAGRAM, SIM_NET_CONNECT, SIM_NET_ACCEPT, SIM_NET_REFUSE, SIM_NET_DATA_OF, SIM_NET_END };

typedef struct {
    RTS_UI32 kind; /* SIM_NET_* */
    RTS_UI32 from_ip;
    RTS_UI32 from_port;
    RTS_UI32 to_ip;
    RTS_UI32 to_port;
    RTS_UI32 size;
    RTS_UI8 data[SIM_NET_DATA];
} SIM_NET_PACKET;

/* The IPv4 address of the device, 127.0.0.1 without one; it stays when power goes. Open sockets do not follow. */
void SimNetSetAddress(RTS_UI32 ip);
/* Gives the device a packet. ERR_NOBUFFER: its program must first read what came before; ERR_PARAMETER: no such packet. */
RTS_RESULT SimNetPut(const SIM_NET_PACKET *packet);
/* Takes a packet that the device has sent to another one. ERR_NOTHING_TO_DO. */
RTS_RESULT SimNetGet(SIM_NET_PACKET *packet);

/* 0: the flash is read through its read function only. From power off; the default is 1. */
void SimFlashSetMapped(int mapped);

/* The content, to look at or to spoil: writable until the next SimStart. It is shared with child processes. */
RTS_UI8 *SimFlashData(void);
RTS_UI32 SimFlashSize(void);

/* Sets the whole content, e.g. of a flash file; what is not erased counts as programmed. From power off.
 * ERR_PARAMETER for another size than SimFlashConfigure got. */
RTS_RESULT SimFlashLoad(const RTS_UI8 *data, RTS_UI32 size);

/* Keeps the content, and brings back what was kept (nothing, when the geometry changed since). From power off. */
RTS_RESULT SimFlashSave(void);
RTS_RESULT SimFlashRestore(void);

/* Plans a cut or fault at the `operation`-th flash operation from now, 1 being the next; 0 forgets the plan. */
void SimFlashCut(RTS_UI32 operation, RTS_UI32 mode);

/* Calls of the flash that can fail: a read (none while the flash is mapped), program, erase, sync, mapping of code. */
enum { SIM_READ = 0, SIM_PROGRAM = 1, SIM_ERASE = 2, SIM_SYNC = 3, SIM_MAP_CODE = 4, SIM_CALLS = 5 };

/* Plans that the `call`-th call of a kind from now, 1 being the next, fails; 0 forgets the plan. Nothing is read,
 * programmed, erased. With SIM_SYNC all is in flash, but what came after the sync before is lost with power, unless
 * another sync succeeds. */
void SimFlashFail(RTS_UI32 kind, RTS_UI32 call);

/* The same, and all calls of that kind after it. */
void SimFlashFailFrom(RTS_UI32 kind, RTS_UI32 call);

/* From now on a read of one of these bytes fails, over starts, until other bytes are named or SimFlashConfigure; of
 * size 0: none. */
void SimFlashUnreadable(RTS_UI32 offset, RTS_UI32 size);

/* Power is off: what was not synced when a sync failed is lost. SimStart does it, too; for a process that ends. */
void SimFlashPowerOff(void);

/* What is planned now is for the next SimStart, and counts from there; other plans end with power. */
void SimFlashAtStart(void);

/* Calls of a kind since SimStart. */
RTS_UI32 SimFlashCalls(RTS_UI32 kind);

/* Flash operations (programs and erases) since SimStart. */
RTS_UI32 SimFlashOps(void);

/* Operations that broke the rules of SysFlash.h since SimFlashConfigure, and what the first one was ("" without
 * one). */
RTS_UI32 SimFlashViolations(void);
const char *SimFlashViolation(void);

/* ---- inputs and outputs ---- */

/* Where a channel is: `bits` of a parameter, from bit `bit` on. */
typedef struct {
    RTS_UI32 parameter;
    RTS_UI32 bit;
    RTS_UI32 bits;
    bool is_output; /* as the channel of the program is: a parameter may have both */
} SIM_IO_PLACE;

/*
 * The devices of the loaded application are simulated: those of Modbus at the other end of their line, all others by
 * IoDrvSim.h, whatever drivers their description names. Each is known by the name of its connector. Write sets a place
 * to what stands in `data` from bit 0 on: what an input measures from now on. Read gives what a device has now.
 * ERR_NO_OBJECT: no such connector or parameter; ERR_OUT_OF_LIMITS: the parameter is not as long.
 */
RTS_RESULT SimIoWrite(const char *connector, const SIM_IO_PLACE *place, const RTS_UI8 *data);
RTS_RESULT SimIoRead(const char *connector, const SIM_IO_PLACE *place, RTS_UI8 *data);

/* Sets a fault, IO_SIM_* of IoDrvSim.h, until it is set to 0 or another application is loaded. ERR_NO_OBJECT. */
RTS_RESULT SimIoFault(const char *connector, RTS_UI32 fault, RTS_UI32 value);

/* How the runtime sees the device. ERR_NO_OBJECT. */
RTS_RESULT SimIoGetState(const char *connector, IO_DEVICE_STATE *state);

/* Sets a coil or register of a simulated Modbus device, for requests of the program (ModbusCalls.h). `table`: MODBUS_COILS,
 * ...; `address` as on the wire. ERR_NO_OBJECT: no such device; ERR_NOMEMORY: too many others are set. */
RTS_RESULT SimModbusSet(const char *device, RTS_UI32 table, RTS_UI32 address, RTS_UI32 number);

/* ---- the CAN bus ---- */

enum { SIM_CAN_EXTENDED = 1, SIM_CAN_REMOTE = 2 }; /* CAN_FLAG_* */

typedef struct {
    RTS_UI32 id;
    RTS_UI32 time_us; /* virtual, of a frame that was heard */
    RTS_UI8 flags;    /* SIM_CAN_EXTENDED, _REMOTE */
    RTS_UI8 size;
    RTS_UI8 data[8];
} SIM_CAN_FRAME;

/* A node of the test, which acknowledges all frames: sends one, which is on the bus when time passes, and takes the oldest
 * of the last 4096 that it has heard. ERR_PARAMETER: it cannot be a frame; ERR_NOBUFFER; ERR_NOTHING_TO_DO. */
RTS_RESULT SimCanPut(const SIM_CAN_FRAME *frame);
RTS_RESULT SimCanGet(SIM_CAN_FRAME *frame);

/* ---- serial line 0 ---- */

/* Bytes to the device, and what the device sent; both return how many were moved. */
RTS_UI32 SimComPut(const RTS_UI8 *data, RTS_UI32 size);
RTS_UI32 SimComGet(RTS_UI8 *data, RTS_UI32 size);

#ifndef RTS_CFFI
/* Lines of the board, DI0 .. DI7 and DO0 .. DO7, for tests of IoDrvGpio: sets what an input measures (its edges happen
 * now), -1 or the level of a line, takes it away from us or gives it back, pulls the whole chip. ERR_NO_OBJECT. */
RTS_RESULT SimGpioSet(const char *name, int high);
int SimGpioGet(const char *name);
RTS_RESULT SimGpioTake(const char *name, int taken);
void SimGpioUnplug(int gone);

/* Runs fn(arg) so that a power cut in it returns here: for tests that call the runtime directly. */
RTS_RESULT SimCall(void (*fn)(void *arg), void *arg);
#endif

#endif
