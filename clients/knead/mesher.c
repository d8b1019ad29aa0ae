#include "clients/knead/mesher.h"
#include "clients/knead/commands.h"
#include "core/scene/mesh_file.h"
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

// Largest angle between neighbouring triangles of one smooth piece of the surface, degrees. gmsh's own examples use the
// same value. A ball of 24 x 12 facets has angles of 15 degrees.
#define ANGLE_DEG 40
// Largest volume of a tetrahedron that tetgen may create, as a multiple of size^3, where size is the desired edge
// length. At quality 1.4 the mean edge is 1.06 size (block of 5 x 5 x 3 cm, size 6 mm).
#define TETGEN_VOLUME 0.3
// EXIT_NO_PROGRAM: exit code of a child process whose program does not exist. LINE_BYTES: largest length of a line of a
// log.
enum { EXIT_NO_PROGRAM = 127, LINE_BYTES = 200 };

typedef struct job {
    char folder[PATH_MAX];
    const char *program;
    char *error;
    size_t error_size;
} job;

// running: process id of the external program, 0: none; stopped: number of the received signal. Both are static because
// a signal handler needs them.
static volatile sig_atomic_t running, stopped;

static void on_signal(int number)
{
    stopped = number;
    if (running > 0) kill((pid_t)running, SIGKILL);
}

static const int deadly[] = {SIGINT, SIGTERM, SIGHUP};
enum { DEADLY = 3 };

// Catch the signals that would end this process, so that the temporary folder is removed first.
static void watch_signals(struct sigaction before[DEADLY])
{
    struct sigaction action = {.sa_handler = on_signal};
    stopped = 0;
    for (int i = 0; i < DEADLY; i++) sigaction(deadly[i], &action, &before[i]);
}

// Restore the handlers. If this process received a signal, end it by the same signal, so that the parent process sees
// the cause.
static void unwatch_signals(const struct sigaction before[DEADLY])
{
    for (int i = 0; i < DEADLY; i++) sigaction(deadly[i], &before[i], NULL);
    if (stopped) raise(stopped);
}

static bool make_folder(job *j)
{
    const char *parent = getenv("TMPDIR");
    int n = snprintf(j->folder, sizeof j->folder, "%s/knead-mesh-XXXXXX", parent && *parent ? parent : "/tmp");
    if (n > 0 && (size_t)n < sizeof j->folder && mkdtemp(j->folder)) return true;
    snprintf(j->error, j->error_size, "%s: %s, expected a folder for temporary files", j->folder, strerror(errno));
    return false;
}

static const char *in_folder(const job *j, const char *name)
{
    static char path[PATH_MAX + 32];
    snprintf(path, sizeof path, "%s/%s", j->folder, name);
    return path;
}

static int remove_one(const char *path, const struct stat *status, int kind, struct FTW *where)
{
    (void)status, (void)kind, (void)where;
    return remove(path);
}

// Remove the temporary folder with everything in it. The folder is also the home of the programs, where gmsh leaves the
// preferences of its toolkit.
static void remove_folder(const job *j) { nftw(j->folder, remove_one, 8, FTW_DEPTH | FTW_PHYS); }

// Largest processor time of an external program, s. A mesh of a million tetrahedra takes a third of this time.
enum { WORK_S = 300 };

// Replace this child process by the external program. Its home is the temporary folder, so that settings of the user do
// not change the mesh.
static void become(const job *j, char *const *argv)
{
    int log = chdir(j->folder) == 0 ? open("log", O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600) : -1;
    int null = open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (log < 0 || null < 0) _exit(1);
    dup2(null, STDIN_FILENO);
    dup2(log, STDOUT_FILENO);
    dup2(log, STDERR_FILENO);
    setenv("HOME", j->folder, 1);
    // Limit the processor time, because gmsh never finishes on some surfaces, e.g. that of a single tetrahedron.
    setrlimit(RLIMIT_CPU, &(struct rlimit){WORK_S, WORK_S + 5});
    execvp(argv[0], argv);
    _exit(errno == ENOENT ? EXIT_NO_PROGRAM : 1);
}

// Wait until the child ends. On a terminal, show once a second that the child is working, because the child may print
// nothing for minutes.
static int attend(const job *j, pid_t child)
{
    static const struct timespec pause = {0, 20000000};
    bool watched = isatty(STDERR_FILENO);
    int status = -1;
    pid_t ended;
    for (time_t start = time(NULL), told = -1, now;
         (ended = waitpid(child, &status, WNOHANG)) == 0 || (ended < 0 && errno == EINTR); told = now) {
        now = time(NULL) - start;
        if (watched && now != told) fprintf(stderr, "\r%s at work: %lld s", j->program, (long long)now);
        nanosleep(&pause, NULL);
    }
    if (watched) fprintf(stderr, "\r%40s\r", "");
    return status;
}

