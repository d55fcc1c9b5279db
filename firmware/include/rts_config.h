/*
 * rts_config.h - every tunable of the runtime: default, reason and what it costs.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A port overrides a value in its own rts_config_port.h, found by include order (port directory first). Portable code
 * includes only this file.
 */
#ifndef RTS_CONFIG_H
#define RTS_CONFIG_H

#include "rts_config_port.h"

/* Tasks of an application. Each costs one IEC_CONTEXT, one task record (about 150 bytes on 32-bit targets) and a
 * timer. */
#ifndef APP_MAX_TASKS
#define APP_MAX_TASKS 3
#endif

/* External functions an application may import; one pointer each. */
#ifndef APP_MAX_IMPORTS
#define APP_MAX_IMPORTS 32
#endif

/* Longest sentence that says why an image was refused, with NUL: bytes on the main stack. It names the functions that
 * are missing. 1: no sentences, only codes, which saves 2 KiB of flash. */
#ifndef APP_REFUSAL_TEXT_SIZE
#define APP_REFUSAL_TEXT_SIZE (64 + 6 * APP_MAX_IMPORTS)
#endif

/* Bytes of an image that one message of packed data (Unpack.h) may unpack to: how long main is busy with it. 700 bytes of
 * flash, no RAM. 0: data come as they are. */
#ifndef APP_UNPACK_SIZE
#define APP_UNPACK_SIZE 0
#endif

/* Words of the stack that are kept of an exception, from which the host finds the calls that led there; 8 bytes each.
 * 0: only the place is known. */
#ifndef EXCEPT_MAX_CALLS
#define EXCEPT_MAX_CALLS 16
#endif

/* Registers of the processor that are kept of a fault (EXCEPT_REGISTERS_* in SysExcept.h): as many as the port has, a word
 * each. It needs EXCEPT_MAX_CALLS; on bare metal also BP_MAX, with which faults save all registers. 0: none. */
#ifndef EXCEPT_REGISTERS
#define EXCEPT_REGISTERS 0
#endif

/* 1: components catch their own faults by rts_try (SysExceptCatch.h). 350 bytes of flash and 200 of RAM on a board; the
 * port has SysExceptTries. The name is that of the manual. */
#ifndef RTS_STRUCTURED_EXCEPTION_HANDLING
#define RTS_STRUCTURED_EXCEPTION_HANDLING 0
#endif

/* RAM of each area in bytes. The retain area may have none: then nothing of CmpRetain is in use. */
#ifndef APP_DATA_SIZE
#define APP_DATA_SIZE 4096
#endif
#ifndef APP_RETAIN_SIZE
#define APP_RETAIN_SIZE 512
#endif
#ifndef APP_INPUT_SIZE
#define APP_INPUT_SIZE 64
#endif
#ifndef APP_OUTPUT_SIZE
#define APP_OUTPUT_SIZE 64
#endif
#ifndef APP_MEMORY_SIZE
#define APP_MEMORY_SIZE 256
#endif

/* The largest code of an application, bytes: where it runs in RAM, the RAM that each of the two slots has for it. 0:
 * what fits a slot of the flash. */
#ifndef APP_MAX_CODE_SIZE
#define APP_MAX_CODE_SIZE 0
#endif

/* What an erased byte of the flash is that the applications have. */
#ifndef BOARD_FLASH_ERASED
#define BOARD_FLASH_ERASED 0xFF
#endif

/* Bytes of the flash's sector that begins at `offset`. A chip whose sectors differ says it in rts_config_port.h, and where
 * the files are (FILE_MAP of SysFileFlash.h): each half of a log is whole sectors. */
#ifndef FLASH_SECTOR_AT
#define FLASH_SECTOR_AT(offset) (RTS_UNUSED(offset), SysFlashGet()->sector_size)
#endif

/* 1: a read of the flash may fail, and what can be read decides what runs. 0: the flash is memory (SysFlash.h, `mapped` is
 * not NULL), so no read fails; some 110 bytes
 * of flash less. */
#ifndef FLASH_READS_FAIL
#define FLASH_READS_FAIL 1
#endif

/* 1: the port gives the memory of the areas (SysMem.h), to keep programs from writing beyond them. 0: a variable. */
#ifndef APP_AREAS_FROM_PORT
#define APP_AREAS_FROM_PORT 0
#endif

/* Devices, modules and buses of an application, which the I/O manager drives; 16 bytes of RAM each. 0: no inputs and
 * outputs but those that tasks use as memory; an application that has others is refused. */
#ifndef IO_MAX_CONNECTORS
#define IO_MAX_CONNECTORS 0
#endif

/* Connectors of IoDrvGpio, with up to 32 lines each; 32 bytes of RAM each, and what the port takes. */
#ifndef IO_GPIO_GROUPS
#define IO_GPIO_GROUPS 1
#endif

/* Simulated devices (IoDrvSim): bytes of all together, twice, and parameters that channels name. */
#ifndef IO_SIM_MEMORY
#define IO_SIM_MEMORY 16384
#endif
#ifndef IO_SIM_MAX_BLOCKS
#define IO_SIM_MAX_BLOCKS 1024
#endif

/* 1: IoDrvSim takes the connectors of drivers that are not there, which are then never missing. For the simulator. */
/* Bytes for parameters of I/O devices that tools write, kept over power-off (CmpIoKeep.h): 24 and its data for each. 0:
 * none. Not on boards as they are: lines of GPIO, which the full configuration drives, have no parameters to write. */
