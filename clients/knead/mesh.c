// knead mesh: fills a closed surface with a mesh, or describes an existing mesh.
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/mesher.h"
#include "core/scene/mesh_file.h"
#include "core/scene/units.h"
#include "server/option_table.h"
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char help[] =
    "usage: knead mesh IN.obj|IN.stl -o OUT.msh --size LENGTH [OPTION]...\n"
    "       knead mesh IN.msh [--unit UNIT]\n\n"
    "Fills a closed surface with tetrahedra, for object.mesh of a scene; or checks a mesh and prints its figures:\n"
    "nodes, edges, volume, spacing, quality (1 is the regular tetrahedron or triangle).\n\n"
    "    knead mesh bun.stl -o bun.msh --size 5mm\n\n"
    "  -o OUT.msh          output mesh, in Gmsh's format 4.1, in the unit of the surface\n"
    "  --size LENGTH       approximate length of an edge: 5mm, '0.5 cm'\n"
    "  --tool gmsh|tetgen  meshing program: gmsh meshes the surface anew, tetgen keeps it and adds to it (default:\n"
    "                      gmsh)\n"
    "  --unit m|cm|mm|um   unit of the coordinates in the file (default: mm)\n\n"
    "A surface is refused, with file:line:col, if it has holes, edges of three triangles, or two pieces.\n"
    "Exit codes: 0 ok, 2 bad input, 3 the program is not installed, or the mesh cannot be written.\n";

// Quality of an element (core/simplices.h) below which a warning is printed. Such an element has 3 % of the volume of a
// regular tetrahedron with the same sum of squared edges.
#define THIN 0.1

typedef struct options {
    const char *in, *out;
    double size_m, units_per_m;
    int unit; // index of a unit
    int tool; // a kn_mesher; -1: not given
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
                           "-o, --size and --tool make a mesh of a surface, expected .obj or .stl");
    if (!surface) return KN_OPTIONS_READ;
    if (!(o->size_m > 0)) return kn_complain(mesh, KN_EXIT_USAGE, "expected --size LENGTH, e.g. --size 5mm");
    if (!o->out || !ends_in_msh(o->out)) return kn_complain(mesh, KN_EXIT_USAGE, "expected -o OUT.msh");
    return KN_OPTIONS_READ;
}

// Read the command line.
static int take_options(int argc, char **argv, options *o)
{
#define AT(member) .offset = offsetof(options, member)
    static const kn_option rows[] = {
        KN_OPTION("output", TEXT, AT(out), .letter = 'o'),
        KN_OPTION("size", QUANTITY, AT(size_m), .expected = "a length from 1e-05 to 1 m, e.g. 5mm", .unit = "m",
                  KN_RANGE(1e-5, 1)),
        KN_OPTION("tool", CHOICE, AT(tool), .unit = "gmsh|tetgen"),
        KN_OPTION("unit", CHOICE, AT(unit), .unit = "m|cm|mm|um"),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help, .short_help = true, .help_last = true};
    const int code = kn_options_read(&table, o, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (argc - optind != 1) return kn_complain(mesh, KN_EXIT_USAGE, "expected one .obj, .stl or .msh file; see --help");
    o->in = argv[optind];
    o->units_per_m = unit_scales[o->unit];
    return check_options(o);
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
    if (facts.left_out > 0) printf("left out  %d points, lines or triangles beside the elements\n", facts.left_out);
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
    // Write to a temporary file in the same folder, and rename it to the final name at the end.
    char part[4096];
    snprintf(part, sizeof part, "%s.part", o->out);
    FILE *f = fopen(part, "w");
    if (f) write_mesh(f, s, o->units_per_m);
    bool good = f && !ferror(f);
    if (f) good = fclose(f) == 0 && good;
    if (good && rename(part, o->out) == 0) return KN_EXIT_OK;
    int why = errno;
    if (f) unlink(part);
    return kn_complain(mesh, KN_EXIT_DEVICE, "%s: %s, expected a file that can be written", o->out, strerror(why));
}

// Fill the surface with tetrahedra, save the mesh and check the saved mesh.
static int fill(const options *o, const kn_shell *shell)
{
    char error[512];
    kn_simplices *s = NULL;
    // Estimate the number of tetrahedra first, because the external program may run for minutes.
    double size = o->size_m * o->units_per_m, count = shell->volume / (0.08 * size * size * size);
    if (count > KN_SIMPLICES_ELEMENTS_MAX)
        return kn_complain(mesh, KN_EXIT_USAGE, "--size: %g mm would make about %.1g tetrahedra, expected at most %d",
                           1e3 * o->size_m, count, KN_SIMPLICES_ELEMENTS_MAX);
    if (isatty(STDERR_FILENO)) fprintf(stderr, "about %.2g tetrahedra\n", fmax(count, 1));
    int code = kn_mesher_run(o->tool > 0 ? KN_MESHER_TETGEN : KN_MESHER_GMSH, shell, size, o->units_per_m, &s, error,
                             sizeof error);
    if (code != KN_EXIT_OK) return kn_complain(mesh, code, "%s: %s", o->in, error);
    code = save_mesh(o, s);
    kn_simplices_destroy(s);
    if (code != KN_EXIT_OK) return code;
    printf("surface   %s: %d triangles, closed, %.4g cm^3 inside\n", o->in, shell->triangle_count,
           shell->volume * pow(1e2 / o->units_per_m, 3));
    return check_mesh(o, o->out); // load and check the file as a scene does
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
