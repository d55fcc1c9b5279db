/*
 * main.c - plcrt, the runtime as a Linux process.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * SIGTERM and SIGINT end it in order, a second one at once. SIGHUP is ignored: a controller does not stop because
 * a user closes the terminal it was started from. SIGPWR says that the power is about to fail: values are saved. The controller itself is a child process (Supervisor.c), which ends
 * on SIGTERM only: SIGINT from a terminal reaches both.
 */
#define _GNU_SOURCE
#include "AppPassword.h"
#include "AppPowerFails.h"
#include "AppState.h"
#include "CmpLog.h"
#include "CmpScheduleTimer.h"
#include "CmpSrvNumbers.h"
#include "ConfigFile.h"
#include "CoreDump.h"
#include "IoConfig.h"
#include "Modbus.h"
#include "ModbusToolLine.h"
#include "LogReport.h"
#include "Metrics.h"
#include "NewFile.h"
#include "Supervisor.h"
#include "SysExcept.h"
#include "SysFileFlash.h"
#include "Systemd.h"
#include "port.h"
#include "rts_config.h"

#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

enum { EXIT_RUNTIME = 1, EXIT_USAGE = 2, DEFAULT_BAUD = 115200 };

/* As the devices have it that this function of Modbus comes from. */
enum { TUNNEL_BAUD = 38400, TUNNEL_UNIT = MODBUS_MAX_UNIT };

typedef struct {
    const char *flash;
    const char *serial;
    RTS_UI32 baud;
    const char *tcp;
    const char *udp;
    const char *can;
    PORT_CAN_OPTIONS can_options;
    MODBUS_TOOL_LINE tunnel;
    char *event[SCHED_MAX_EXTERNAL_EVENTS]; /* NAME=PIPE */
    RTS_UI32 event_count;
    bool mdns;
    const char *dump;
    const char *metrics;
    RTS_UI32 metrics_s;
    bool alone;
    bool reset_password;
} OPTIONS;

