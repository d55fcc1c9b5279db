/*
 * HostNames.c - looks up names of hosts, each in a thread, which ends with the answer.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A thread that nothing waits for any more cannot be stopped: it keeps its question until the C library returns.
 */
#define _GNU_SOURCE
#include "HostNames.h"

#include "SysSocket.h"
#include "port.h"
#include "rts_config.h"

#include <netdb.h>
#include <pthread.h>
#include <signal.h>
#include <string.h>

/* So many for each connection: one that is asked now, and one that was forgotten. */
enum { QUESTIONS = 2 * SYSSOCK_MAX_FIELD_BUS };

typedef enum { FREE, ASKED, ANSWERED, FORGOTTEN } STATE;

typedef struct {
    STATE state;
    char host[SYSSOCK_MAX_NAME + 1];
    RTS_UI16 port;
    RTS_RESULT result;
    HOST_ADDRESSES found;
} QUESTION;

static QUESTION questions[QUESTIONS];
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER; /* of their states, and of answers */

/* ---- the thread ---- */

static void add(HOST_ADDRESSES *found, const struct addrinfo *next, RTS_UI16 port)
{
    struct sockaddr_in6 *address = &found->address[found->count];
    if (next->ai_addrlen > sizeof(*address) || (next->ai_family != AF_INET && next->ai_family != AF_INET6)) {
        return;
    }
    memset(address, 0, sizeof(*address));
    memcpy(address, next->ai_addr, next->ai_addrlen);
    address->sin6_port = htons(port); /* at the same place in a sockaddr_in */
    found->count++;
}

static RTS_RESULT look_up(const char *host, RTS_UI16 port, HOST_ADDRESSES *found)
{
    const struct addrinfo hints = {.ai_family = AF_UNSPEC, .ai_socktype = SOCK_STREAM};
    struct addrinfo *all;
    int error = getaddrinfo(host, NULL, &hints, &all);
    found->count = 0;
    if (error == EAI_NONAME || error == EAI_NODATA) {
        return ERR_NO_OBJECT;
    }
    if (error != 0) {
        return ERR_TIMEOUT;
    }
    for (const struct addrinfo *next = all; next != NULL && found->count < HOST_MAX_ADDRESSES; next = next->ai_next) {
        add(found, next, port);
    }
    freeaddrinfo(all);
    return found->count != 0 ? ERR_OK : ERR_NO_OBJECT;
}

static void *run(void *param)
{
    QUESTION *question = param;
    HOST_ADDRESSES found;
    RTS_RESULT result = look_up(question->host, question->port, &found);
    pthread_mutex_lock(&lock);
    question->result = result;
    question->found = found;
    question->state = question->state == FORGOTTEN ? FREE : ANSWERED;
    pthread_mutex_unlock(&lock);
    return NULL;
}

/* Below all tasks, whatever priority main has now. Signals are main's. */
static bool start_thread(QUESTION *question)
{
    const struct sched_param parameters = {.sched_priority = 0};
    pthread_attr_t attributes;
    pthread_t thread;
    sigset_t all, before;
    sigfillset(&all);
    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, PORT_STACK_SIZE);
    pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
    pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
    pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
    pthread_attr_setschedparam(&attributes, &parameters);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int error = pthread_create(&thread, &attributes, run, question);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    pthread_attr_destroy(&attributes);
    return error == 0;
}

/* ---- questions ---- */

static STATE set_state(QUESTION *question, STATE state)
{
    pthread_mutex_lock(&lock);
    STATE before = question->state;
    question->state = state == FORGOTTEN && before == ANSWERED ? FREE : state;
    pthread_mutex_unlock(&lock);
    return before;
}

static int take_free(void)
{
    int number = 0;
    pthread_mutex_lock(&lock);
    while (number < QUESTIONS && questions[number].state != FREE) {
        number++;
    }
    if (number < QUESTIONS) {
        questions[number].state = ASKED;
    }
    pthread_mutex_unlock(&lock);
    return number < QUESTIONS ? number : -1;
}

int HostNameAsk(const char *host, RTS_UI16 port)
{
    size_t length = strnlen(host, SYSSOCK_MAX_NAME + 1);
    int number = length <= SYSSOCK_MAX_NAME ? take_free() : -1;
    if (number < 0) {
        return -1;
    }
    memcpy(questions[number].host, host, length);
    questions[number].host[length] = '\0';
    questions[number].port = port;
    if (!start_thread(&questions[number])) {
        (void)set_state(&questions[number], FREE);
        return -1;
    }
    return number;
}

RTS_RESULT HostNameGet(int question, HOST_ADDRESSES *found)
{
    QUESTION *asked = &questions[question];
    RTS_RESULT result = ERR_PENDING;
    pthread_mutex_lock(&lock);
    if (asked->state == ANSWERED) {
        result = asked->result;
        *found = asked->found;
        asked->state = FREE;
    }
    pthread_mutex_unlock(&lock);
    return result;
}

void HostNameForget(int question)
{
    (void)set_state(&questions[question], FORGOTTEN);
}