#ifndef IO_KEEP_SIZE
#define IO_KEEP_SIZE 0
#endif

#ifndef IO_SIM_TAKES_ALL
#define IO_SIM_TAKES_ALL 0
#endif

/* How a port wants the areas aligned, and their `size` rounded up, and where they are, to let programs write nothing but
 * them. */
#ifndef APP_AREAS_ALIGNED
#define APP_AREAS_ALIGNED(size)
#define APP_AREAS_SECTION
#endif

/* APP_GATE(function); stands after an external function that does more than compute: it writes variables of its own,
 * or needs hardware or a lock of the runtime. APP_GATED(function) is what its table offers. Where IEC code may write its
 * areas and its stack only, and so may the functions it calls, the gate gives it the rights of the runtime. */
#ifndef APP_GATE
#define APP_GATE(function) RTS_STATIC_ASSERT(1, function##_needs_no_gate)
#define APP_GATED(function) function
#endif

/* RAM for the tasks' own copies of the inputs and outputs that they share, bytes: a task takes as many as it uses of
 * them, rounded to 8, and once more as many of what it writes. An application that needs more is refused. The
 * default holds any application that does not write inputs. 0: no copies, 500 bytes of flash less; only where tasks do
 * not interrupt each other (CmpScheduleEmbedded). */
#ifndef APP_IMAGE_SIZE
#define APP_IMAGE_SIZE (APP_MAX_TASKS * (APP_INPUT_SIZE + 2 * APP_OUTPUT_SIZE))
#endif

/* 1: main runs beside the tasks (threads, several cores), so that a task has copies also of what it uses alone, and
 * what is written from the PC neither changes within its cycle nor gets lost. 0: main is interrupted by the tasks, or
 * calls them. */
#ifndef APP_IMAGE_ALWAYS
#define APP_IMAGE_ALWAYS (!RTS_ONE_CORE)
#endif

/* A new application has proven itself after running this long without an exception [us]; before that a restart may roll
 * back to the previous one. */
#ifndef APP_PROVE_US
#define APP_PROVE_US 3000000
#endif

/* Whether SysStartGet may ask that the boot project stays stopped, 100 bytes of flash. */
#ifndef APP_MAY_STAY_STOPPED
#define APP_MAY_STAY_STOPPED 1
#endif

/* The port's words for a crash that are kept in the commit record ("signal SIGSEGV"), bytes with NUL; on the stack of
 * main. 1: only number and place of the exception are kept. */
#ifndef APP_CRASH_TEXT_SIZE
#define APP_CRASH_TEXT_SIZE 32
#endif

/* A cycle of a task without watchdog is aborted after this long [us], so that an endless loop never takes the device
 * away. */
#ifndef APP_DEFAULT_WATCHDOG_US
#define APP_DEFAULT_WATCHDOG_US 10000000
#endif

/* Initialisation code is aborted after this long [us]: communication waits for it, and a reset answers within a second,
 * also that of a program whose initialisation does not end. */
#ifndef APP_INIT_WATCHDOG_US
#define APP_INIT_WATCHDOG_US 700000
#endif

/* No cycle takes longer than this, whatever WATCHDOG and SENSITIVITY of its task say [us]; 0: no such limit. For ports
 * where tasks hold up main, and with it communication and every stop. */
#ifndef APP_MAX_CYCLE_US
#define APP_MAX_CYCLE_US 0
#endif

/* A task that is in its cycle so long after a stop, a reset, a download or the end of the runtime was asked for is
 * aborted [us]: with the code that runs at the end (FB_Exit) it stays within a second. Only where tasks run
 * beside main (RTS_ONE_CORE 0); where they interrupt it, none runs when main stops them. */
#ifndef SCHED_STOP_US
#define SCHED_STOP_US 400000
#endif

/* 1: tasks that wait for an event run in timers of the port, at their priority: it offers SysTimerTrigger. 0: in main,
 * between communication. */
#ifndef SCHED_EVENTS_IN_TIMERS
#define SCHED_EVENTS_IN_TIMERS 0
#endif

/* 1: freewheeling tasks do too, and pause after each cycle for a fifth of the time it took, but at least for the time
 * below [us], so that tasks below them get on. For ports with threads; elsewhere they run in main, once in each of its
 * passes. */
#ifndef SCHED_FREEWHEELING_IN_TIMERS
#define SCHED_FREEWHEELING_IN_TIMERS 0
#endif
#ifndef SCHED_FREEWHEELING_PAUSE_US
#define SCHED_FREEWHEELING_PAUSE_US 1000
#endif

/* 1: a task may run as long as a variable is TRUE (KIND_LEVEL). 0: no flash for it, and a program with such a task is
 * refused. */
#ifndef SCHED_LEVEL_EVENTS
#define SCHED_LEVEL_EVENTS 0
#endif

/* Events of a task that may wait while it runs, or cannot run; further ones are lost, and counted as its overruns. After
 * a delay the task runs so often in a row. Takes no RAM. */
#ifndef SCHED_MAX_WAITING_EVENTS
#define SCHED_MAX_WAITING_EVENTS 100
#endif

/* 1: watchdogs count the processor time of a task (SysTimeGetUsedNs, SysExceptGetUsedNs), because its context shares
 * the processor with more than the tasks above it: a process that is paused is not charged for it. 0: the time that
 * passes. */