static const char usage[] =
    "usage: plcrt --flash FILE [--serial PATH|pty[:LINK]] [--baud N] [--tcp [ADDRESS:]PORT]\n"
    "             [--udp ADDRESS[:PORT]] [--mdns] [--can INTERFACE|slcan:PATH|slcan:pty] [--node N] [--name NAME]\n"
    "             [--tunnel PATH] [--tunnel-unit N] [--tunnel-baud N] [--tunnel-parity even|odd|none] "
    "[--tunnel-drive]\n"
    "             [--board NAME] [--event NAME=PIPE]... [--dump FILE] [--metrics FILE] [--metrics-every SECONDS]\n"
    "             [--config FILE] [--net ADDRESSES] [--com LINES] [--set-clock]\n"
    "\n"
    "  --flash FILE    file that stands for the flash memory; created when it does not exist\n"
    "  --serial PATH   serial device to be reached by\n"
    "  --serial pty    opens a pseudo terminal and prints its name as \"serial: /dev/pts/N\"\n"
    "  --serial pty:LINK\n"
    "                  opens one that has the name LINK, a symbolic link, while plcrt runs\n"
    "  --baud N        speed of the serial device, 115200 if not given\n"
    "  --tcp PLACE     serves TCP at [ADDRESS:]PORT, 127.0.0.1:11740 if no place is given, and prints where as\n"
    "                  \"tcp: ADDRESS:PORT\"; port 0 is one that is free, the address 0.0.0.0 all of this machine\n"
    "  --udp PLACE     serves UDP at ADDRESS[:PORT], 127.0.0.1 if no place is given, on port 1740 to 1743, the first "
    "one\n"
    "                  that is free if there is no PORT, and prints where as \"udp: ADDRESS:PORT\"\n"
    "  --mdns          announces name and TCP port by multicast DNS: plctool scan finds it, --tcp NAME.local reaches "
    "it\n"
    "  --can PLACE     serves CAN: an interface of the system (can0), an adapter (slcan:/dev/ttyACM0), or with "
    "slcan:pty a\n"
    "                  pseudo terminal, whose name it prints as \"can: /dev/pts/N\"\n"
    "  --node N        number of the device on CAN, 1..127; 1 if not given\n"
    "  --bitrate N[/M] bits per second of an adapter, 500000 if not given; with M CAN FD, with M for the data\n"
    "  --can-base ID   of the 29-bit identifiers, 0x1F400000 if not given: docs/can.md\n"
    "  --tunnel PATH   lets tools in within Modbus RTU on this serial device, also beside the program's own Modbus "
    "server:\n"
    "                  docs/modbus.md. While the program has none there, plcrt itself answers, with these settings:\n"
    "  --tunnel-unit N address, 1..247; 247 if not given\n"
    "  --tunnel-baud N speed, 38400 if not given\n"
    "  --tunnel-parity P\n"
    "                  even, odd or none; even if not given\n"
    "  --tunnel-drive  the port switches the direction of the bus; adapters do it by themselves\n"
    "  --name NAME     of the device in a scan; the name of this machine if not given\n"
    "  --board NAME    what device.toml calls this machine: programs with inputs and outputs of another board are "
    "refused\n"
    "  --event N=PIPE  each byte written into the named pipe is the external event N of tasks\n"
    "  --dump FILE     writes variables, calls, registers and log to this file when the program stops with an "
    "exception,\n"
    "                  for plctool inspect: docs/dump.md\n"
    "  --metrics FILE  writes cycles, jitter, overruns, errors, load and state as text for Prometheus: "
    "docs/packages.md\n"
    "  --metrics-every SECONDS\n"
    "                  how often, 15 if not given\n"
    "  --config FILE   reads settings from this file, also those of other options, which count unless they are given "
    "here:\n"
    "                  docs/settings.md\n"
    "  --help-config   prints all settings, as a file to begin with\n"
    "  --reset-password\n"
    "                  removes the password that is in the flash file, and ends\n"
    "  --set-clock     lets the program set the clock of this machine, if plcrt may: docs/library.md\n"
    "  --net LIST      addresses that the program may reach by UDP and TCP: ADDRESS[/BITS][:PORT[-PORT]] with commas "
    "between;\n"
    "                  only this machine if not given: docs/sockets.md\n"
    "  --com LIST      serial devices that the program may open as ports 1, 2 .., with commas between: "
    "docs/library.md\n"
    "  --no-supervisor runs the controller in this process, for debuggers: nothing starts it again when it dies\n"
    "  --version       prints the version\n"
    "  --help          prints this\n"
    "\n"
    "Ends on SIGTERM or SIGINT, with exit status 0 when everything was saved; SIGHUP is ignored. SIGPWR saves retain\n"
    "variables, since the power is about to fail: docs/retain.md.\n";

static volatile sig_atomic_t quit;

/* ---- options ---- */

/* Where the option comes from that is being read: "" on the command line, else "FILE:LINE: ". */
static char option_place[PATH_MAX + 16];

static void refuse(const char *format, ...) __attribute__((noreturn, format(printf, 1, 2)));

static void refuse(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fprintf(stderr, "plcrt: %s", option_place);
    vfprintf(stderr, format, arguments);
    fprintf(stderr, "\n");
    va_end(arguments);
    exit(EXIT_USAGE);
}

static RTS_UI32 parse_baud(const char *option, const char *text)
{
    char *end;
    errno = 0;
    unsigned long baud = strtoul(text, &end, 10);
    if (errno != 0 || *end != '\0' || baud > UINT32_MAX || !PortComKnowsBaud((RTS_UI32)baud)) {
        refuse("%s %s is not a speed of serial devices: give 9600, 19200, 38400, 57600, 115200 or more", option, text);
    }
    return (RTS_UI32)baud;
}

static const char *parse_board(const char *text)
{
    size_t length = strlen(text);
    if (length == 0 || length >= IO_CONFIG_MAX_NAME) {
        refuse("--board '%s' is no name of a board: give 1 to %d characters, as device.toml has them", text,
               IO_CONFIG_MAX_NAME - 1);
    }
    return text;
}

static void print_and_exit(const char *text)
{
    fputs(text, stdout);
    exit(fflush(stdout) == 0 ? EXIT_SUCCESS : EXIT_RUNTIME);
}

