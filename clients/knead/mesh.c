// knead mesh: fills a closed surface with a mesh, or describes an existing mesh. Gmsh (GPL) and TetGen (AGPL) are run,
// never linked. They run in a folder of their own, which is removed afterwards, also after Ctrl-C.
//
//   gmsh     splits the surface at edges sharper than 40 degrees, meshes its pieces anew, then the inside: edges have
//            the wanted length, whatever the triangles were
//   tetgen   keeps the surface and adds points if quality or size need them, so it is never coarser than the triangles
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "core/scene/mesh_file.h"
#include "core/scene/units.h"
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <limits.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

static const char help[] =
    "usage: knead mesh IN.obj|IN.stl --out OUT.msh --size LENGTH [OPTION]...\n"
    "       knead mesh IN.msh [--unit UNIT]\n\n"
    "Fill a closed surface with tetrahedra, for object.mesh of a scene, or check a mesh. Both forms print nodes,\n"
    "edges, volume, spacing and quality; the quality of the regular tetrahedron or triangle is 1. A surface with a\n"
    "hole, an edge of three or more triangles, or two separate pieces is refused, with file:line:col.\n\n"
    "  --out FILE          output mesh, in Gmsh's format 4.1, in the unit of the surface\n"
    "  --size LENGTH       approximate length of an edge: 5mm, '0.5 cm'. If the mesh has 5 % more or less volume than\n"
    "                      the surface, a smaller size is used and printed\n"
    "  --tool gmsh|tetgen  meshing program (default: gmsh, then tetgen if gmsh cannot fill the surface, or has\n"
    "                      not done so after a minute of processor time and 0.2 ms for each tetrahedron).\n"
    "                      gmsh replaces the triangles of the surface, tetgen keeps them and adds more\n"
    "  --unit m|cm|mm|um   unit of the coordinates in the file (default: mm)\n\n"
    "Examples:\n"
    "    knead mesh block.stl --out block.msh --size 1cm\n"
    "    knead mesh block.msh\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 the program is not installed, or the mesh cannot be written.\n";

// Quality of an element (core/simplices.h) below which a warning is printed. Such an element has 3 % of the volume of a
// regular tetrahedron with the same sum of squared edges.
#define THIN 0.1

typedef enum mesher { MESHER_GMSH, MESHER_TETGEN } mesher;

typedef struct options {
    const char *in, *out;
    double size_m, units_per_m;
    int unit; // index of the unit of length in unit_names
    int tool; // meshing program (mesher); -1: not given
} options;

static const char *const unit_names[] = {"m", "cm", "mm", "um"};
static const double unit_scales[] = {1, 1e2, 1e3, 1e6};

static const char mesh[] = "mesh"; // name of the subcommand in error messages

// ---- options

static bool ends_in_msh(const char *path)
{
    size_t size = strlen(path);
    return size > 4 && strcmp(path + size - 4, ".msh") == 0;
}

// Check that the given options are valid for the kind of input (a surface or a mesh).
static int check_options(const options *o)
{
    // The ending of the file name shows if the input is a surface or a mesh.
    bool surface = kn_shell_named(o->in);
    if (!surface && !ends_in_msh(o->in))
        return kn_complain(mesh, KN_EXIT_USAGE, "'%s': expected a file that ends in .obj, .stl or .msh", o->in);
    if (!surface && (o->out || o->size_m > 0 || o->tool >= 0))
        return kn_complain(mesh, KN_EXIT_USAGE,
                           "-o, --size and --tool make a mesh of a surface, expected a file that ends in .obj or .stl");
    if (!surface) return KN_OPTIONS_READ;
    if (!(o->size_m > 0)) return kn_complain(mesh, KN_EXIT_USAGE, "expected --size LENGTH, e.g. --size 5mm");
    if (!o->out || !ends_in_msh(o->out)) return kn_complain(mesh, KN_EXIT_USAGE, "expected --out OUT.msh");
    return KN_OPTIONS_READ;
}