#ifndef SCHED_PROCESSOR_TIME
#define SCHED_PROCESSOR_TIME 0
#endif

/* 1: the starts of each task's cycles are counted by how late they were (IecCycleGetLateness): 388 bytes of RAM for each
 * task, and about 2 ns for each cycle. */
#ifndef IEC_LATENESS
#define IEC_LATENESS 0
#endif

/* Changed retain variables are saved at most this often [us]: what a power cut may lose against the wear of the flash.
 * A save takes the size of the area and 20 bytes, rounded up to 16, of one half of the retain log; a half is erased
 * when it is full. So 500 bytes that change all the time, saved every second in two halves of 8 KiB, erase each sector
 * once in 30 s (100 000 erases: 35 days); every 60 s it is almost six years. The retain area is in RAM twice: it is
 * compared with the last saved copy; an eighth of it more says what was put back. On one core the copy has to fit
 * between two cycles. */
#ifndef APP_RETAIN_SAVE_US
#define APP_RETAIN_SAVE_US 1000000
#endif

/* 1: the port has RAM that keeps its content while the power is off (SysSram.h), and retain variables have a copy there, made
 * in each pass of main in which they changed: nothing is lost that main has seen. It takes twice the retain area and 48
 * bytes; a smaller one is not used. Records in flash go on, for a battery that is empty. 0: no flash for it. */
#ifndef APP_RETAIN_SRAM
#define APP_RETAIN_SRAM 0
#endif

/* 1: the port tells when the power is about to fail (AppPowerFails.h), and retain variables are saved then. If the power is
 * still there after APP_POWER_BACK_MS, the program is started again. 0: no flash for it. */
#ifndef APP_POWER_FAIL
#define APP_POWER_FAIL 0
#endif
#ifndef APP_POWER_BACK_MS
#define APP_POWER_BACK_MS 5000
#endif

/* Set in the address of an entry of IEC code: 1 on cores that run Thumb code. */
#ifndef APP_ENTRY_MODE_BIT
#define APP_ENTRY_MODE_BIT 0
#endif

/* How IEC code is entered, for ports that hold the import table in a register. */
#ifndef APP_CALL_ENTRY
#define APP_CALL_ENTRY(entry, context) (entry)(context)
#endif
#ifndef APP_CALL_GLOBAL_INIT
#define APP_CALL_GLOBAL_INIT(entry, context, init_retains) (entry)(context, init_retains)
#endif

/* What of RTS_IEC_STACK_SIZE is not there for the calls of a program [bytes]: what is pushed before its code is entered
 * and when it is interrupted, and a guard. The compiler counts with the remaining (BoardFacts.h). */
#ifndef RTS_IEC_STACK_LOST
#define RTS_IEC_STACK_LOST 0
#endif

/* 1: the runtime has one core, where interrupts and main see each other's writes in order, so only the compiler has to
 * keep it. 0: several, or threads. */
#ifndef RTS_ONE_CORE
#define RTS_ONE_CORE 0
#endif

/* 1: the runtime starts only after a reset that has set all variables to zero, so that no component clears its own; 260
 * bytes of flash. 0: it may be started again in the same process. */
#ifndef RTS_STARTS_ONCE
#define RTS_STARTS_ONCE 0
#endif

/* 1: a component that only programs need (CmpOrder.h: between CmpIecTask and CmpAppEmbedded) and that fails to start is left
 * out: the device communicates, runs no program, and says so in log and scan; 300 bytes of flash. 0: any failure ends the
 * start-up. */
#ifndef CM_LEAVES_OUT
#define CM_LEAVES_OUT 1
#endif

/* Tables of external functions beyond those that CmpList.h counts: one of each component in PORT_SYSTEM and
 * PORT_COMPONENTS, and all of the runtime's own components. Two words each. */
#ifndef CM_OWN_EXT_TABLES
#define CM_OWN_EXT_TABLES 0
#endif

/* Phases of the cycle of every task that components of a port may register (CyclePhases.h), and with those of the I/O
 * manager all there may be; two words each. CYCLE_MAX_PHASES 0: none. */
#ifndef CYCLE_OWN_PHASES
#define CYCLE_OWN_PHASES 4
#endif
#ifndef CYCLE_MAX_PHASES
#define CYCLE_MAX_PHASES (CYCLE_OWN_PHASES + (IO_MAX_CONNECTORS > 0 ? 3 : 0))
#endif

/* Variables, inputs and outputs that may be forced at a time (CmpForce.h); 40 bytes each. 0: none, and no flash for them.
 * It needs HAS_CmpForce in cmp_list.c, and one of EVENT_MAX_CALLBACKS. */
#ifndef FORCE_MAX
#define FORCE_MAX 0
#endif

/* 1: a program may forbid operations of tools (CmpOperationControl.h). It needs HAS_CmpOperationControl in cmp_list.c, and
 * one of EVENT_MAX_CALLBACKS. 0: no flash for it, and a program that does is refused. */
#ifndef OPERATION_CONTROL
#define OPERATION_CONTROL 0
#endif

/* 1: a program may take the place of the one that runs between two cycles (AppChange.h). Where tasks run beside main it
 * needs BP_MAX. 0: no flash for it. */
#ifndef ONLINE_CHANGE
#define ONLINE_CHANGE 0
#endif

/* 1: a downloaded program may run without being the boot project, until a tool makes it one (AppDownloadTry); 32 bytes of RAM.
 * 0: no flash for it, and each download is the boot project. */