// Run an external program in the temporary folder. Return its status as waitpid does, or -1 if the program could not be
// started.
static int run(const job *j, char *const *argv)
{
    sigset_t deadly_set, before;
    int status = -1;
    sigemptyset(&deadly_set);
    for (int i = 0; i < DEADLY; i++) sigaddset(&deadly_set, deadly[i]);
    // Block signals until `running` is set, because it tells the signal handler which process to stop.
    sigprocmask(SIG_BLOCK, &deadly_set, &before);
    pid_t child = stopped ? -1 : fork();
    if (child == 0) {
        // Restore the default actions of the signals in the child process.
        for (int i = 0; i < DEADLY; i++) signal(deadly[i], SIG_DFL);
        sigprocmask(SIG_SETMASK, &before, NULL);
        become(j, argv);
    }
    running = child;
    sigprocmask(SIG_SETMASK, &before, NULL);
    if (child > 0) status = attend(j, child);
    running = 0;
    return status;
}

// Find the line of the program's log that gives the reason of a failure. It is the first line about an error, else the
// last line.
static void find_reason(const job *j, char reason[LINE_BYTES])
{
    char line[LINE_BYTES];
    FILE *log = fopen(in_folder(j, "log"), "r");
    snprintf(reason, LINE_BYTES, "it printed no message");
    for (bool found = false; log && !found && fgets(line, sizeof line, log);) {
        const char *text = line + strspn(line, " \t\r\n");
        found = strncmp(text, "Error", 5) == 0 || strstr(text, " intersects facet ") != NULL;
        if (strncmp(text, "Error   : ", 10) == 0) text += 10; // remove the prefix of gmsh
        if (*text) snprintf(reason, LINE_BYTES, "%.*s", (int)strcspn(text, "\r\n"), text);
    }
    if (log) fclose(log);
    // Replace characters that are not printable, because the message is printed on a terminal.
    for (char *c = reason; *c; c++)
        if (*c < ' ' || *c > '~') *c = '?';
}

// Convert the status of the external program to an exit code, with the reason of a failure in error.
static int judge(const job *j, int status)
{
    char reason[LINE_BYTES];
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return KN_EXIT_OK;
    if (WIFEXITED(status) && WEXITSTATUS(status) == EXIT_NO_PROGRAM) {
        snprintf(j->error, j->error_size, "%s is not installed: apt-get install %s", j->program, j->program);
        return KN_EXIT_DEVICE;
    }
    // The signal SIGXCPU means that the program has reached the limit of processor time.
    bool endless = WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU;
    if (endless) snprintf(reason, sizeof reason, "not done after %d s, expected --tool tetgen or another size", WORK_S);
    else find_reason(j, reason);
    snprintf(j->error, j->error_size, "%s cannot fill this surface: %s", j->program, reason);
    return KN_EXIT_USAGE;
}

static int unwritten(const job *j)
{
    snprintf(j->error, j->error_size, "%s: %s, expected room for temporary files", j->folder, strerror(errno));
    return KN_EXIT_DEVICE;
}

// Report that the mesh of the external program cannot be read. The message does not name the temporary file, because
// the file is removed.
static int unusable(const job *j, const char *what)
{
    char copy[512];
    snprintf(copy, sizeof copy, "%s", what);
    const char *clause = strstr(copy, ": ");
    snprintf(j->error, j->error_size, "%s made an unusable mesh: %s", j->program, clause ? clause + 2 : copy);
    return KN_EXIT_USAGE;
}

// ---- gmsh

static bool write_geo(const job *j, double size)
{
    FILE *f = fopen(in_folder(j, "in.geo"), "w");
    if (!f) return false;
    fprintf(f,
            "Merge \"in.stl\";\n"
            // Split closed pieces of the surface, because only open pieces can be mapped to the plane.
            "ClassifySurfaces{%d*Pi/180, 1, 1, Pi};\n"
            "CreateGeometry;\n"
            "Surface Loop(1) = Surface{:};\nVolume(1) = {1};\nPhysical Volume(1) = {1};\n"
            "Mesh.MeshSizeMin = %.17g;\nMesh.MeshSizeMax = %.17g;\n"
            "Mesh.MeshSizeFromPoints = 0;\nMesh.MeshSizeExtendFromBoundary = 0;\n",
            ANGLE_DEG, size, size);
    bool good = !ferror(f);
    return fclose(f) == 0 && good;
}

static int run_gmsh(job *j, const kn_shell *shell, double size, double units_per_m, kn_simplices **mesh)
{
    // Use one thread, so that gmsh gives the same mesh every time.
    char *const argv[] = {"gmsh", "-3", "-nt", "1", "-format", "msh41", "in.geo", "-o", "out.msh", NULL};
    char what[512];
    if (!kn_shell_write_stl(shell, in_folder(j, "in.stl")) || !write_geo(j, size)) return unwritten(j);
    int code = judge(j, run(j, argv));
    if (code != KN_EXIT_OK) return code;
    *mesh = kn_msh_load(in_folder(j, "out.msh"), units_per_m, NULL, what, sizeof what);
    return *mesh ? KN_EXIT_OK : unusable(j, what);
}

