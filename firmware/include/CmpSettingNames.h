/*
 * CmpSettingNames.h - every setting of the runtime: the one list for firmware, plcrt and plctool. No include guard.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 *   SETTING_NUMBER(id, component, key, standard, least, most, sentence)
 *   SETTING_CHOICE(id, component, key, words, sentence)   words: "one|two"; the first is the standard, the value its index
 *   SETTING_OPTION(id, component, key, option, sentence)  plcrt --config only: the same as its command-line option
 *   SETTING_FLAG(id, component, key, option, sentence)    the same of an option without value; "no|yes"
 *
 * A component reads a number or choice by SETTING(id), see CmpSettings.h.
 */
/* clang-format off */
SETTING_CHOICE(BootStart, "CmpApp", "Bootproject.Start", "always|never|clean",
               "whether the program starts at power-up; clean: not after an exception or crash, until a user starts it")
SETTING_CHOICE(BootOnDownload, "CmpApp", "CreateBootprojectOnDownload", "yes|no",
               "whether a download is the boot project at once; no: when 'plctool boot' makes it one")
SETTING_NUMBER(Watchdog, "CmpIecTask", "Watchdog", 0, 0, 5000,
               "longest cycle of a task that has no watchdog [ms]; 0: as built, 5000 on plcrt and 2000 on boards")
SETTING_NUMBER(MaxLoad, "CmpSchedule", "MaxProcessorLoad", 0, 0, 6400,
               "what all tasks may take for two seconds [% of one processor], else the program stops; 0: no limit")
SETTING_NUMBER(LogFilter, "CmpLog", "Logger.0.Filter", 0x1F, 0, 0x1F,
               "sum of what is logged: 1 info, 2 warnings, 4 errors, 16 debug; exceptions and kept entries always")
SETTING_NUMBER(RetainSave, "CmpRetain", "SavePeriod", APP_RETAIN_SAVE_US / 1000, 100, 3600000,
               "shortest time between two saves of changed retain variables [ms]")
SETTING_NUMBER(IoStoreChanged, "CmpIoMgr", "StoreChangedParameters", 0, 0, 1,
               "1: parameters of I/O devices that a tool writes are kept over power-off; 0: until the program is loaded")
SETTING_OPTION(TcpAddress, "CmpBlkDrvTcp", "Address", "tcp", "[ADDRESS:]PORT where TCP is served")
SETTING_OPTION(UdpAddress, "CmpBlkDrvUdp", "Address", "udp", "ADDRESS[:PORT] where UDP is served")
SETTING_OPTION(ComLine, "CmpBlkDrvSimpleCom", "Line", "serial", "serial device, pty or pty:LINK")
SETTING_OPTION(ComBaud, "CmpBlkDrvSimpleCom", "Baud", "baud", "speed of the serial device; 115200 if not given")
SETTING_OPTION(CanInterface, "CmpBlkDrvCan", "Interface", "can", "interface of the system, slcan:PATH or slcan:pty")
SETTING_OPTION(CanNode, "CmpBlkDrvCan", "Node", "node", "number of the device on CAN, 1 to 127; 1 if not given")
SETTING_OPTION(CanBitRate, "CmpBlkDrvCan", "BitRate", "bitrate", "of an adapter; with /N CAN FD; 500000 if not given")
SETTING_OPTION(CanBase, "CmpBlkDrvCan", "Base", "can-base", "of the 29-bit identifiers; 0x1F400000 if not given")
SETTING_OPTION(TunnelLine, "ModbusTunnel", "Line", "tunnel", "serial device with tools within Modbus RTU")
SETTING_OPTION(TunnelUnit, "ModbusTunnel", "Unit", "tunnel-unit", "its address, 1 to 247; 247 if not given")
SETTING_OPTION(TunnelBaud, "ModbusTunnel", "Baud", "tunnel-baud", "its speed; 38400 if not given")
SETTING_OPTION(TunnelParity, "ModbusTunnel", "Parity", "tunnel-parity", "even, odd or none; even if not given")
SETTING_FLAG(TunnelDrive, "ModbusTunnel", "Drive", "tunnel-drive", "whether the port switches the direction of the bus")
SETTING_OPTION(MetricsFile, "Metrics", "File", "metrics", "file with figures for Prometheus")
SETTING_OPTION(MetricsPeriod, "Metrics", "Period", "metrics-every", "how often it is written [s]; 15 if not given")
SETTING_OPTION(ProgramNet, "IecSocket", "Allow", "net", "what the program may reach: ADDRESS[/BITS][:PORT[-PORT]],...")
SETTING_OPTION(ProgramCom, "IecCom", "Lines", "com", "serial devices that the program may open, as ports 1, 2 ..")
SETTING_OPTION(FlashFile, "SysFlash", "File", "flash", "file that stands for the flash memory")
SETTING_FLAG(MdnsAnnounce, "SysMdns", "Announce", "mdns", "whether name and TCP port are announced by multicast DNS")
SETTING_OPTION(Board, "SysTarget", "Board", "board", "what device.toml calls this machine")
SETTING_OPTION(NodeName, "SysTarget", "NodeName", "name", "of the device in a scan; that of the machine if not given")
/* clang-format on */
