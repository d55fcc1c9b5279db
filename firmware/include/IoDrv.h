/*
 * IoDrv.h - what a driver of inputs and outputs offers the I/O manager (CmpIoMgrEmbedded.h).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Names of manual 8.2.2, 8.2.3. A driver is one constant table of functions; one that it does not have is NULL, but for
 * IoDrvGetInfo and IoDrvUpdateConfiguration. It registers an IO_DRIVER, a variable of its own that lives as long as the
 * runtime, in CH_INIT2, and serves all connectors whose configuration names it. Nothing is created or deleted after that.
 *
 * A driver never blocks and allocates nothing. It talks to its devices in CH_COMM_CYCLE of its own hook, or in interrupts
 * or threads of its port; what it receives and sends stands in buffers of its own until a task comes for it. The
 * manager calls one function of a driver at a time out of the contexts below: a task that comes while the driver is in
 * one of them passes over it (inputs stay as they are; outputs and the bus cycle are done by who is in it, afterwards),
 * and IO_DRIVER.skipped counts it.
 *
 * Coherence: a driver copies all channels of one call within one SysLockEnter .. SysLockLeave (SysLock.h), and what it
 * does to its buffers elsewhere as well: then inputs are of one moment, and outputs leave as a whole. Between the two
 * calls stands nothing but the copies: waiting, system calls and access to slow hardware come before or after.
 */
#ifndef IODRV_H
#define IODRV_H

#include "CmpErrors.h"
#include "CmpStd.h"
#include "IoConfig.h"
#include "rts_config.h"

/* Who a driver is (8.2.2). */
typedef struct {
    const char *szDriverName; /* the configuration names it so: "IoDrvGpio"; shorter than IO_CONFIG_MAX_NAME */
    const char *szDeviceName; /* what it drives, in words */
    const char *szVendorName;
    RTS_UI32 dwVersion; /* major << 16 | minor */
} IoDrvInfo;

enum { IO_MODULE_NAME_SIZE = 32 };

/* What a scan found (8.2.2, fixed parameters 1..5). */
typedef struct {
    RTS_UI32 vendor;
    RTS_UI32 product;
    RTS_UI32 revision;
    RTS_UI32 slot;                  /* address on its bus: unit, node, station */
    char name[IO_MODULE_NAME_SIZE]; /* with NUL; "" when it says none */
} IoDrvModule;