#ifndef BOOT_ON_DEMAND
#define BOOT_ON_DEMAND 0
#endif

/* How long an online change waits for a cycle to end, in which no other one begins [ms]. */
#ifndef ONLINE_CHANGE_WAIT_MS
#define ONLINE_CHANGE_WAIT_MS 200
#endif

/* Messages that a program may add to the log at once (IecLog.h), and how long it then waits for each further one [ms]. It
 * needs HAS_IecLog in cmp_list.c. 0: no flash for it, and a program that does is refused. */
#ifndef IEC_LOG_BURST
#define IEC_LOG_BURST 0
#endif
#ifndef IEC_LOG_REFILL_MS
#define IEC_LOG_REFILL_MS 1000
#endif

/* Vendor << 16 | device, both numbers of the vendor, and the name of the vendor, which scan shows. Images are for this
 * number: those for another device are refused, and so are those for any with this processor (BOARD_TARGET_ID). */
#ifndef BOARD_DEVICE_ID
#define BOARD_DEVICE_ID BOARD_TARGET_ID
#endif
#ifndef BOARD_VENDOR_NAME
#define BOARD_VENDOR_NAME "Open"
#endif

/* 1: events call functions of the program (IecEvents.h). It needs HAS_IecEvents in cmp_list.c, and one of
 * EVENT_MAX_CALLBACKS. 0: no flash for it, and a program that has such functions is refused. */
#ifndef IEC_EVENTS
#define IEC_EVENTS 0
#endif
/* Functions that a program may register for events (SysCallbackRegister) at a time: 4 bytes of RAM each. */
#ifndef IEC_CALLBACKS
#define IEC_CALLBACKS 4
#endif
/* Calls of a program that main carries out (CmpAppCalls.h) at a time, and bytes of data that each has room for, a multiple
 * of 32: the more, the fewer calls a long file takes. 48 bytes of RAM and the data for each. It needs HAS_CmpAppCalls in
 * cmp_list.c and one of EVENT_MAX_CALLBACKS. 0: no flash for it, and a program that needs one is refused. */
#ifndef APP_CALLS
#define APP_CALLS 0
#endif
#ifndef APP_CALL_DATA
#define APP_CALL_DATA 128
#endif

/* How long a task may wait for such a call [ms], where tasks run beside main (SysMain.h). 0: they cannot, no flash for it,
 * and a program that does is refused. */
#ifndef APP_CALL_WAIT_MS
#define APP_CALL_WAIT_MS 0
#endif

/* Files that a program may have open at a time (IecFile.h); 68 bytes of RAM for each. It needs HAS_IecFile in cmp_list.c
 * and one of EVENT_MAX_CALLBACKS. 0: no flash for them, and a program that opens one is refused. */
#ifndef IEC_FILES
#define IEC_FILES 0
#endif

/* Sockets that a program may have open at a time (IecSocket.h); 12 bytes of RAM for each. With HAS_IecSocket in cmp_list.c
 * and one of EVENT_MAX_CALLBACKS. 0: the device has no network, which the program learns by an error. */
#ifndef IEC_SOCKETS
#define IEC_SOCKETS 0
#endif

/* Serial ports that a program may have open at a time (IecCom.h); 8 bytes of RAM for each. With HAS_IecCom in cmp_list.c and
 * one of EVENT_MAX_CALLBACKS. 0: it may open none, which it learns by an error. */
#ifndef IEC_COMS
#define IEC_COMS 0
#endif

/* 1: a program may ask about its tasks, and disable their watchdog for a cycle (IecTaskCalls.h); 24 bytes for each task. It
 * needs HAS_IecTaskCalls in cmp_list.c, and one of EVENT_MAX_CALLBACKS. 0: no flash for it, and a program that does is
 * refused. */
#ifndef IEC_TASK_CALLS
#define IEC_TASK_CALLS 0
#endif

/* 1: the load of each task, its limit and the status of cyclic tasks (CmpTaskLoad.h); 28 bytes of RAM for each task, and on
 * one core 4 more, and some 100 clocks of the processor for each cycle. It needs HAS_CmpTaskLoad in cmp_list.c. 0: no flash
 * for it; tools show no load. */
#ifndef TASK_LOAD
#define TASK_LOAD 0
#endif

/* 1: a function of the program decides what follows an exception of a task (IecTaskHandler.h). It needs IEC_TASK_CALLS,
 * HAS_IecTaskHandler in cmp_list.c, and one of EVENT_MAX_CALLBACKS. 0: no flash for it, and a program that has one is
 * refused. */
#ifndef IEC_TASK_HANDLER
#define IEC_TASK_HANDLER 0
#endif

/* A task whose cycles fail so often in a row ends the program, whatever its function answers: the device stays reachable. */
#ifndef IEC_TASK_MAX_FAILURES
#define IEC_TASK_MAX_FAILURES 10
#endif

/* Bytes for what is traced (CmpTraceMgr.h): each packet takes some 150, 28 for each record, and its samples. 0: none, and
 * no flash for them. It needs HAS_CmpTraceMgr in cmp_list.c, and two of EVENT_MAX_CALLBACKS. */
#ifndef TRACE_BUFFER
#define TRACE_BUFFER 0
#endif

/* 1: phases of the cycle come and go while tasks run. */
#define CYCLE_PHASES_CHANGE (FORCE_MAX > 0 || TRACE_BUFFER > 0)

