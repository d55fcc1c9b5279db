/*
 * AppAddress.h - finds addresses in the areas of the loaded application (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main, and from the phases of a cycle (CyclePhases.h).
 */
#ifndef APPADDRESS_H
#define APPADDRESS_H

#include "CmpErrors.h"
#include "CmpStd.h"

/*
 * Checks that [offset, offset + size) is in area `index` of the loaded application and returns its address, NULL
 * otherwise. The only way to turn an area reference from outside into a pointer. APP_AREA_CODE may only be read.
 */
RTS_UI8 *AppGetAreaAddress(RTS_UI32 index, RTS_UI32 offset, RTS_UI32 size);
RTS_UI32 AppGetAreaSize(RTS_UI32 index); /* bytes, as the image asked for */
/* Finds what a pointer of the application leads to; false when that is in no area, as with NULL and temporary
 * variables. */
bool AppFindArea(uintptr_t address, RTS_UI32 *index, RTS_UI32 *offset);

/* A location in the areas as others name it: monitoring, force, trace, maps of inputs and outputs. `offset` is not
 * checked. */
typedef struct {
    RTS_UI32 area; /* APP_AREA_* */
    RTS_UI32 offset;
} AREA_ADDRESS;

/* Where the `size` bytes at a location are. MONITORING_ERR_SIZE_0, _INVALID_AREA (the application has none), or
 * _INVALID_INDEX: not all of them are in it. */
MON_RESULT AppAddressResolve(const AREA_ADDRESS *address, RTS_UI32 size, RTS_UI8 **memory);

/* Follows the pointer at *address: the result is again an area and an offset, whatever the pointer holds. The same
 * errors, or MONITORING_ERR_INVALID_POINTER: it leads into no area. */
MON_RESULT AppAddressFollow(AREA_ADDRESS *address);

enum {
    PLACE_POINTERS = 3,   /* on the way to a variable, at most */
    PLACE_ALL_BITS = 0xFF /* APP_PLACE.mask */
};

/* A number in the areas that is used in each cycle: forced or traced. Laid out as a MON2_PLACE: it is copied from requests.
 * Members that are not used are 0, so that two places can be compared as bytes. */
typedef struct {
    RTS_UI8 area; /* APP_AREA_* */
    RTS_UI8 pointers;
    RTS_UI8 size;                        /* 1, 2, 4 or 8 bytes */
    RTS_UI8 mask;                        /* of a single byte: the bits that are meant */
    RTS_UI32 offset[1 + PLACE_POINTERS]; /* in the area, and after each pointer; pointers are followed in each cycle */
} APP_PLACE;

/* Checks size and mask: else MONITORING_ERR_UNSUPPORTED_DATATYPE. */
MON_RESULT AppPlaceCheck(const APP_PLACE *place);

/* Finds a place by way of its pointers: *address has its area and the offset there. The errors of the functions above. */
MON_RESULT AppPlaceFind(const APP_PLACE *place, AREA_ADDRESS *address, RTS_UI8 **at);

/* Kinds of numbers of 1, 2, 4 or 8 bytes; a REAL has 4 or 8. */
enum { NUMBER_UNSIGNED, NUMBER_SIGNED, NUMBER_REAL };

/* Finds a key for a number: keys have the order of the numbers. False for NAN, which has none. */
bool AppNumberKey(RTS_UI64 value, RTS_UI32 size, RTS_UI32 kind, RTS_I64 *key);

/* The order of two keys, as bits: a condition names those that it holds for. */
enum { NUMBER_LESS = 1, NUMBER_EQUAL = 2, NUMBER_GREATER = 4 };
#define NUMBER_ORDER(key, other) ((key) < (other) ? NUMBER_LESS : (key) == (other) ? NUMBER_EQUAL : NUMBER_GREATER)

#endif