// Read the command line.
static int take_options(int argc, char **argv, options *o)
{
#define AT(member) .offset = offsetof(options, member)
    static const kn_option rows[] = {
        KN_OPTION("out", TEXT, AT(out)),
        KN_OPTION("output", RENAMED, .expected = "--out FILE", .letter = 'o'),
        KN_OPTION("size", QUANTITY, AT(size_m), .expected = "a length from 1e-05 to 1 m, e.g. 5mm", .unit = "m",
                  KN_RANGE(1e-5, 1)),
        KN_OPTION("tool", CHOICE, AT(tool), .unit = "gmsh|tetgen"),
        KN_OPTION("unit", CHOICE, AT(unit), .unit = "m|cm|mm|um"),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    const int code = kn_options_read(&table, o, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (argc - optind != 1) return kn_complain(mesh, KN_EXIT_USAGE, "expected one .obj, .stl or .msh file; see --help");
    o->in = argv[optind];
    o->units_per_m = unit_scales[o->unit];
    return check_options(o);
}

// ---- the external program that fills a surface

// Largest angle between neighbouring triangles of one smooth piece of the surface, degrees. gmsh's own examples use the
// same value. A ball of 24 x 12 facets has angles of 15 degrees.
#define ANGLE_DEG 40
// Largest volume of a tetrahedron that tetgen may create, as a multiple of size^3, where size is the desired edge
// length. With tetgen's quality bound of 1.4 the mean edge is 1.06 size (block of 5 x 5 x 3 cm, size 6 mm).
#define TETGEN_VOLUME 0.3
// EXIT_NO_PROGRAM: exit code of a child process whose program does not exist. LINE_BYTES: largest length of a line in
// the log of an external program.
enum { EXIT_NO_PROGRAM = 127, LINE_BYTES = 200 };

typedef struct job {
    char folder[PATH_MAX];
    const char *program;
    rlim_t work_s;
    char *error;
    size_t error_size;
} job;

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

// Remove the temporary folder with everything in it. The programs run with this folder as HOME, so it also
// holds the preferences that gmsh's toolkit writes.
static void remove_folder(const job *j) { nftw(j->folder, remove_one, 8, FTW_DEPTH | FTW_PHYS); }

// Return the largest processor time of an external program, s, for a number of tetrahedra. A million take 100 s.
static rlim_t work_s(double count) { return (rlim_t)(60 + 2e-4 * count); }

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
    setrlimit(RLIMIT_CPU, &(struct rlimit){j->work_s, j->work_s + 5});
    execvp(argv[0], argv);
    _exit(errno == ENOENT ? EXIT_NO_PROGRAM : 1);
}

// Wait until the child ends, and kill it after an interrupt. Show that the child is working, because it may print
// nothing for minutes: once a second on a terminal, else in a line every ten seconds.
static int attend(const job *j, pid_t child)
{
    static const struct timespec pause = {0, 20000000};
    bool watched = isatty(STDERR_FILENO);
    int status = -1;
    pid_t ended;
    for (time_t start = time(NULL), told = -1, now;
         (ended = waitpid(child, &status, WNOHANG)) == 0 || (ended < 0 && errno == EINTR); told = now) {
        if (kn_interrupted && ended == 0) kill(child, SIGKILL);
        now = time(NULL) - start;
        if (now != told && (watched || (now > 0 && now % 10 == 0)))
            fprintf(stderr, watched ? "\r%s at work: %lld s" : "%s at work: %lld s\n", j->program, (long long)now);
        nanosleep(&pause, NULL);
    }
    if (watched) fprintf(stderr, "\r%40s\r", "");
    return status;
}

// Run an external program in the temporary folder. Return its status as waitpid does, or -1 if the program could not be
// started.
static int run_program(const job *j, char *const *argv)
{
    pid_t child = kn_interrupted ? -1 : fork();
    if (child == 0) become(j, argv);
    return child > 0 ? attend(j, child) : -1;
}

// Find the line of the program's log that gives the reason of a failure: the first line about an error, or the last
// line if no line is about an error.
static void find_reason(const job *j, char reason[LINE_BYTES])
{
    char line[LINE_BYTES];
    FILE *log = fopen(in_folder(j, "log"), "r");
    snprintf(reason, LINE_BYTES, "the program printed no message");
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
    if (endless) snprintf(reason, sizeof reason, "not done after %d s of processor time", (int)j->work_s);
    else find_reason(j, reason);
    snprintf(j->error, j->error_size, "%s cannot fill this surface: %s%s", j->program, reason,
             endless ? "" : " (repair the surface there, split polygons into triangles, or try a smaller --size)");
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

static int run_gmsh(job *j, const kn_shell *shell, double size, double units_per_m, kn_simplices **made)
{
    // Use one thread, so that gmsh gives the same mesh every time.
    char *const argv[] = {"gmsh", "-3", "-nt", "1", "-format", "msh41", "in.geo", "-o", "out.msh", NULL};
    char what[512];
    if (!kn_shell_write_stl(shell, in_folder(j, "in.stl")) || !write_geo(j, size)) return unwritten(j);
    int code = judge(j, run_program(j, argv));
    if (code != KN_EXIT_OK) return code;
    *made = kn_msh_load(in_folder(j, "out.msh"), units_per_m, NULL, what, sizeof what);
    return *made ? KN_EXIT_OK : unusable(j, what);
}

// ---- tetgen: in.1.node has a line `count 3 0 0` and lines `number x y z`; in.1.ele has a line `count 4 0` and lines
// `number a b c d`

// Read the first line of a tetgen file: the number of items that follow, and some numbers that are ignored.
static bool read_count(kn_words *w, long most, int others, long *count)
{
    long ignored;
    if (!kn_words_integer(w, KN_WIDTH_INT, 1, most, count, "the number of items in the file")) return false;
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
    // Check the mesh of tetgen before knead uses the mesh.
    good = good && kn_simplices_check(s, error, size);
    if (!good) {
        kn_simplices_destroy(s);
        s = NULL;
    }
    free(nodes);
    free(elements);
    return s;
}

static int run_tetgen(job *j, const kn_shell *shell, double size, double units_per_m, kn_simplices **made)
{
    char switches[64], what[512];
    snprintf(switches, sizeof switches, "-pq1.4a%.9gQ", TETGEN_VOLUME * size * size * size);
    char *const argv[] = {"tetgen", switches, "in.off", NULL};
    if (!kn_shell_write_off(shell, in_folder(j, "in.off"))) return unwritten(j);
    // tetgen crashes without a message if the surface intersects itself. In that case a second run with -d reports the
    // facets that intersect.
    char *const crossings[] = {"tetgen", "-d", "in.off", NULL};
    int status = run_program(j, argv);
    if (WIFSIGNALED(status) && !kn_interrupted) run_program(j, crossings);
    int code = judge(j, status);
    if (code != KN_EXIT_OK) return code;
    *made = read_tetgen(j, units_per_m, what, sizeof what);
    return *made ? KN_EXIT_OK : unusable(j, what);
}

// Estimate the number of tetrahedra with this edge length.
static double tetrahedra(const kn_shell *shell, double size) { return shell->volume / (0.08 * size * size * size); }

// Fill a surface. `size` is the desired edge length, in the length unit of the surface. `units_per_m` is the number of
// these units in a metre. `*made` is in metres and has passed kn_simplices_check. Return an exit code KN_EXIT_*. If it
// is not KN_EXIT_OK, one line in error gives the reason.
static int run_mesher(mesher tool, const kn_shell *shell, double size, double units_per_m, kn_simplices **made,
                      char *error, size_t error_size)
{
    job j = {.program = tool == MESHER_GMSH ? "gmsh" : "tetgen",
             .work_s = work_s(tetrahedra(shell, size)),
             .error = error,
             .error_size = error_size};
    // From here on, a signal stops the external program, and the temporary folder is removed in that case as well.
    kn_interrupt_watch();
    int code = KN_EXIT_DEVICE;
    if (make_folder(&j)) {
        code = (tool == MESHER_GMSH ? run_gmsh : run_tetgen)(&j, shell, size, units_per_m, made);
        remove_folder(&j);
    }
    kn_interrupt_unwatch();
    kn_interrupt_die();
    return code;
}

// ---- report

// Print the properties of a mesh, and the line that uses the mesh in a scene.
static void print_mesh(const options *o, const char *file, const char *format, const kn_simplices *s)
{
    kn_simplices_measures m;
    if (!kn_simplices_measure(s, &m)) return;
    bool flat = s->dimension == 2;
    const char *base = strrchr(file, '/') ? strrchr(file, '/') + 1 : file;
    printf("mesh      %s: Gmsh %s, %d nodes, %d %s, %d edges\n", file, format, s->node_count, s->element_count,
           flat ? "triangles" : "tetrahedra", m.edges);
    printf("size      %.4g", 1e3 * (m.high_m[0] - m.low_m[0]));
    if (!flat) printf(" x %.4g", 1e3 * (m.high_m[1] - m.low_m[1]));
    printf(" x %.4g mm, %s %.4g %s\n", 1e3 * (m.high_m[2] - m.low_m[2]), flat ? "area" : "volume",
           m.volume * (flat ? 1e4 : 1e6), flat ? "cm^2" : "cm^3");
    printf("spacing   edges of %.3g mm in the mean, %.3g to %.3g mm\n", 1e3 * m.edge_mean_m, 1e3 * m.edge_min_m,
           1e3 * m.edge_max_m);
    printf("quality   %.2f in the mean, %.2f at worst (element %ld); 1 is the regular %s\n", m.quality_mean,
           m.quality_min, s->tag[m.worst], flat ? "triangle" : "tetrahedron");
    // Warn if the worst element of the mesh is thin.
    if (m.quality_min < THIN)
        printf("warning   element %ld is thin: it hardly carries load and may invert\n", s->tag[m.worst]);
    printf("scene     object: { mesh: %s, mesh_unit: %s }\n", base, unit_names[o->unit]);
}

// Load a mesh in the same way as a scene does, and print its properties.
static int check_mesh(const options *o, const char *file)
{
    char error[512];
    kn_msh_facts facts;
    kn_simplices *s = kn_msh_load(file, o->units_per_m, &facts, error, sizeof error);
    if (!s) return kn_complain(mesh, KN_EXIT_USAGE, "%s", error);
    print_mesh(o, file, facts.format, s);
    // Report the parts of the file that are not used for the object.
    if (facts.left_out > 0)
        printf("left out  %d points, lines or triangles that are no elements of the mesh\n", facts.left_out);
    if (facts.loose > 0) printf("left out  %d nodes that no element uses\n", facts.loose);
    kn_simplices_destroy(s);
    return KN_EXIT_OK;
}

// ---- a mesh of a surface

// Write a mesh in version 4.1 of Gmsh's format, with one block of nodes and one block of elements.
static void write_mesh(FILE *f, const kn_simplices *s, double units_per_m)
{
    fprintf(f, "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 %d 1 %d\n3 1 0 %d\n", s->node_count, s->node_count,
            s->node_count);
    for (int i = 0; i < s->node_count; i++) fprintf(f, "%d\n", i + 1);
    // Write 12 digits, which hide the rounding errors of converting a length to metres and back.
    for (int i = 0; i < s->node_count; i++)
        fprintf(f, "%.12g %.12g %.12g\n", units_per_m * s->x_m[i][0], units_per_m * s->x_m[i][1],
                units_per_m * s->x_m[i][2]);
    fprintf(f, "$EndNodes\n$Elements\n1 %d 1 %d\n3 1 4 %d\n", s->element_count, s->element_count, s->element_count);
    for (int e = 0; e < s->element_count; e++) {
        const int *node = s->element[e];
        fprintf(f, "%d %d %d %d %d\n", e + 1, node[0] + 1, node[1] + 1, node[2] + 1, node[3] + 1);
    }
    fprintf(f, "$EndElements\n");
}

// Write the mesh file completely or not at all. An existing file is replaced only when the new file is complete.
static int save_mesh(const options *o, const kn_simplices *s)
{
    kn_beside file;
    if (!kn_output_open(&file, mesh, o->out)) return KN_EXIT_DEVICE;
    write_mesh(file.file, s, o->units_per_m);
    return kn_output_close(&file, mesh);
}

// Fill the surface with tetrahedra of an edge length. If gmsh fails and no program was asked for, let tetgen try; *tool
// is the program from then on.
static int fill_size(const options *o, const kn_shell *shell, double size, int *tool, kn_simplices **s)
{
    char error[512], first[512];
    // Estimate the number of tetrahedra first, because the external program may run for minutes.
    const double count = tetrahedra(shell, size);
    if (count > KN_SIMPLICES_ELEMENTS_MAX)
        return kn_complain(mesh, KN_EXIT_USAGE, "--size: %g mm would make about %.1g tetrahedra, expected at most %d",
                           1e3 * size / o->units_per_m, count, KN_SIMPLICES_ELEMENTS_MAX);
    if (isatty(STDERR_FILENO)) fprintf(stderr, "about %.2g tetrahedra\n", fmax(count, 1));
    int code = run_mesher(*tool > 0 ? MESHER_TETGEN : MESHER_GMSH, shell, size, o->units_per_m, s, error, sizeof error);
    if (code != KN_EXIT_USAGE || *tool >= 0)
        return code == KN_EXIT_OK ? code : kn_complain(mesh, code, "%s: %s", o->in, error);
    *tool = MESHER_TETGEN;
    snprintf(first, sizeof first, "%s", error);
    code = run_mesher(MESHER_TETGEN, shell, size, o->units_per_m, s, error, sizeof error);
    if (code != KN_EXIT_OK) return kn_complain(mesh, code, "%s: %s; %s", o->in, first, error);
    fprintf(stderr, "knead mesh: %s; tetgen has filled it\n", first);
    return code;
}

// Largest difference of the mesh's volume from the surface's, and number of smaller sizes that are tried.
#define VOLUME_OFF 0.05
enum { SIZES = 12 };

// Fill the surface, with a smaller size while the mesh cuts off too much, save the mesh and check the saved mesh.
static int fill(const options *o, const kn_shell *shell)
{
    kn_simplices *s = NULL;
    double size = o->size_m * o->units_per_m;
    int tool = o->tool;
    for (int i = 0; i <= SIZES && (i == 0 || tetrahedra(shell, size) < KN_SIMPLICES_ELEMENTS_MAX); i++, size *= 0.7) {
        const int code = fill_size(o, shell, size, &tool, &s);
        if (code != KN_EXIT_OK) return code;
        kn_simplices_measures m = {0};
        kn_simplices_measure(s, &m);
        const double off = m.volume * pow(o->units_per_m, 3) / shell->volume - 1;
        if (fabs(off) <= VOLUME_OFF) break;
        fprintf(stderr, "knead mesh: with edges of %.3g mm the volume of the mesh is off by %+.0f %%\n",
                1e3 * size / o->units_per_m, 100 * off);
        kn_simplices_destroy(s);
        s = NULL;
    }
    if (!s)
        return kn_complain(mesh, KN_EXIT_USAGE,
                           "%s: no mesh within %.0f %% of the volume down to edges of %.3g mm, expected "
                           "a smaller --size or --tool tetgen",
                           o->in, 100 * VOLUME_OFF, 1e3 * size / 0.7 / o->units_per_m);
    const int code = save_mesh(o, s);
    kn_simplices_destroy(s);
    if (code != KN_EXIT_OK) return code;
    printf("surface   %s: %d triangles, closed, %.4g cm^3 inside\n", o->in, shell->triangle_count,
           shell->volume * pow(1e2 / o->units_per_m, 3));
    if (shell->welded > 0)
        printf("          %d corners up to %.2g mm apart were welded\n", shell->welded,
               1e3 * shell->gap / o->units_per_m);
    if (size < o->size_m * o->units_per_m)
        printf("          edges of %.3g mm instead of %.3g mm, because larger ones change the volume by more than %.0f "
               "%%\n",
               1e3 * size / o->units_per_m, 1e3 * o->size_m, 100 * VOLUME_OFF);
    return check_mesh(o, o->out); // load and check the file in the same way as when a scene is loaded
}

int kn_mesh_main(int argc, char **argv)
{
    options o = {.unit = 2, .tool = -1};
    char error[512];
    int code = take_options(argc, argv, &o);
    if (code != KN_OPTIONS_READ) return code;
    if (!kn_shell_named(o.in)) return check_mesh(&o, o.in);
    kn_shell *shell = kn_shell_load(o.in, error, sizeof error);
    if (!shell) return kn_complain(mesh, KN_EXIT_USAGE, "%s", error);
    code = fill(&o, shell);
    kn_shell_destroy(shell);
    return code;
}