/* Breakpoints that a debugger may set at a time (CmpAppBP.h), and traps that the code may have at a time: those, and where
 * a step may lead. 0: no debugger, and no flash for it. It needs HAS_CmpAppBP in cmp_list.c, SysDebug.h in the port,
 * and one of EVENT_MAX_CALLBACKS. */
#ifndef BP_MAX
#define BP_MAX 0
#endif
#ifndef BP_TRAPS
#define BP_TRAPS (BP_MAX > 0 ? 4096 : 0)
#endif
/* Variables whose changes may halt a task at a time. */
#ifndef BP_WATCHES
#define BP_WATCHES (BP_MAX > 0 ? 4 : 0)
#endif

/* 0: tasks run one after the other, in one thread, so that none runs while another one is halted. */
#ifndef BP_HOLDS_TASKS
#define BP_HOLDS_TASKS 1
#endif

/* 0: the context of a task cannot wait in a handler, since tasks interrupt main. A halted task leaves its context, and main
 * runs the rest of its cycle (SysDebugResume). */
#ifndef SYS_DEBUG_WAITS
#define SYS_DEBUG_WAITS 1
#endif

/* A debugger that asks nothing for so long is gone: its breakpoints end, and what is halted goes on [ms]. 0: never. */
#ifndef BP_ALIVE_MS
#define BP_ALIVE_MS 5000
#endif

/* Event callbacks that may be registered, all for components of a port but one each of CmpForce,
 * CmpOperationControl, IecEvents, IecTaskCalls and CmpAppBP, and two of CmpTraceMgr; five words each. 0: the application sends no events. */
#ifndef EVENT_MAX_CALLBACKS
#define EVENT_MAX_CALLBACKS 8
#endif

/* External events that may be registered; one word each. 0: a program with a task that waits for one is refused. */
#ifndef SCHED_MAX_EXTERNAL_EVENTS
#define SCHED_MAX_EXTERNAL_EVENTS 2
#endif

/* Entries of the CRC tables, 16 or 256: 96 bytes of flash, or 1.5 KiB and about four times as fast. */
#ifndef CHECKSUM_TABLE_ENTRIES
#define CHECKSUM_TABLE_ENTRIES 16
#endif

/* Constants of the port, see CmpSettings.h; each {"component", "key", number, text}, with a comma after it. With SETTINGS
 * those of CmpSettingNames.h are read from here, too, where no file says anything else. */
#ifndef SETTINGS_TABLE
#define SETTINGS_TABLE
#endif

/* 1: users may change the settings of CmpSettingNames.h, by a file of the file store. It needs HAS_CmpSettings in
 * cmp_list.c. 0: they are constants, and no flash for them. */
#ifndef SETTINGS
#define SETTINGS 0
#endif

/* Components that may have a version of their own; 8 bytes of RAM each. plctool shell complist and plctool info then list all
 * components with their versions. 0: they do not, 0.2 KiB of flash less. */
#ifndef CM_VERSIONS
#define CM_VERSIONS 0
#endif

/* Which of several configurations of a board this one is: for plctool. */
#ifndef RTS_CONFIG_NAME
#define RTS_CONFIG_NAME ""
#endif

/* FILE_MAP {offset, size}, ...: where slot A, slot B, the commit log and the retain log are in flash, if not where
 * SysFileFlash computes it. No default. */

/* Receive and send buffer of a connection, bytes each; the largest L7 message. The field's compact
 * template uses 2048; larger ones raise the flash rate because there is one reply per message. */
#ifndef NETSERVER_MESSAGE_SIZE
#define NETSERVER_MESSAGE_SIZE 2048
#endif

/* Connections at a time: tools that may be logged in together. Each costs its two buffers and about 150 bytes. */
#ifndef COMM_MAX_CLIENTS
#define COMM_MAX_CLIENTS 1
#endif

/* 1: there are block drivers with several peers (UDP), or that know when their peer has gone (TCP). 16 bytes per client,
 * 10 per driver. */
#ifndef COMM_ENDPOINTS
#define COMM_ENDPOINTS 0
#endif

/* Channels that the peers of one machine on a network, of a serial line, or of a tool on CAN may have together, so that one
 * is left to others; 0: no limit. */
#ifndef COMM_HOST_CHANNELS
#define COMM_HOST_CHANNELS (COMM_ENDPOINTS && COMM_MAX_CLIENTS > 2 ? COMM_MAX_CLIENTS - 1 : 0)
#endif

/* TCP connections at a time: one more than clients that may be logged in, so that a new one is always accepted. Each
 * costs its two buffers and 90 bytes. */
#ifndef TCP_MAX_CONNECTIONS
#define TCP_MAX_CONNECTIONS (COMM_MAX_CLIENTS + 1)
#endif

/* Receive and send buffer of a TCP connection, bytes each: one largest frame (520) at least. */
#ifndef TCP_BUFFER_SIZE
#define TCP_BUFFER_SIZE 1040
#endif

/* A TCP connection is closed if no byte is received or sent for so long [ms]. */
#ifndef TCP_IDLE_MS
#define TCP_IDLE_MS 60000
#endif

/* A TCP connection is closed if a frame, or its first one, is not complete after so long [ms]. */
#ifndef TCP_FRAME_MS
#define TCP_FRAME_MS 3000
#endif