enum {
    OPTION_FLASH = 256,
    OPTION_SERIAL,
    OPTION_BAUD,
    OPTION_EVENT,
    OPTION_ALONE,
    OPTION_RESET_PASSWORD,
    OPTION_SET_CLOCK,
    OPTION_VERSION,
    OPTION_HELP,
    OPTION_CAN,
    OPTION_NODE,
    OPTION_BIT_RATE,
    OPTION_CAN_BASE,
    OPTION_NAME,
    OPTION_BOARD,
    OPTION_UDP,
    OPTION_TCP,
    OPTION_TUNNEL,
    OPTION_TUNNEL_UNIT,
    OPTION_TUNNEL_BAUD,
    OPTION_TUNNEL_PARITY,
    OPTION_TUNNEL_DRIVE,
    OPTION_DUMP,
    OPTION_METRICS,
    OPTION_METRICS_EVERY,
    OPTION_MDNS,
    OPTION_CONFIG,
    OPTION_HELP_CONFIG,
    OPTION_NET,
    OPTION_COM,
};

/* clang-format off */
static const struct option long_options[] = {
    {"flash", required_argument, NULL, OPTION_FLASH},
    {"serial", required_argument, NULL, OPTION_SERIAL},
    {"baud", required_argument, NULL, OPTION_BAUD},
    {"event", required_argument, NULL, OPTION_EVENT},
    {"no-supervisor", no_argument, NULL, OPTION_ALONE},
    {"reset-password", no_argument, NULL, OPTION_RESET_PASSWORD},
    {"set-clock", no_argument, NULL, OPTION_SET_CLOCK},
    {"version", no_argument, NULL, OPTION_VERSION},
    {"help", no_argument, NULL, OPTION_HELP},
    {"can", required_argument, NULL, OPTION_CAN},
    {"node", required_argument, NULL, OPTION_NODE},
    {"bitrate", required_argument, NULL, OPTION_BIT_RATE},
    {"can-base", required_argument, NULL, OPTION_CAN_BASE},
    {"name", required_argument, NULL, OPTION_NAME},
    {"board", required_argument, NULL, OPTION_BOARD},
    {"udp", optional_argument, NULL, OPTION_UDP},
    {"tcp", optional_argument, NULL, OPTION_TCP},
    {"tunnel", required_argument, NULL, OPTION_TUNNEL},
    {"tunnel-unit", required_argument, NULL, OPTION_TUNNEL_UNIT},
    {"tunnel-baud", required_argument, NULL, OPTION_TUNNEL_BAUD},
    {"tunnel-parity", required_argument, NULL, OPTION_TUNNEL_PARITY},
    {"tunnel-drive", no_argument, NULL, OPTION_TUNNEL_DRIVE},
    {"mdns", no_argument, NULL, OPTION_MDNS},
    {"dump", required_argument, NULL, OPTION_DUMP},
    {"metrics", required_argument, NULL, OPTION_METRICS},
    {"metrics-every", required_argument, NULL, OPTION_METRICS_EVERY},
    {"config", required_argument, NULL, OPTION_CONFIG},
    {"help-config", no_argument, NULL, OPTION_HELP_CONFIG},
    {"net", required_argument, NULL, OPTION_NET},
    {"com", required_argument, NULL, OPTION_COM},
    {NULL, 0, NULL, 0},
};
/* clang-format on */

static const char *take_serial(const char *text)
{
    if (strcmp(text, "pty:") == 0) {
        refuse("--serial pty: lacks the name of the link: write for example pty:/tmp/plc");
    }
    return text;
}

static const char *take_tcp(const char *text)
{
    SOCKADDRESS place;
    if (!PortTcpKnows(text, &place)) {
        refuse("--tcp %s is not a valid address: write for example 11740, or 192.168.1.5:11740", text);
    }
    return text;
}

static const char *take_udp(const char *text)
{
    SOCKADDRESS place;
    bool numbered;
    if (!PortUdpKnows(text, &place, &numbered)) {
        refuse("--udp %s is not a valid address: write for example 192.168.1.5, or 192.168.1.5:1741 for one of the "
               "ports 1740 to 1743",
               text);
    }
    return text;
}

