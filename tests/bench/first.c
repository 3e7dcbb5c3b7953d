/* How long a subject takes from its start to the first message at a plain subscriber.
 *
 * usage: first listen=PORT to_users=PORT -- COMMAND ...
 *
 * A datagram goes to the subject every 2 ms from the start on; the subscriber takes everything, heartbeats as well.
 * The subject is ended as soon as the first message is there. Prints seconds, or ends with 1 after 10 s. */
#define _GNU_SOURCE
#include "load.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>
#include <zmq.h>

enum { STEP_MS = 2, STEPS = 5000 };

static pid_t start(char **command)
{
    pid_t child = fork();
    if (child == 0) {
        int nowhere = open("/dev/null", O_RDWR);
        dup2(nowhere, STDOUT_FILENO);
        dup2(nowhere, STDERR_FILENO);
        execv(command[0], command);
        _exit(127);
    }
    return child;
}

static int first_message(void *subscriber, int udp, const struct load *load)
{
    unsigned char message[MAX_DATAGRAM];
    size_t octets = message_make(message, load, CAM);
    zmq_pollitem_t item = {.socket = subscriber, .events = ZMQ_POLLIN};
    for (uint64_t step = 0; step < STEPS; step++) {
        message_stamp(message, load, step, now_ns());
        (void)!send(udp, message, octets, 0); /* refused until the subject is bound */
        if (zmq_poll(&item, 1, STEP_MS) > 0) {
            return 1;
        }
    }
    return 0;
}

int main(int argc, char **argv)
{
    int words = 1;
    while (words < argc && strcmp(argv[words], "--") != 0) {
        words++;
    }
    if (words + 1 >= argc) {
        stop_with("a command after --");
    }
    struct load load;
    load_read(&load, words, argv);
    void *context = zmq_ctx_new();
    void *subscriber = user_socket(context, ZMQ_SUB, load.to_users, "");
    int udp = udp_open(0, load.listen);
    uint64_t begin = now_ns();
    pid_t child = start(argv + words + 1);
    int is_there = first_message(subscriber, udp, &load);
    uint64_t end = now_ns();
    kill(child, SIGTERM);
    waitpid(child, NULL, 0);
    zmq_close(subscriber);
    zmq_ctx_term(context);
    printf("%.4f\n", (double)(end - begin) / 1e9);
    return is_there ? 0 : 1;
}
