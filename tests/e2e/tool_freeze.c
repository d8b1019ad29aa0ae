// freeze PID THREAD SECONDS: stop one thread for that time, as if stuck. All other threads of the process go on. Exit
// 77: the kernel does not allow this.
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

static int find(const char *pid, const char *name) // 0: no such thread
{
    char path[300], line[64];
    snprintf(path, sizeof path, "/proc/%s/task", pid);
    DIR *threads = opendir(path);
    int found = 0;
    for (struct dirent *e; threads && !found && (e = readdir(threads));) {
        snprintf(path, sizeof path, "/proc/%s/task/%s/comm", pid, e->d_name);
        FILE *file = fopen(path, "r");
        if (file && fgets(line, sizeof line, file) && strcspn(line, "\n") == strlen(name) &&
            strncmp(line, name, strlen(name)) == 0)
            found = atoi(e->d_name);
        if (file) fclose(file);
    }
    if (threads) closedir(threads);
    return found;
}

int main(int argc, char **argv)
{
    int thread = argc == 4 ? find(argv[1], argv[2]) : 0, status;
    if (!thread) return fprintf(stderr, "usage: freeze PID THREAD SECONDS\n"), 2;
    if (ptrace(PTRACE_SEIZE, thread, NULL, NULL) != 0 || ptrace(PTRACE_INTERRUPT, thread, NULL, NULL) != 0 ||
        waitpid(thread, &status, __WALL) != thread)
        return perror("freeze"), 77;
    usleep((useconds_t)(1e6 * atof(argv[3])));
    return ptrace(PTRACE_DETACH, thread, NULL, NULL) == 0 ? 0 : 1;
}