static void take_net(const char *text)
{
    if (!PortNetAllow(text)) {
        refuse("--net %s is not a list of addresses: write for example 192.168.1.0/24,10.0.0.5:1202", text);
    }
}

static void take_com(const char *text)
{
    if (!PortComAllow(text)) {
        refuse("--com %s is not a list of at most %d serial devices: write for example /dev/ttyS1,/dev/ttyUSB0", text,
               IEC_COMS);
    }
}

static void take_event(OPTIONS *options, char *text)
{
    if (options->event_count == RTS_COUNT(options->event)) {
        refuse("--event %s is one too many: there may be %d", text, SCHED_MAX_EXTERNAL_EVENTS);
    }
    options->event[options->event_count++] = text;
}

/* A number from `text` up to `most`; *end is what follows it. */
static RTS_UI32 parse_number(const char *text, unsigned long most, char **end)
{
    errno = 0;
    unsigned long number = text[0] >= '0' && text[0] <= '9' ? strtoul(text, end, 0) : ULONG_MAX;
    return errno != 0 || number > most ? UINT32_MAX : (RTS_UI32)number;
}

static RTS_UI32 parse_node(const char *text)
{
    char *end = "";
    RTS_UI32 node = parse_number(text, CAN_NODE_MAX, &end);
    if (node == UINT32_MAX || node == 0 || *end != '\0') {
        refuse("--node %s is not the number of a device: give 1 to 127", text);
    }
    return node;
}

static RTS_UI32 parse_can_base(const char *text)
{
    char *end = "";
    RTS_UI32 base = parse_number(text, 0x1FFFFFFF, &end);
    if (base == UINT32_MAX || (base & ~(RTS_UI32)CAN_BASE_MASK) != 0 || *end != '\0') {
        refuse("--can-base %s is not a base of identifiers: give 29 bits of which the last 16 are 0, as 0x1F400000",
               text);
    }
    return base;
}

static void parse_bit_rate(const char *text, PORT_CAN_OPTIONS *options)
{
    char *end = "?";
    options->bit_rate = parse_number(text, 1000000, &end);
    options->data_bit_rate = *end == '/' ? parse_number(end + 1, 8000000, &end) : 0;
    if (options->bit_rate == UINT32_MAX || options->data_bit_rate == UINT32_MAX || *end != '\0' ||
        options->bit_rate == 0) {
        refuse("--bitrate %s is not one of CAN: give for example 500000, or 500000/2000000 for CAN FD", text);
    }
}

/* The temporary file beside it has a longer name. */
static const char *parse_new_file(const char *option, const char *text, const char *example)
{
    if (text[0] == '\0' || strlen(text) >= PATH_MAX - NEW_FILE_EXTRA) {
        refuse("--%s '%.40s' is not the name of a file: give for example %s", option, text, example);
    }
    return text;
}

static RTS_UI32 parse_seconds(const char *text)
{
    char *end = "";
    RTS_UI32 seconds = parse_number(text, METRICS_LONGEST_S, &end);
    if (seconds == UINT32_MAX || seconds == 0 || *end != '\0') {
        refuse("--metrics-every %s is not a number of seconds: give 1 to %d", text, METRICS_LONGEST_S);
    }
    return seconds;
}

static RTS_UI8 parse_unit(const char *text)
{
    char *end = "";
    RTS_UI32 unit = parse_number(text, MODBUS_MAX_UNIT, &end);
    if (unit == UINT32_MAX || unit == MODBUS_BROADCAST || *end != '\0') {
        refuse("--tunnel-unit %s is not an address of Modbus: give 1 to 247", text);
    }
    return (RTS_UI8)unit;
}

static RTS_UI8 parse_parity(const char *text)
{
    static const char *const names[] = {
        [SYSCOM_PARITY_NONE] = "none", [SYSCOM_PARITY_EVEN] = "even", [SYSCOM_PARITY_ODD] = "odd"};
    for (size_t i = 0; i < RTS_COUNT(names); i++) {
        if (strcmp(text, names[i]) == 0) {
            return (RTS_UI8)i;
        }
    }
    refuse("--tunnel-parity %s is not a parity: give even, odd or none", text);
}