/* Times are goals for a Cortex-M at 25 MHz; on Linux one system call is in order where it says so. */
typedef struct {
    /* From any context, at once. */
    const IoDrvInfo *(*IoDrvGetInfo)(void);

    /*
     * From main, while no task runs and after the loader has checked the configuration: an application is loaded. The
     * driver looks for its connectors (IoMgrConfigGetFirstConnector; IoMgrConfigIsMine), takes the hardware they need and
     * gives back what it had before. What it points to is valid until the next call. `count` 0: there is no application any
     * more, everything is given back; this call comes for a driver without connectors too. Below 10 ms; no bus traffic:
     * what takes longer is begun here and goes on in CH_COMM_CYCLE. Errors: see IoMgrConfigRefuse; then there is no
     * IoDrvUpdateMapping, but a call with 0.
     */
    RTS_RESULT (*IoDrvUpdateConfiguration)(const IoConfigConnector *connectors, int count);

    /*
     * From main, after that: what is copied in which task. The driver checks its own limits (a parameter it has, a bit
     * within it; the loader knows the areas only), and may count here what it has to exchange. Errors: as above.
     */
    RTS_RESULT (*IoDrvUpdateMapping)(const IoConfigTaskMap *task_maps, int count);

    /*
     * From a task before its code, or from main while the application is stopped: brings what was received into the
     * inputs (IoMgrCopyInputLE, ..BE), for the channels of these connectors, which are its own. Connectors without good
     * data are left out by the manager, which gives their channels what the configuration says (on_error): so a driver
     * sees to their return elsewhere, in IoDrvStartBusCycle or CH_COMM_CYCLE. One call for each task and cycle as long as
     * all devices are well. Below 10 us and 1 us a channel; Linux: one system call. The result is not looked at:
     * use IoMgrConfigSetDiagnosis.
     */
    RTS_RESULT (*IoDrvReadInputs)(const IoConfigConnectorMap *maps, int count);

    /*
     * The same for outputs, after the code of a task (IoMgrCopyOutputLE, ..BE); connectors without good data
     * included. When outputs become safe (stop, exception, and once after IoDrvUpdateMapping) with those channels only
     * that do not hold their value, from main or the task that failed.
     */
    RTS_RESULT (*IoDrvWriteOutputs)(const IoConfigConnectorMap *maps, int count);

    /*
     * From the bus cycle task of the connector, after its outputs, or from main while the application is stopped: the
     * moment to exchange data with the device, or to begin to. For connectors without parent and those with a bus
     * cycle task of their own. Below 10 us; Linux: one system call.
     */
    RTS_RESULT (*IoDrvStartBusCycle)(const IoConfigConnector *connector);

    /* From main, about every 100 ms: brings the flags of a connector up to date (IoMgrConfigSetDiagnosis), for a driver
     * that does not do so when things happen, and looks for lost ones. Below 10 us; 1 ms to get one back. */
    RTS_RESULT (*IoDrvGetModuleDiagnosis)(const IoConfigConnector *connector);

    /* After IoDrvStartBusCycle, in the same context, while the application runs: keeps a watchdog of the device from
     * expiring. Below 5 us. */
    RTS_RESULT (*IoDrvWatchdogTrigger)(const IoConfigConnector *connector);

    /* From main, for a request from the PC: the device shows itself (blinks) for some seconds. Below 1 ms. */
    RTS_RESULT (*IoDrvIdentify)(const IoConfigConnector *connector);

    /*
     * From main, again and again, for a request from the PC: the device number `index`, from 0, that is on the bus of
     * this connector. 0 begins a scan. ERR_PENDING: not known yet; ERR_NO_OBJECT: there are no more. Below 1 ms. It must
     * not disturb the exchange of data.
     */
    RTS_RESULT (*IoDrvScanModules)(const IoConfigConnector *connector, RTS_UI32 index, IoDrvModule *module);

    /*
     * From main, for a request from the PC: `bits` of parameter `id` (8.2.3), which need not be in the configuration,
     * from bit `bit_offset` on; bit 0 is the lowest of byte 0. `data` has room for them. ERR_NO_OBJECT: no such
     * parameter (a read then gives what the configuration says); ERR_PENDING: call again. Below 1 ms.
     */
    RTS_RESULT(*IoDrvReadParameter)
    (const IoConfigConnector *connector, RTS_UI32 id, void *data, RTS_UI32 bits, RTS_UI32 bit_offset);
    RTS_RESULT(*IoDrvWriteParameter)
    (const IoConfigConnector *connector, RTS_UI32 id, const void *data, RTS_UI32 bits, RTS_UI32 bit_offset);

    /* From main, while no task runs: a reset has given all variables their initial values. A driver whose inputs are what
     * others have written, such as the registers of a server, forgets that, or a reset would not be one. Below 100 us. */
    void (*IoDrvReset)(void);

    /* From main, for the log, when a connector has CF_CONNECTOR_BUS_ERROR: why, such as "it closes the connection". Without
     * it: "it does not answer". Below 100 us. */
    void (*IoDrvExplainLoss)(const IoConfigConnector *connector, char *text, RTS_SIZE size);

#if ONLINE_CHANGE
    /*
     * From main, while no task runs and with interrupts locked on one core: an online change. Connectors, parameters and
     * channels are the same, at another place in memory; tasks may use other ones of them. The driver replaces each
     * pointer into the configuration that it keeps by IoMgrConfigFollow of it. Connections and outputs stay as they are.
     * A driver without such pointers has an empty function; a program with a driver that has none cannot be changed.
     * Below 20 us.
     */
    void (*IoDrvFollowConfiguration)(const IoConfigTaskMap *task_maps, int count);
#endif
} ICmpIoDrv;

/* A registered driver. It sets `functions`, all else is the manager's. */
typedef struct IO_DRIVER {
    const ICmpIoDrv *functions;
    struct IO_DRIVER *next;
    RTS_UI32 busy;    /* one of its functions runs in a task, or for one */
    RTS_UI32 pending; /* what tasks left to who is in it: a bit for each task's outputs, and others */
    RTS_UI32 skipped; /* how often a task found it busy */
} IO_DRIVER;

#endif