// ---- tetgen: in.1.node is  count 3 0 0,  then  number x y z;  in.1.ele is  count 4 0,  then  number and four nodes

// Read the first line of a tetgen file: the number of items that follow, and some numbers that are ignored.
static bool read_count(kn_words *w, long most, int others, long *count)
{
    long ignored;
    if (!kn_words_integer(w, KN_WIDTH_INT, 1, most, count, "how many there are")) return false;
    while (others-- > 0)
        if (!kn_words_integer(w, KN_WIDTH_INT, 0, LONG_MAX, &ignored, "a number")) return false;
    return true;
}

// Read the nodes of the tetgen mesh, which are numbered from 0. Convert their coordinates to metres.
static bool read_nodes(kn_words *w, kn_simplices *s, double units_per_m)
{
    long number;
    for (int i = 0; i < s->node_count; i++) {
        if (!kn_words_integer(w, KN_WIDTH_INT, i, i, &number, "the next node's number")) return false;
        for (int k = 0; k < 3; k++) {
            if (!kn_words_real(w, &s->x_m[i][k])) return false;
            s->x_m[i][k] /= units_per_m;
        }
    }
    return true;
}

static bool read_elements(kn_words *w, kn_simplices *s)
{
    for (int e = 0; e < s->element_count; e++) {
        long node;
        if (!kn_words_integer(w, KN_WIDTH_INT, e, e, &node, "the next element's number")) return false;
        s->tag[e] = e + 1;
        for (int k = 0; k < 4; k++) {
            if (!kn_words_integer(w, KN_WIDTH_INT, 0, s->node_count - 1, &node, "a node's number")) return false;
            s->element[e][k] = (int)node;
        }
    }
    return true;
}

// Read the mesh from the two output files of tetgen. On failure return NULL with one line in error.
static kn_simplices *read_tetgen(const job *j, double units_per_m, char *error, size_t size)
{
    kn_words node = {.name = "in.1.node", .section = "nodes", .error = error, .error_size = size}, element = node;
    unsigned char *nodes = kn_words_load(in_folder(j, "in.1.node"), &node.size, error, size);
    unsigned char *elements = nodes ? kn_words_load(in_folder(j, "in.1.ele"), &element.size, error, size) : NULL;
    long node_count, element_count;
    kn_simplices *s = NULL;
    element.name = "in.1.ele";
    element.section = "elements";
    node.bytes = nodes;
    element.bytes = elements;
    if (elements && read_count(&node, KN_SIMPLICES_NODES_MAX, 3, &node_count) &&
        read_count(&element, KN_SIMPLICES_ELEMENTS_MAX, 2, &element_count)) {
        s = kn_simplices_create(3, (int)node_count, (int)element_count);
        if (!s) snprintf(error, size, "not enough memory for the mesh");
    }
    bool good = s && read_nodes(&node, s, units_per_m) && read_elements(&element, s);
    // Check the mesh that tetgen made before it is used.
    good = good && kn_simplices_check(s, error, size);
    if (!good) {
        kn_simplices_destroy(s);
        s = NULL;
    }
    free(nodes);
    free(elements);
    return s;
}

static int run_tetgen(job *j, const kn_shell *shell, double size, double units_per_m, kn_simplices **mesh)
{
    char options[64], what[512];
    snprintf(options, sizeof options, "-pq1.4a%.9gQ", TETGEN_VOLUME * size * size * size);
    char *const argv[] = {"tetgen", options, "in.off", NULL};
    if (!kn_shell_write_off(shell, in_folder(j, "in.off"))) return unwritten(j);
    // tetgen crashes without a message if the surface intersects itself. In that case a second run with -d reports the
    // facets that intersect.
    char *const crossings[] = {"tetgen", "-d", "in.off", NULL};
    int status = run(j, argv);
    if (WIFSIGNALED(status) && !stopped) run(j, crossings);
    int code = judge(j, status);
    if (code != KN_EXIT_OK) return code;
    *mesh = read_tetgen(j, units_per_m, what, sizeof what);
    return *mesh ? KN_EXIT_OK : unusable(j, what);
}

int kn_mesher_run(kn_mesher mesher, const kn_shell *shell, double size, double units_per_m, kn_simplices **mesh,
                  char *error, size_t error_size)
{
    job j = {.program = mesher == KN_MESHER_GMSH ? "gmsh" : "tetgen", .error = error, .error_size = error_size};
    struct sigaction before[DEADLY];
    // From here on, a signal stops the external program, and the temporary folder is removed in that case as well.
    watch_signals(before);
    int code = KN_EXIT_DEVICE;
    if (make_folder(&j)) {
        code = (mesher == KN_MESHER_GMSH ? run_gmsh : run_tetgen)(&j, shell, size, units_per_m, mesh);
        remove_folder(&j);
    }
    unwatch_signals(before);
    return code;
}