static void take_tunnel_option(MODBUS_TOOL_LINE *tunnel, int option)
{
    if (option == OPTION_TUNNEL) {
        tunnel->name = optarg;
    } else if (option == OPTION_TUNNEL_UNIT) {
        tunnel->unit = parse_unit(optarg);
    } else if (option == OPTION_TUNNEL_BAUD) {
        tunnel->settings.baud = parse_baud("--tunnel-baud", optarg);
    } else if (option == OPTION_TUNNEL_PARITY) {
        tunnel->settings.parity = parse_parity(optarg);
    } else if (option == OPTION_TUNNEL_DRIVE) {
        tunnel->settings.rs485 = true;
    }
}

static void take_can_option(OPTIONS *options, int option)
{
    if (option == OPTION_CAN) {
        options->can = optarg;
    } else if (option == OPTION_NODE) {
        options->can_options.node = parse_node(optarg);
    } else if (option == OPTION_BIT_RATE) {
        parse_bit_rate(optarg, &options->can_options);
    } else if (option == OPTION_CAN_BASE) {
        options->can_options.base = parse_can_base(optarg);
    }
}

static void take_option(OPTIONS *options, int option)
{
    switch (option) {
    case OPTION_FLASH:
        options->flash = optarg;
        break;
    case OPTION_SERIAL:
        options->serial = take_serial(optarg);
        break;
    case OPTION_BAUD:
        options->baud = parse_baud("--baud", optarg);
        break;
    case OPTION_EVENT:
        take_event(options, optarg);
        break;
    case OPTION_COM:
        take_com(optarg);
        break;
    case OPTION_NET:
        take_net(optarg);
        break;
    case OPTION_MDNS:
        options->mdns = true;
        break;
    case OPTION_DUMP:
        options->dump = parse_new_file("dump", optarg, "/var/lib/plcrt/plc.dump");
        break;
    case OPTION_METRICS:
        options->metrics = parse_new_file("metrics", optarg, "/run/plcrt/main.prom");
        break;
    case OPTION_METRICS_EVERY:
        options->metrics_s = parse_seconds(optarg);
        break;
    case OPTION_ALONE:
        options->alone = true;
        break;
    case OPTION_SET_CLOCK:
        PortClockMaySet();
        break;
    case OPTION_RESET_PASSWORD:
        options->reset_password = true;
        break;
    case OPTION_NAME:
        PortTargetSetName(optarg);
        break;
    case OPTION_BOARD:
        PortTargetSetBoard(parse_board(optarg));
        break;
    case OPTION_VERSION:
        print_and_exit("plcrt " PLCRT_VERSION "\n");
        break;
    case OPTION_HELP:
        print_and_exit(usage);
        break;
    case OPTION_CONFIG: /* read before all others */
        break;
    case OPTION_HELP_CONFIG:
        ConfigFileHelp();
        print_and_exit("");
        break;
    case OPTION_TCP:
        options->tcp = take_tcp(optarg != NULL ? optarg : "127.0.0.1");
        break;
    case OPTION_UDP:
        options->udp = take_udp(optarg != NULL ? optarg : "127.0.0.1");
        break;
    default:
        take_can_option(options, option);
        take_tunnel_option(&options->tunnel, option);
    }
}

/* Short options come in groups (-xy), so the argument before the next one need not be it. */
static void refuse_option(const char *argument)
{
    if (optopt > 0 && optopt <= UCHAR_MAX) {
        refuse("-%c is not an option: see plcrt --help", optopt);
    }
    refuse("%s is not an option or lacks its value: see plcrt --help", argument);
}

/* getopt_long takes an optional value only after "="; this takes the next argument, too. */
static void take_place(int argc, char **argv, int option)
{
    bool may_be_missing = option == OPTION_TCP || option == OPTION_UDP;
    if (may_be_missing && optarg == NULL && optind < argc && argv[optind][0] != '-') {
        optarg = argv[optind++];
    }
}

/* Of an option that SettingsInfo knows. */
static int option_number(const char *name)
{
    const struct option *option = long_options;
    while (strcmp(option->name, name) != 0) {
        option++;
    }
    return option->val;
}

