#ifndef KN_TESTS_BOARD_H
#define KN_TESTS_BOARD_H
// knead-simdev as a process of its own, in the build's folder.
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

static pid_t kn_board_pids[4]; // those that run, else 0

// A board that outlives its test holds the test's stderr open, and ctest waits until that is closed.
static inline void kn_board_kill_all(void)
{
    for (int i = 0; i < 4; i++)
        if (kn_board_pids[i]) kill(kn_board_pids[i], SIGKILL);
}

static inline void kn_board_replace(pid_t old, pid_t by)
{
    int i = 0;
    while (i < 4 && kn_board_pids[i] != old) i++;
    if (i == 4) fprintf(stderr, "more than 4 boards\n"), exit(1);
    kn_board_pids[i] = by;
}

// argument: its options, NULL behind the last. Ends the program when there is none.
static inline kn_board kn_board_start(const char *const argument[])
{
    const char *all[16] = {"bin/knead-simdev"};
    int pipe_of[2];
    kn_board b = {0};
    for (int i = 0; argument[i] && i < 14; i++) all[i + 1] = argument[i];
    posix_spawn_file_actions_t actions; // no fork: this process's pages stay its own
    if (pipe2(pipe_of, O_CLOEXEC) || posix_spawn_file_actions_init(&actions)) exit(1);
    posix_spawn_file_actions_adddup2(&actions, pipe_of[1], 1);
    if (posix_spawn(&b.pid, all[0], &actions, NULL, (char *const *)all, environ)) exit(1);
    posix_spawn_file_actions_destroy(&actions);
    static bool once;
    if (!once) once = atexit(kn_board_kill_all) == 0;
    kn_board_replace(0, b.pid);
    close(pipe_of[1]);
    b.out = fdopen(pipe_of[0], "r");
    if (!b.out || !fgets(b.uri, 100, b.out)) {
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
    kn_board_replace(b->pid, 0);
    fclose(b->out);
}

// Kills it for good, and removes its link or the file of its memory.
static inline void kn_board_end(kn_board *b)
{
    char kind[8], name[128], path[160];
    kn_board_kill(b);
    if (sscanf(b->uri, "%7[a-z]:%127[^?]", kind, name) != 2) return;
    snprintf(path, sizeof path, "%s%s", strcmp(kind, "shm") == 0 ? "/dev/shm/" : "", name);
    unlink(path);
}

#endif