/* 1: CAN FD can be used. Each queued frame takes 56 bytes more. 0: classic frames only. */
#ifndef CAN_FD
#define CAN_FD 0
#endif

/* 1: several users share a CAN controller (CmpCan.h): the block driver, CANopen, frames of programs, components of a port.
 * 0: the block driver has it for itself, which takes no flash. */
#ifndef CAN_SHARED
#define CAN_SHARED 0
#endif

/* Controllers that are shared, each with room for so many 11-bit frames that wait to be sent (24 bytes each, 80 with
 * CAN FD). */
#ifndef CAN_CONTROLLERS
#define CAN_CONTROLLERS 1
#endif
#ifndef CAN_URGENT_FRAMES
#define CAN_URGENT_FRAMES 16
#endif

/* Filters of a controller (12 bytes each). With more, a shared one lets all frames pass. */
#ifndef CAN_FILTERS
#define CAN_FILTERS 4
#endif

/* Frames of programs (IecCan.h): receivers that they may have at a time, 0: none; frames that wait in each (24 bytes
 * each), a power of two; and frames that wait to be sent. */
#ifndef CAN_MAX_RECEIVERS
#define CAN_MAX_RECEIVERS 0
#endif
#ifndef CAN_RECEIVE_FRAMES
#define CAN_RECEIVE_FRAMES 8
#endif
#ifndef CAN_SEND_FRAMES
#define CAN_SEND_FRAMES 8
#endif

/* CANopen nodes that this device manages (IoDrvCanopen.h), 0: none, and their PDOs. */
#ifndef CANOPEN_MAX_DEVICES
#define CANOPEN_MAX_DEVICES 0
#endif
#ifndef CANOPEN_MAX_PDOS
#define CANOPEN_MAX_PDOS (4 * CANOPEN_MAX_DEVICES)
#endif

/* SDO transfers and NMT commands of programs (CanopenCalls.h) at a time, 0: none, and bytes of data of each. */
#ifndef CANOPEN_MAX_CALLS
#define CANOPEN_MAX_CALLS 0
#endif
#ifndef CANOPEN_CALL_SIZE
#define CANOPEN_CALL_SIZE 256
#endif

/* 1: the manager transfers objects of 128 bytes and more in blocks (CanopenSdoClient.h): 1.1 KiB of flash, 16 bytes of RAM
 * for each node and transfer. */
#ifndef CANOPEN_SDO_BLOCK
#define CANOPEN_SDO_BLOCK (CANOPEN_CALL_SIZE >= 128)
#endif

/* This controller as a CANopen device (IoDrvCanopenDevice.h): bytes of all values of its dictionary, 0: it is none, and no
 * flash for it; bytes of its largest value; and PDOs in each direction (about 100 bytes each). */
#ifndef CANOPEN_DEVICE_DATA
#define CANOPEN_DEVICE_DATA 0
#endif
#ifndef CANOPEN_DEVICE_SDO
#define CANOPEN_DEVICE_SDO 64
#endif
#ifndef CANOPEN_DEVICE_PDOS
#define CANOPEN_DEVICE_PDOS 4
#endif

/* 1: the manager of the network can replace the program (CmpCanopenProgram.h): 1 KiB of flash, 240 bytes of RAM. */
#ifndef CANOPEN_PROGRAM_DOWNLOAD
#define CANOPEN_PROGRAM_DOWNLOAD 0
#endif

/* Packets that may arrive over CAN at a time, from as many tools; each costs a packet of CAN_PACKET_SIZE bytes
 * and 30. */
#ifndef CAN_RX_SESSIONS
#define CAN_RX_SESSIONS (COMM_MAX_CLIENTS + 1)
#endif

/* Packets that may be on their way to tools over CAN; each costs 540 bytes. One whose tool has gone takes its place for a
 * second. */
#ifndef CAN_TX_SESSIONS
#define CAN_TX_SESSIONS (COMM_MAX_CLIENTS + 1)
#endif

/* What the device asks of senders: so many frames at most before it asks for more (0: no limit), and at least so many
 * milliseconds between two. As many as the port can buffer while main does something else: frames that are lost cost a
 * repetition of the packet. */
#ifndef CAN_BLOCK_SIZE
#define CAN_BLOCK_SIZE 16
#endif
#ifndef CAN_SEPARATION_MS
#define CAN_SEPARATION_MS 0
#endif

/* The number of the device on CAN if the settings have no {"CmpBlkDrvCan", "Node"}, 1..127; and its bit rate [bit/s]. */
#ifndef CAN_NODE
#define CAN_NODE 1
#endif
#ifndef CAN_BIT_RATE
#define CAN_BIT_RATE 500000
#endif

/* Frames that wait in the driver of a CAN controller: to be sent, and received, a power of two (24 bytes each). */
#ifndef CAN_DRIVER_TX_FRAMES
#define CAN_DRIVER_TX_FRAMES 16
#endif
#ifndef CAN_DRIVER_RX_FRAMES
#define CAN_DRIVER_RX_FRAMES 32
#endif

/* The serial line that carries CAN frames, where there is no controller (CanOnSerial.c). */
#ifndef CAN_SLCAN_LINE
#define CAN_SLCAN_LINE 1
#endif

/* How long after bus off the device tries again [ms]. */
#ifndef CAN_RESTART_MS
#define CAN_RESTART_MS 500
#endif

/* How long the bus has to be on until a trouble with it is over: one that goes off again and again is two entries of the
 * log, not two each time [ms]. */