static void take_config_file(OPTIONS *options, const char *path)
{
    CONFIG_OPTION next;
    if (!ConfigFileRead(path)) {
        exit(EXIT_USAGE);
    }
    while (ConfigFileNext(&next)) {
        (void)snprintf(option_place, sizeof(option_place), "%s:%u: ", path, next.line);
        optarg = next.value;
        take_option(options, option_number(next.option));
    }
    option_place[0] = '\0';
}

/* What the file of --config says, which other options of the command line change. */
static void take_config(OPTIONS *options, int argc, char **argv)
{
    const char *path = NULL;
    int option;
    while ((option = getopt_long(argc, argv, "", long_options, NULL)) != -1) {
        take_place(argc, argv, option);
        if (option == OPTION_CONFIG && path != NULL) {
            refuse("--config %s is one too many: there may be one file", optarg);
        }
        if (option == OPTION_CONFIG) {
            path = optarg;
        }
    }
    optind = 0; /* from the beginning */
    if (path != NULL) {
        take_config_file(options, path);
    }
}

static OPTIONS parse_options(int argc, char **argv)
{
    OPTIONS options = {.baud = DEFAULT_BAUD,
                       .metrics_s = METRICS_S,
                       .can_options = {.node = CAN_NODE, .base = CAN_ID_BASE, .bit_rate = CAN_BIT_RATE},
                       .tunnel = {NULL, {TUNNEL_BAUD, SYSCOM_PARITY_EVEN, 1, false}, TUNNEL_UNIT}};
    int option;
    opterr = 0;
    take_config(&options, argc, argv);
    while ((option = getopt_long(argc, argv, "", long_options, NULL)) != -1) {
        if (option == '?') {
            refuse_option(argv[optind - 1]);
        }
        take_place(argc, argv, option);
        take_option(&options, option);
    }
    if (optind < argc) {
        refuse("%s is not an option: see plcrt --help", argv[optind]);
    }
    if (options.mdns && options.tcp == NULL) {
        refuse("--mdns announces where TCP is served: give --tcp too");
    }
    if (options.flash == NULL) {
        refuse("--flash FILE is missing: name the file that stands for the flash memory");
    }
    return options;
}

/* ---- life ---- */

/* The parent process may have closed them: what is opened next would take their place, and be written to by printf. */
static void hold_standard_streams(void)
{
    int file;
    do {
        file = open("/dev/null", O_RDWR);
    } while (file >= 0 && file <= STDERR_FILENO);
    (void)close(file);
}

static void on_end_signal(int number)
{
    RTS_UNUSED(number);
    quit = 1;
    SchedRequestEnd();
}

static void on_power_signal(int number)
{
    RTS_UNUSED(number);
    AppPowerFails();
}

/* SIGXFSZ (a limit of file sizes) and SIGPIPE are errors of the write that met them. */
static void ignore_signals(void)
{
    (void)signal(SIGHUP, SIG_IGN);
    (void)signal(SIGPIPE, SIG_IGN);
    (void)signal(SIGXFSZ, SIG_IGN);
}

/* And SIGPWR, after which it goes on. `flags`: SA_RESETHAND, for a second signal that ends the process at once, or 0. */
static void take_end_signals(int flags)
{
    sigset_t ends;
    struct sigaction end = {.sa_handler = on_end_signal, .sa_flags = flags};
    struct sigaction power = {.sa_handler = on_power_signal};
    sigemptyset(&end.sa_mask);
    sigemptyset(&power.sa_mask);
    sigaction(SIGPWR, &power, NULL);
    sigaction(SIGTERM, &end, NULL);
    sigaction(SIGINT, &end, NULL);
    sigemptyset(&ends); /* the parent process may have blocked them */
    sigaddset(&ends, SIGTERM);
    sigaddset(&ends, SIGINT);
    sigaddset(&ends, SIGPWR);
    sigprocmask(SIG_UNBLOCK, &ends, NULL);
}

/* Also what is wrong with the flash is said here, not only in the log: the device may have no other line. */
static bool start(void)
{
    RTS_RESULT result = CMInit();
    if (!PortLogReport(true) && result != ERR_OK) {
        PortPrint(PORT_ERROR, "start-up failed with error 0x%04X", (unsigned)result);
    }
    return result == ERR_OK;
}

