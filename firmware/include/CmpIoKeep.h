/*
 * CmpIoKeep.h - parameters of I/O devices that tools have written, kept over power-off. Manual 7.6.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * With the setting [CmpIoMgr] StoreChangedParameters=1 each parameter that a tool writes is noted in RAM. At most
 * IO_KEEP_SAVE_MS later all of them are in the file IO_KEEP_FILE; a power cut leaves the previous file or the new one.
 * When a program is loaded, they are written to its devices again.
 *
 * A parameter is used only for a device with the same name, driver and described parameters. Parameters of other devices
 * are dropped when there is no room. After the file is deleted, the next load uses the described values.
 *
 * Needs HAS_CmpIoKeep in cmp_list.c, IO_KEEP_SIZE, SETTINGS and FILE_STORE_FILES. From main.
 */
#ifndef CMPIOKEEP_H
#define CMPIOKEEP_H

#include "CmpItf.h"
#include "rts_config.h"

#define IO_KEEP_FILE "IoConfig.par"

enum { IO_KEEP_SAVE_MS = 1000 };

#if IO_KEEP_SIZE > 0
/* Notes a parameter that IoMgrWriteParameter has written, with the same arguments. */
void IoKeepNote(RTS_UI32 connector, RTS_UI32 id, const void *data, RTS_UI32 bits, RTS_UI32 bit_offset);
#else
static inline void IoKeepNote(RTS_UI32 connector, RTS_UI32 id, const void *data, RTS_UI32 bits, RTS_UI32 bit_offset)
{
    RTS_UNUSED(connector);
    RTS_UNUSED(id);
    RTS_UNUSED(data);
    RTS_UNUSED(bits);
    RTS_UNUSED(bit_offset);
}
#endif

RTS_RESULT CmpIoKeep_Hook(CMP_HOOK hook);

#endif
