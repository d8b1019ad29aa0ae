// The kneadd that knead latency starts for its measurement.
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/latency.h"
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

// Port numbers: the first port, the number of ports per run of knead latency, and the number of such sets of ports. All
// are below the range from which Linux assigns ports by itself.
static const int ports_from = 12000, ports_each = 3, ports_sets = 6000;

// Choose ports by process id. Two simultaneous runs must not receive each other's messages, and stock liblcm
// distinguishes buses only by port.
void kn_latency_served_urls(kn_latency_served *s, char echo_url[KN_LATENCY_URL_SIZE])
{
    int port = ports_from + ports_each * (int)(getpid() % ports_sets);
    snprintf(s->url, sizeof s->url, "udpm://239.255.76.67:%d?ttl=0", port);
    snprintf(s->mesh_url, sizeof s->mesh_url, "udpm://239.255.76.67:%d?ttl=0", port + 1);
    snprintf(echo_url, KN_LATENCY_URL_SIZE, "udpm://239.255.76.67:%d?ttl=0", port + 2);
}

// Start a child process that ends when this process ends. The descriptor `out` becomes the standard output of the
// child. Return the process id of the child, or 0 on failure.
static int spawn(const char *path, char *const argv[], int out)
{
    pid_t parent = getpid(), pid = fork();
    if (pid < 0) return 0;
    if (pid > 0) return pid;
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    // Put the child into its own process group. Ctrl-C in the terminal then reaches only this process, which stops the
    // child.
    setpgid(0, 0);
    // Exit if the parent process died before prctl took effect.
    if (getppid() != parent) _exit(KN_EXIT_DEVICE);
    dup2(out, STDOUT_FILENO);
    execvp(path, argv);
    _exit(127);
}

// Return the path of kneadd in the folder of knead, as in a build or an installation. If it does not exist, return the
// bare name, for which PATH is searched.
static const char *find_kneadd(char path[PATH_MAX])
{
    ssize_t n = readlink("/proc/self/exe", path, PATH_MAX - sizeof "kneadd");
    char *slash = n > 0 ? memrchr(path, '/', (size_t)n) : NULL;
    if (!slash) return "kneadd";
    strcpy(slash + 1, "kneadd");
    return access(path, X_OK) == 0 ? path : "kneadd";
}

int kn_latency_served_start(kn_latency_served *s, const char *scene, const char *phase)
{
    char program[PATH_MAX], trace[32];
    int pipes[2];
    s->trace = memfd_create("knead latency", 0); // the child inherits the descriptor
    if (s->trace < 0 || pipe2(pipes, O_CLOEXEC) != 0)
        return kn_complain("latency", KN_EXIT_DEVICE, "no pipe to kneadd: %s", strerror(errno));
    snprintf(trace, sizeof trace, "/proc/self/fd/%d", s->trace);
    char *argv[] = {"kneadd",    "--scene", (char *)scene, "--lcm-url", s->url, "--mesh-url",
                    s->mesh_url, "--phase", (char *)phase, "--trace",   trace,  NULL};
    s->pid = spawn(find_kneadd(program), argv, pipes[1]);
    close(pipes[1]);
    // Wait for the first line of kneadd's output, which kneadd prints as soon as it serves the scene.
    s->said = fdopen(pipes[0], "r");
    if (s->pid && s->said && fgets(s->greeting, sizeof s->greeting, s->said)) return KN_EXIT_OK;
    int status = 0, pid = s->pid;
    s->pid = 0;
    if (pid) waitpid(pid, &status, 0);
    // If kneadd ended with an exit code, it has already printed the error.
    if (pid && WIFEXITED(status) && WEXITSTATUS(status) != 127) return WEXITSTATUS(status);
    return kn_complain("latency", KN_EXIT_DEVICE, "kneadd cannot be run: expected it beside knead, or in PATH");
}

// Copy the times of each tick's stages from kneadd's trace to the poses. The rows of the trace and the poses have the
// same order. A pose that two ticks used gets the times of the first tick.
static void take_stages(FILE *trace, kn_flights *poses)
{
    char line[512];
    kn_flight row;
    for (int at = 0; fgets(line, sizeof line, trace);) {
        if (sscanf(line, "%*[^,],%*[^,],%" SCNd64 ",%" SCNd64 ",%" SCNd64 ",%" SCNd64 ",%" SCNd64 ",%" SCNd64,
                   &row.session, &row.seq, &row.arrived_ns, &row.woke_ns, &row.stepped_ns, &row.guarded_ns) != 6)
            continue;
        // Find the pose of this row of the trace. Skip the row if its pose is not in the list.
        int from = at;
        while (at < poses->count && (poses->list[at].session != row.session || poses->list[at].seq != row.seq)) at++;
        if (at == poses->count) {
            at = from;
            continue;
        }
        kn_flight *pose = &poses->list[at];
        if (pose->woke_ns) continue;
        pose->arrived_ns = row.arrived_ns;
        pose->woke_ns = row.woke_ns;
        pose->stepped_ns = row.stepped_ns;
        pose->guarded_ns = row.guarded_ns;
    }
}

bool kn_latency_served_stop(kn_latency_served *s, kn_flights *poses)
{
    // Wait until kneadd has exited, because it writes the end of its trace before.
    int status = 0;
    if (s->pid) {
        kill(s->pid, SIGTERM);
        waitpid(s->pid, &status, 0);
    }
    s->pid = 0;
    if (s->said) fclose(s->said);
    s->said = NULL;
    FILE *trace = s->trace >= 0 ? fdopen(s->trace, "r") : NULL;
    if (trace) {
        rewind(trace);
        take_stages(trace, poses);
        fclose(trace);
    }
    s->trace = -1;
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}