/* Saves what is to be kept; false when some of it is lost. */
static bool end(void)
{
    (void)PortLogReport(false);
    PortSystemdStopping();
    (void)CMExit();
    PortMetricsEnd();
    return !PortLogReport(true);
}

/* No page of the runtime is to be fetched from disk in the middle of a cycle. */
static void lock_memory(void)
{
    if (mlockall(MCL_CURRENT) != 0) {
        LogAdd(CMPID_CmpMgr, LOG_INFO, ERR_MEMORY_LOCK_FAILED, "Memory is not locked: %s", strerror(errno));
    }
}

static void main_loop(void)
{
    while (!quit) {
        PortMainPass();
        (void)CMCallHook(CH_COMM_CYCLE);
        PortNoteRunning(AppGetState() == AS_RUN);
        (void)PortLogReport(false);
        PortMetricsPass();
        PortSystemdPass();
        (void)PortWait(PORT_IDLE_MS);
    }
}

static bool open_events(const OPTIONS *options, PORT_REASON *reason)
{
    RTS_UI32 opened = 0;
    while (opened < options->event_count && PortEventOpen(options->event[opened], reason)) {
        opened++;
    }
    return opened == options->event_count;
}

/* What became of the program after the death of a worker. */
static void describe_program(char *words, size_t size)
{
    enum { MINUTES = PORT_PROGRAM_RESTARTS_MS / 60000 };
    unsigned restart = PortProgramRestart();
    words[0] = '\0';
    if (restart > PORT_PROGRAM_RESTARTS) {
        (void)snprintf(words, size, "; its program stays stopped, after %d restarts in %d minutes",
                       PORT_PROGRAM_RESTARTS, MINUTES);
    } else if (AppGetState() == AS_RUN) {
        (void)snprintf(words, size, "; its program runs again (%u of %d times in %d minutes)", restart,
                       PORT_PROGRAM_RESTARTS, MINUTES);
    }
}

static void log_restart(void)
{
    char words[80];
    if (SysStartGet()->stay_stopped != SYS_BOOT_START) {
        describe_program(words, sizeof(words));
        LogAdd(CMPID_CmpMgr, LOG_WARNING | LOG_KEPT, ERR_OK, "The controller died (%s) and was started again%s",
               SysStartGet()->text, words);
    } else {
        LogAdd(CMPID_CmpMgr, LOG_INFO | LOG_KEPT, ERR_OK, "plcrt started");
    }
}

static void print_socket(const char *what, SYSSOCK_PURPOSE purpose)
{
    char name[32];
    if (PortSockName(purpose, name, sizeof(name))) {
        printf("%s: %s\n", what, name);
    }
}

/* Where the device can be reached, as far as the options do not say it. */
static void print_lines(void)
{
    if (PortComPtyName() != NULL) {
        printf("serial: %s\n", PortComPtyName());
    }
    print_socket("tcp", SYSSOCK_TCP);
    print_socket("udp", SYSSOCK_UDP);
    if (PortCanPtyName() != NULL) {
        printf("can: %s\n", PortCanPtyName());
    }
    (void)fflush(stdout);
}

static int run(void)
{
    if (!start()) {
        return EXIT_RUNTIME;
    }
    log_restart();
    lock_memory();
    CoreDumpBegin();
    if (PortIsUp()) {
        print_lines();
    }
    PortSystemdReady();
    main_loop();
    return end() ? EXIT_SUCCESS : EXIT_RUNTIME;
}

static int run_alone(void)
{
    take_end_signals((int)SA_RESETHAND);
    return run();
}

/* The supervisor sees to it that a second signal ends it at once. */
static int run_supervised(void)
{
    take_end_signals(0);
    (void)signal(SIGINT, SIG_IGN);
    return run();
}

static bool open_lines(const OPTIONS *options, PORT_REASON *reason)
{
    return (options->serial == NULL || PortComOpen(options->serial, options->baud, reason)) &&
           (options->tcp == NULL || PortTcpOpen(options->tcp, reason)) &&
           (options->udp == NULL || PortUdpOpen(options->udp, reason)) && (!options->mdns || PortMdnsOpen(reason)) &&
           (options->can == NULL || PortCanOpen(options->can, &options->can_options, reason)) &&
           (options->tunnel.name == NULL || PortComCheck(options->tunnel.name, &options->tunnel.settings, reason));
}

