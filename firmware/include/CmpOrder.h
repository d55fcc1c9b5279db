/*
 * CmpOrder.h - the components of a runtime, in the one order of all ports; included by CmpList.h, once for each table.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A component comes after those it uses: its hooks are called after theirs, and undone before them. No include guard.
 */
/* clang-format off */
#if HAS_SysTime
X(SysTime)
#endif
#if HAS_CmpLog
X(CmpLog)
#endif
#ifdef PORT_SYSTEM
PORT_SYSTEM(X)
#endif
X(SysFileFlash)
#if HAS_CmpLogKeep
X(CmpLogKeep)
#endif
#if HAS_CmpSettings
X(CmpSettings)
#endif
#if HAS_CmpEventMgrEmbedded
X(CmpEventMgrEmbedded)
#endif
#if HAS_CmpCan
X(CmpCan)
#endif
X(CmpScheduleTimer)
X(CmpIecTask)
#if HAS_CmpTaskLoad
X(CmpTaskLoad)
#endif
#if HAS_SysWatchdog
X(SysWatchdog)
#endif
#if HAS_CmpRetain
X(CmpRetain)
#endif
#if HAS_CmpMath
X(CmpMath)
#endif
#if HAS_CmpIoMgrEmbedded
X(CmpIoMgrEmbedded)
#endif
#if HAS_IoDrvSim
X(IoDrvSim)
#endif
#if HAS_IoDrvGpio
X(IoDrvGpio)
#endif
#if HAS_IoDrvModbus
X(IoDrvModbus)
#endif
#if HAS_IecCan
X(IecCan)
#endif
#if HAS_IoDrvCanopenDevice
X(IoDrvCanopenDevice)
#endif
#if HAS_IoDrvCanopen
X(IoDrvCanopen)
#endif
#if HAS_CmpIoKeep
X(CmpIoKeep)
#endif
#if HAS_CmpForce
X(CmpForce)
#endif
#if HAS_CmpOperationControl
X(CmpOperationControl)
#endif
#if HAS_IecLog
X(IecLog)
#endif
#if HAS_IecEvents
X(IecEvents)
#endif
#if HAS_CmpAppCalls
X(CmpAppCalls)
#endif
#if HAS_IecFile
X(IecFile)
#endif
#if HAS_IecSocket
X(IecSocket)
#endif
#if HAS_IecCom
X(IecCom)
#endif
#if HAS_IecClock
X(IecClock)
#endif
#if HAS_IecTaskCalls
X(IecTaskCalls)
#endif
#if HAS_IecTaskHandler
X(IecTaskHandler)
#endif
#if HAS_CmpTraceMgr
X(CmpTraceMgr)
#endif
#if HAS_CmpAppBP
X(CmpAppBP)
#endif
#ifdef PORT_COMPONENTS
PORT_COMPONENTS(X)
#endif
X(CmpAppEmbedded)
#if HAS_COMMUNICATION
X(CmpSrv)
X(CmpAppSrv)
#if HAS_CmpCanopenProgram
X(CmpCanopenProgram)
#endif
#if HAS_CmpLogSrv
X(CmpLogSrv)
#endif
#if HAS_CmpMonitor2
X(CmpMonitor2)
#endif
#if HAS_CmpTraceMgr
X(CmpTraceSrv)
#endif
#if HAS_CmpAppBP
X(CmpAppBPSrv)
#endif
#if HAS_CmpIoMgrSrv
X(CmpIoMgrSrv)
#endif
X(CmpRouterEmbedded)
X(CmpNameServiceServer)
X(CmpChannelServerEmbedded)
#if HAS_CmpUserMgr
X(CmpUserMgr)
#endif
X(CmpDevice)
#if HAS_CmpPlcShell
X(CmpPlcShell)
#endif
#if HAS_CmpFileTransfer
X(CmpFileTransfer)
#endif
#if HAS_CmpBlkDrvSimpleCom
X(CmpBlkDrvSimpleCom)
#endif
#if HAS_CmpBlkDrvCan
X(CmpBlkDrvCan)
#endif
#if HAS_CmpBlkDrvTcp
X(CmpBlkDrvTcp)
#endif
#if HAS_CmpBlkDrvUdp
X(CmpBlkDrvUdp)
#endif
#endif
/* clang-format on */