#ifndef CAN_STEADY_MS
#define CAN_STEADY_MS 60000
#endif

/* The longest packet that a serial line takes, bytes: BLK_MAX_SIZE, or more, for clients that ask whether it is
 * (docs/protocol.md): the fewer packets a download is, the less of the line they take. */
#ifndef COM_PACKET_SIZE
#define COM_PACKET_SIZE 512
#endif

/* The same for CAN, up to 4095. */
#ifndef CAN_PACKET_SIZE
#define CAN_PACKET_SIZE 512
#endif
#define BLK_LONGEST_PACKET (COM_PACKET_SIZE > CAN_PACKET_SIZE ? COM_PACKET_SIZE : CAN_PACKET_SIZE) /* of all lines */
#define BLK_LONG_PACKETS (COM_PACKET_SIZE > 512 || CAN_PACKET_SIZE > 512)

/* Serial lines the block driver serves; each costs one receive packet (COM_PACKET_SIZE + 2 bytes, less when
 * NETSERVER_MESSAGE_SIZE is below 424), COM_QUEUE_SIZE and about 150 bytes. */
#ifndef COM_MAX_LINES
#define COM_MAX_LINES 1
#endif

/* 1: frames whose CRC has its high byte first are taken, too: what is public about the protocol does not agree on the
 * order. What is sent has the low byte first. Twice as many damaged frames (1 in 32 768) are not found by the CRC. */
#ifndef COM_CRC_EITHER_ORDER
#define COM_CRC_EITHER_ORDER 0
#endif

/* Queue of outgoing packets per serial line, bytes: one largest packet (516 with length and CRC, or
 * NETSERVER_MESSAGE_SIZE + 92 if that is less) and a few small ones. A second large one is made when the first is on
 * the line. */
#ifndef COM_QUEUE_SIZE
#define COM_QUEUE_SIZE 640
#endif

/* Whether block driver, router and channel server count what arrives, is dropped and is repeated: for `channelinfo` of
 * the PLC shell, or a look with the debugger at a bad line. 300 bytes of flash, 80 of RAM; with the shell 300 more. */
#ifndef COMM_COUNTERS
#define COMM_COUNTERS 1
#endif

/* 1: the port notes when a byte comes on a serial line (SysComGetByteNs), for a field bus. */
#ifndef SYSCOM_BYTE_TIMES
#define SYSCOM_BYTE_TIMES 0
#endif

/* How long hardware or driver of the port may hold back bytes that have come on a serial line before SysComRead gets
 * them: SYSCOM_HELD_CHARS characters and SYSCOM_HELD_MS [ms]. 0: the time of each byte is known (SysComGetByteNs). */
#ifndef SYSCOM_HELD_CHARS
#define SYSCOM_HELD_CHARS 0
#endif
#ifndef SYSCOM_HELD_MS
#define SYSCOM_HELD_MS 0
#endif

/* Modbus (IoDrvModbus): what an application may have. 0 clients or servers: none, and no flash for them. */
#ifndef MODBUS_MAX_CLIENTS /* serial lines, or TCP connections, with devices; about 400 bytes each */
#define MODBUS_MAX_CLIENTS 1
#endif
#ifndef MODBUS_MAX_DEVICES /* on all of them; about 100 bytes each */
#define MODBUS_MAX_DEVICES 8
#endif
#ifndef MODBUS_MAX_JOBS /* reads and writes of all devices; about 40 bytes each */
#define MODBUS_MAX_JOBS 16
#endif
#ifndef MODBUS_MAX_CALLS /* requests of programs (ModbusCalls.h) at a time, of all lines; about 310 bytes each */
#define MODBUS_MAX_CALLS 0
#endif
#ifndef MODBUS_MAX_SERVERS /* serial lines and TCP ports on which this device is a server; about 350 bytes each */
#define MODBUS_MAX_SERVERS 1
#endif
#ifndef MODBUS_MAX_RANGES /* of all servers; 8 bytes each */
#define MODBUS_MAX_RANGES 8
#endif
#ifndef MODBUS_DATA_SIZE /* bytes: what clients read, twice what they write, and the memory of servers */
#define MODBUS_DATA_SIZE 512
#endif

/* Connections at a time of a Modbus TCP server, about 320 bytes each; one more, and the idlest is closed. 0: no TCP, for
 * ports without sockets. */
#ifndef MODBUS_MAX_CONNECTIONS
#define MODBUS_MAX_CONNECTIONS 0
#endif

/* 1: tools can reach the device through Modbus, on a serial line (ModbusTunnel.h): one more line of the block driver
 * (COM_MAX_LINES), 1160 bytes of RAM and 1.0 KiB of flash. */
#ifndef MODBUS_TUNNEL
#define MODBUS_TUNNEL 0
#endif

/* That line, a MODBUS_TOOL_LINE, if the port does not set it: {"COM2", {38400, SYSCOM_PARITY_EVEN, 1, false}, 247}. */
#ifndef MODBUS_TOOL_LINE_DEFAULT
#define MODBUS_TOOL_LINE_DEFAULT {NULL, {0, 0, 0, false}, 0}
#endif

/* Sockets of field buses at a time. */
#ifndef SYSSOCK_MAX_FIELD_BUS
#define SYSSOCK_MAX_FIELD_BUS (MODBUS_MAX_CONNECTIONS + 1 + MODBUS_MAX_SERVERS + MODBUS_MAX_CLIENTS)
#endif

