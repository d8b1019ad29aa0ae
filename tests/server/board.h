#ifndef KN_TESTS_BOARD_H
#define KN_TESTS_BOARD_H
// knead-simdev as a process of its own, started in the build folder.
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

typedef struct kn_board {
    pid_t pid;
    FILE *out;
    char uri[160];
} kn_board;

// Start knead-simdev. argument: its options, ending with NULL. The board may not be ready yet. The board dies with
// the calling thread, however the thread ends. A board left running would hold the test's stderr open, and ctest
// waits until stderr is closed.
static inline kn_board kn_board_spawn(const char *const argument[])
{
    const char *all[20] = {"setpriv", "--pdeathsig", "KILL", "bin/knead-simdev"};
    int pipe_of[2];
    kn_board b = {0};
    for (int i = 0; argument[i] && i < 15; i++) all[i + 4] = argument[i];
    posix_spawn_file_actions_t actions; // spawn instead of fork: this process's pages stay its own
    if (pipe2(pipe_of, O_CLOEXEC) || posix_spawn_file_actions_init(&actions)) exit(1);
    posix_spawn_file_actions_adddup2(&actions, pipe_of[1], 1);
    if (posix_spawnp(&b.pid, all[0], &actions, NULL, (char *const *)all, environ)) exit(1);
    posix_spawn_file_actions_destroy(&actions);
    close(pipe_of[1]);
    b.out = fdopen(pipe_of[0], "r");
    if (!b.out) exit(1);
    return b;
}

// Start a board and wait until it is ready. End the program on failure.
static inline kn_board kn_board_start(const char *const argument[])
{
    kn_board b = kn_board_spawn(argument);
    if (!fgets(b.uri, 100, b.out)) {
        fprintf(stderr, "knead-simdev says nothing\n");
        exit(1);
    }
    b.uri[strcspn(b.uri, "\n")] = 0;
    return b;
}

static inline void kn_board_kill(kn_board *b)
{
    kill(b->pid, SIGKILL);
    waitpid(b->pid, NULL, 0);
    fclose(b->out);
}

// Kill the board, and remove its link or the file of its memory.
static inline void kn_board_end(kn_board *b)
{
    char kind[8], name[128], path[160];
    kn_board_kill(b);
    if (sscanf(b->uri, "%7[a-z]:%127[^?]", kind, name) != 2) return;
    snprintf(path, sizeof path, "%s%s", strcmp(kind, "shm") == 0 ? "/dev/shm/" : "", name);
    unlink(path);
}

#endif