static void close_all(void)
{
    PortCanClose();
    PortMdnsClose();
    PortSockClose();
    PortComClose();
    PortFlashClose();
}

static bool open_all(const OPTIONS *options, PORT_REASON *reason)
{
    bool opened = PortFlashOpen(options->flash, reason) && open_lines(options, reason);
    if (!opened) {
        close_all();
    }
    return opened;
}

/* What the last plcrt used may be busy for a moment after it was killed. */
static bool open_when_free(const OPTIONS *options, PORT_REASON *reason)
{
    const struct timespec moment = {0, 10 * 1000 * 1000};
    bool opened = open_all(options, reason);
    for (int ms = 0; !opened && reason->busy && ms < PORT_BUSY_MS; ms += 10) {
        (void)nanosleep(&moment, NULL);
        opened = open_all(options, reason);
    }
    return opened;
}

/* What may be meant, but is to be known. */
static void print_warnings(const OPTIONS *options)
{
    bool tunnel = options->tunnel.name != NULL;
    if (options->serial == NULL && options->tcp == NULL && options->udp == NULL && options->can == NULL && !tunnel) {
        PortPrint(PORT_WARNING, "no tool can reach this controller: give --serial, --tcp, --udp, --can or --tunnel");
    }
    if (options->serial != NULL && !PortComIsThere()) {
        PortPrint(PORT_WARNING, "serial line %s is missing: it is used when it comes", options->serial);
    }
    if (options->can != NULL && PortCanAway() != NULL) {
        PortPrint(PORT_WARNING, "CAN %s is missing (%s): it is used when it comes", options->can, PortCanAway());
    }
    if (PortFlashIsShared()) {
        PortPrint(PORT_WARNING, "other users may open %s, with the password and the program in it: chmod 600 %s",
                  options->flash, options->flash);
    }
}

/* For users who have forgotten it: those who may write the file have the device anyway. */
static int reset_password(const OPTIONS *options, PORT_REASON *reason)
{
    if (access(options->flash, F_OK) != 0) { /* opening would make it */
        PortPrint(PORT_ERROR, "%s: %s", options->flash, strerror(errno));
        return EXIT_RUNTIME;
    }
    if (!PortFlashOpen(options->flash, reason)) {
        PortPrint(PORT_ERROR, "%s", reason->text);
        return EXIT_RUNTIME;
    }
    RTS_RESULT result = SysFileFlash_Hook(CH_INIT_SYSTEM2);
    if (result == ERR_OK) {
        result = AppPasswordReset();
    }
    PortFlashClose();
    if (result == ERR_OK) {
        printf("The password in %s is removed.\n", options->flash);
    } else if (result == ERR_NO_OBJECT) {
        printf("There is no password in %s.\n", options->flash);
    } else {
        PortPrint(PORT_ERROR, "the password in %s cannot be removed: error 0x%04X", options->flash, (unsigned)result);
    }
    return result == ERR_OK || result == ERR_NO_OBJECT ? EXIT_SUCCESS : EXIT_RUNTIME;
}

int main(int argc, char **argv)
{
    OPTIONS options = parse_options(argc, argv);
    PORT_REASON reason = {.busy = false};
    hold_standard_streams();
    ignore_signals();
    PortSystemdInit();
    if (options.reset_password) {
        return reset_password(&options, &reason);
    }
    if (!open_when_free(&options, &reason) || !open_events(&options, &reason)) {
        PortPrint(PORT_ERROR, "%s", reason.text);
        return EXIT_RUNTIME;
    }
    print_warnings(&options);
    ModbusToolLineSet(&options.tunnel);
    CoreDumpSet(options.dump);
    if (options.metrics != NULL) {
        PortMetricsSet(options.metrics, options.metrics_s);
    }
    int status = options.alone ? run_alone() : PortSupervise(run_supervised);
    SysExceptShutdown();
    PortEventClose();
    close_all();
    return status;
}