/* 1: the port finds hosts by name (SysSockConnectName); 8 bytes for each Modbus line. 0: by IPv4 address only. */
#ifndef SYSSOCK_NAMES
#define SYSSOCK_NAMES 0
#endif

/* A Modbus device that is lost is asked again after this time, unless its configuration says otherwise: so often others on
 * its line wait for its time-out. The first time it is asked after a short one, because most losses are short. If there
 * are no others, after MODBUS_RETRY_ALONE_MS each time [ms]. */
#ifndef MODBUS_RETRY_MS
#define MODBUS_RETRY_MS 10000
#endif
#ifndef MODBUS_RETRY_SOON_MS
#define MODBUS_RETRY_SOON_MS 4000
#endif
#ifndef MODBUS_RETRY_ALONE_MS
#define MODBUS_RETRY_ALONE_MS 1000
#endif

/* How long main waits until devices that reply have their last outputs, when a program is replaced or ends [ms]. */
#ifndef MODBUS_LAST_WRITES_MS
#define MODBUS_LAST_WRITES_MS 500
#endif

/* How long a connection to a Modbus device may take, and how often it is tried [ms]. */
#ifndef MODBUS_CONNECT_MS
#define MODBUS_CONNECT_MS 5000
#endif
#ifndef MODBUS_RECONNECT_MS
#define MODBUS_RECONNECT_MS 1000
#endif

/* Files that tools keep on the device (CmpFileTransfer; docs/protocol.md): symbols and sources of the program, and others.
 * 52 bytes of RAM and of each record of the catalog for each. 0: none. */
#ifndef FILE_STORE_FILES
#define FILE_STORE_FILES 0
#endif

/* The end of the flash that they have, bytes, in sectors of the smallest size: two of them for the catalog, the others for
 * the files. The programs have the flash before it. */
#ifndef FILE_STORE_SIZE
#define FILE_STORE_SIZE 0u
#endif

/* Service groups of layer 7 that components of a port may register, beyond those of the runtime, which CmpList.h
 * counts; three words each. */
#ifndef SRV_OWN_GROUPS
#define SRV_OWN_GROUPS 1
#endif

/* Services that only inform about the application (its name and list, its tasks), the room on the stack, and the echo
 * service; 1.3 KiB of flash. 0: none. */
#ifndef SRV_INFORMATION
#define SRV_INFORMATION 1
#endif

/* 1: what clients of others ask for (docs/compatibility.md): single cycle, which `plctool cycle` needs too, deletion,
 * addresses of areas, operation mode, node name, names of loggers and components, refusals in the places where they
 * look for them; 1.5 KiB of flash. */
#ifndef SRV_OTHER_CLIENTS
#define SRV_OTHER_CLIENTS 0
#endif

/* How many networks the identity names, where the port has them (SysSocket.h). */
#ifndef SRV_NETWORKS
#define SRV_NETWORKS 0
#endif

/* Whether a password can be set (CmpUserMgr; docs/security.md): 1.8 KiB of flash, 60 bytes of RAM and 44 of each client, 52
 * bytes of each commit record. */
#ifndef COMM_PASSWORD
#define COMM_PASSWORD 0
#endif

/* Whether scans in the older versions of the name service are answered too; 110 bytes of flash. */
#ifndef NS_OLD_VERSIONS
#define NS_OLD_VERSIONS 1
#endif

/* Largest name service reply, bytes on the stack of main while a scan is answered; names that do not fit are cut. The
 * protocol allows 444. */
#ifndef NS_REPLY_SIZE
#define NS_REPLY_SIZE 444
#endif

/* Entries of the log ring; each about 100 bytes with its message. 0: no log, whose messages take 3 KiB of flash. */
#ifndef LOG_MAX_ENTRIES
#define LOG_MAX_ENTRIES 16
#endif
#ifndef LOG_TEXT_SIZE
#define LOG_TEXT_SIZE 80
#endif

/* Entries of the log that survive power-off (CmpLogKeep.h); 0.9 KiB of flash, 70 bytes of RAM. 0: none. LOG_KEEP_BURST
 * are written at once, then one each LOG_KEEP_REFILL_MS [ms]: a program that is started and stopped all the time costs
 * each half an erasure in 12 minutes, and flash of 100 000 erasures lasts for two years of that. */
#ifndef LOG_KEEP
#define LOG_KEEP 0
#endif
#ifndef LOG_KEEP_BURST
#define LOG_KEEP_BURST 16
#endif
#ifndef LOG_KEEP_REFILL_MS
#define LOG_KEEP_REFILL_MS 10000
#endif

/* Bytes of flash that they have, at its end: two halves of whole sectors, each with room for all of them and four more. */
#define LOG_KEEP_TEXT_SIZE 64
#define LOG_KEEP_RECORD 112
#ifndef LOG_KEEP_SIZE
#if LOG_KEEP > 0
#define LOG_KEEP_SECTORS (((LOG_KEEP + 4) * LOG_KEEP_RECORD + BOARD_FLASH_SECTOR_SIZE - 1) / BOARD_FLASH_SECTOR_SIZE)
#define LOG_KEEP_SIZE (2u * LOG_KEEP_SECTORS * BOARD_FLASH_SECTOR_SIZE)
#else
#define LOG_KEEP_SIZE 0u
#endif
#endif

#endif
