/*
 * rts_config_port.h - sizes of your port. Every value of rts_config.h may be overridden here; nothing has to be.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * On a small controller start with the values of port/baremetal/configs/standard/rts_config_size.h. When compiled code
 * is entered in a special way (the import table in a register, the Thumb bit), APP_CALL_ENTRY says how: on Cortex-M
 * include rts_config_cortexm.h, on RISC-V rts_config_riscv.h.
 */
#ifndef RTS_CONFIG_PORT_H
#define RTS_CONFIG_PORT_H

#define IO_MAX_CONNECTORS 4

#endif
