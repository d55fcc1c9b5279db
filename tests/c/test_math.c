/*
 * test_math.c - the functions CmpMath offers: their signatures, and that each is the one its name says.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpMath.h"

#include "CmpChecksum.h"
#include "test.h"

#include <math.h>
#include <string.h>

/* Interface text, arguments and result of one call. */
typedef struct {
    const char *text;
    double a;
    double b;
    double result;
} FUNCTION;

static const FUNCTION functions[] = {
    {"sin(LREAL):LREAL", 0.5, 0, 0.47942553860420300},
    {"cos(LREAL):LREAL", 0.5, 0, 0.87758256189037272},
    {"tan(LREAL):LREAL", 0.5, 0, 0.54630248984379051},
    {"asin(LREAL):LREAL", 0.5, 0, 0.52359877559829887},
    {"acos(LREAL):LREAL", 0.5, 0, 1.0471975511965979},
    {"atan(LREAL):LREAL", 0.5, 0, 0.46364760900080612},
    {"exp(LREAL):LREAL", 0.5, 0, 1.6487212707001282},
    {"log(LREAL):LREAL", 0.5, 0, -0.69314718055994531},
    {"log10(LREAL):LREAL", 0.5, 0, -0.30102999566398120},
    {"atan2(LREAL,LREAL):LREAL", 0.5, 2, 0.24497866312686414},
    {"pow(LREAL,LREAL):LREAL", 0.5, 2, 0.25},
    {"sinf(REAL):REAL", 0.5, 0, 0.47942553860420300},
    {"cosf(REAL):REAL", 0.5, 0, 0.87758256189037272},
    {"tanf(REAL):REAL", 0.5, 0, 0.54630248984379051},
    {"asinf(REAL):REAL", 0.5, 0, 0.52359877559829887},
    {"acosf(REAL):REAL", 0.5, 0, 1.0471975511965979},
    {"atanf(REAL):REAL", 0.5, 0, 0.46364760900080612},
    {"expf(REAL):REAL", 0.5, 0, 1.6487212707001282},
    {"logf(REAL):REAL", 0.5, 0, -0.69314718055994531},
    {"log10f(REAL):REAL", 0.5, 0, -0.30102999566398120},
    {"atan2f(REAL,REAL):REAL", 0.5, 2, 0.24497866312686414},
    {"powf(REAL,REAL):REAL", 0.5, 2, 0.25},
};

static const CMP_EXT_FUNCTION *find(const FUNCTION *function)
{
    char name[16] = "";
    size_t length = strcspn(function->text, "(");
    if (length < sizeof(name)) {
        memcpy(name, function->text, length);
    }
    return CMFindExternal(name);
}

static double call(const FUNCTION *function, RTS_PFN pfn)
{
    int lreal = strstr(function->text, "LREAL") != NULL;
    int two = strchr(function->text, ',') != NULL;
    if (lreal) {
        return two ? ((double (*)(double, double))pfn)(function->a, function->b)
                   : ((double (*)(double))pfn)(function->a);
    }
    return two ? ((float (*)(float, float))pfn)((float)function->a, (float)function->b)
               : ((float (*)(float))pfn)((float)function->a);
}

static void every_signature_is_the_crc_of_its_interface_text(void)
{
    for (size_t i = 0; i < RTS_COUNT(functions); i++) {
        const CMP_EXT_FUNCTION *found = find(&functions[i]);
        CHECK(found != NULL);
        CHECK(found != NULL && found->signature == CRC32Update(0, functions[i].text, strlen(functions[i].text)));
        CHECK(found != NULL && found->version == 0x00010000);
    }
}

static void every_function_is_the_one_its_name_says(void)
{
    for (size_t i = 0; i < RTS_COUNT(functions); i++) {
        const CMP_EXT_FUNCTION *found = find(&functions[i]);
        double tolerance = strstr(functions[i].text, "LREAL") != NULL ? 1e-15 : 1e-6;
        CHECK(found != NULL && fabs(call(&functions[i], found->function) - functions[i].result) <= tolerance);
    }
}

int main(void)
{
    CHECK_EQUAL(CmpMath_Hook(CH_INIT3), ERR_OK);
    RUN(every_signature_is_the_crc_of_its_interface_text);
    RUN(every_function_is_the_one_its_name_says);
    return test_result();
}
