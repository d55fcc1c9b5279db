/*
 * AppFunctions.h - what an image calls, what of it is called, and its names.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main only.
 */
#ifndef APPFUNCTIONS_H
#define APPFUNCTIONS_H

#include "AppChecks.h"

/* Checks of AppLoader.c. */
RTS_RESULT LoaderCheckFunctions(LOADER *l);
RTS_RESULT LoaderCheckImports(LOADER *l);
RTS_RESULT LoaderCheckIecFunctions(LOADER *l);
RTS_RESULT LoaderCheckInfo(LOADER *l);

/* Fills the tables of an image that has passed all checks; an error is one of the flash. */
RTS_RESULT AppLoaderRead(const APP_IMAGE *image, APP_TABLES *tables);

/* Copies string `index` of the application info segment, cut to `size`; "" when there is none. */
void AppLoaderReadInfo(const APP_IMAGE *image, RTS_UI32 index, char *text, RTS_SIZE size);

#if IEC_EVENTS
/* Returns where in the code the function of an event (EVT_*) is; IMAGE_NO_ENTRY without one. */
RTS_UI32 AppLoaderFindEvent(const APP_IMAGE *image, RTS_UI32 event);
#endif

#endif
