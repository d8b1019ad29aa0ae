#include "clients/knead/points.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/graft.h"
#include "core/scene/mesh_file.h"
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

// Size of the `quality` block in bytes: more than its three lines need with every number at its longest.
#define BLOCK 2048

// ---- checks before the sweep

// Check the permission bits, because root may write any file. A file that is writable for nobody is not replaced.
int kn_points_try(const kn_plan *plan)
{
    char path[PATH_MAX], folder[PATH_MAX];
    struct stat there;
    if (plan->scene->model.solver.kind == KN_SOLVER_RK4)
        return kn_complain("tradeoff", KN_EXIT_USAGE,
                           "--write: %s: solver.kind is rk4, which has no quality points, expected implicit",
                           plan->scene_path);
    if (!realpath(plan->scene_path, path) || stat(path, &there) != 0)
        return kn_complain("tradeoff", KN_EXIT_DEVICE, "--write: %s: %s", plan->scene_path, strerror(errno));
    if (!S_ISREG(there.st_mode) || !(there.st_mode & 0222) || access(path, W_OK) != 0)
        return kn_complain("tradeoff", KN_EXIT_DEVICE,
                           "--write: %s: is read-only, expected a scene that may be changed", plan->scene_path);
    // The new file is created beside the old one, so the folder must be writable.
    snprintf(folder, sizeof folder, "%s", path);
    if (access(dirname(folder), W_OK | X_OK) == 0) return KN_EXIT_OK;
    return kn_complain("tradeoff", KN_EXIT_DEVICE,
                       "--write: %s: its folder is read-only, expected a writable folder, because the file is replaced",
                       plan->scene_path);
}

// ---- the block

// Write the precision and spacing that the active quality point itself states: "precision: f64, spacing: 0.01 m, ".
static bool own_lattice(const kn_plan *plan, char text[96], char *error, size_t error_size)
{
    // Parse the scene without its quality block. If a value differs from that of the planned scene, the active quality
    // point has set this value.
    const kn_model_def *found = &plan->scene->model;
    kn_scene *bare = kn_scene_parse_beside(plan->scene_path, plan->scene_path, plan->text, strlen(plan->text), NULL, 0,
                                           error, error_size);
    text[0] = '\0';
    if (!bare) return false;
    if (bare->model.solver.precision != found->solver.precision)
        strcat(text, found->solver.precision == KN_PRECISION_F64 ? "precision: f64, " : "precision: f32, ");
    if (!found->mesh && bare->model.spacing_m != found->spacing_m)
        snprintf(text + strlen(text), 96 - strlen(text), "spacing: %.17g m, ", found->spacing_m);
    kn_scene_destroy(bare);
    return true;
}

// Format the new `quality` block of the scene. The caller frees the text. Return NULL when memory is short.
static char *quality_block(const kn_plan *plan, const kn_row *const named[KN_QUALITY_OWN], const char *lattice)
{
    char *text = malloc(BLOCK);
    if (!text) return NULL;
    int n = snprintf(text, BLOCK, "quality:  # by knead tradeoff: time and error of the solver\n");
    if (plan->scene->quality != KN_QUALITY_OWN)
        n += snprintf(text + n, BLOCK - (size_t)n, "  chosen: %s\n", kn_quality_name(plan->scene->quality));
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++) {
        const kn_row *r = named[q];
        const kn_run *run = r->run;
        n += snprintf(text + n, BLOCK - (size_t)n,
                      "  %s: {%siterations: %d, iterations_max: %d, tolerance: %.9g, passes: %d, linearization: %s}"
                      "  # %.0f us, force %.2g %%, shape %.2g %%\n",
                      kn_quality_name(q), lattice, run->iterations, run->iterations_max, run->tolerance, run->passes,
                      kn_method_name(run->method), r->median_us, 100 * r->force.solver, 100 * r->shape.solver);
    }
    return text;
}

// ---- the file

// Return true if text is the planned scene in everything but its quality. Somebody may have edited the file meanwhile.
static bool is_same_scene(const kn_plan *plan, const char *path, const char *text, char *error, size_t error_size)
{
    kn_scene *scene = kn_scene_parse_beside(path, path, text, strlen(text), NULL, 0, error, error_size);
    char *now = scene ? kn_graft(scene->text, "quality", "", error, error_size) : NULL;
    bool same = now && !strcmp(now, plan->text);
    if (now && !same) snprintf(error, error_size, "the scene file was changed meanwhile");
    free(now);
    kn_scene_destroy(scene);
    return same;
}

// Replace the file: write a new file beside it, with its owner and rights, and rename it over the old one. A reader
// sees either the old scene or the new one.
static bool replace(const char *path, const char *text)
{
    char half[PATH_MAX];
    struct stat old;
    if (snprintf(half, sizeof half, "%s.XXXXXX", path) >= PATH_MAX || stat(path, &old) != 0) return false;
    const int fd = mkostemp(half, O_CLOEXEC); // creates a file of a name that did not exist before
    FILE *f = fd >= 0 ? fdopen(fd, "w") : NULL;
    if (!f) return false;
    // Only root may set the owner; otherwise the file belongs to the user of the sweep.
    if (fchown(fileno(f), old.st_uid, old.st_gid) != 0) errno = 0;
    bool ok =
        fchmod(fileno(f), old.st_mode & 07777) == 0 && fputs(text, f) >= 0 && fflush(f) == 0 && fsync(fileno(f)) == 0;
    ok = fclose(f) == 0 && ok && rename(half, path) == 0;
    if (!ok) unlink(half);
    return ok;
}

// Report which quality points were written, and which quality points of other lattices or precisions were removed.
static void tell(const kn_plan *plan)
{
    printf("wrote fast, balanced and accurate into %s\n", plan->scene_path);
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++)
        if (plan->scene->point[q].defined && !plan->scene->point[q].live)
            printf("removed the old point %s: it was of another lattice or precision\n", kn_quality_name(q));
}

int kn_points_write(const kn_plan *plan, const kn_row *const named[KN_QUALITY_OWN])
{
    char error[512] = "not enough memory", path[PATH_MAX], lattice[96];
    size_t size;
    if (!realpath(plan->scene_path, path))
        return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", plan->scene_path, strerror(errno));
    unsigned char *bytes = kn_words_load(path, &size, error, sizeof error);
    char *old = bytes ? realloc(bytes, size + 1) : NULL, *block = NULL;
    if (old) old[size] = '\0';
    if (old && own_lattice(plan, lattice, error, sizeof error)) block = quality_block(plan, named, lattice);
    char *text = block ? kn_graft(old, "quality", block, error, sizeof error) : NULL;
    int code = KN_EXIT_OK;
    if (!text || !is_same_scene(plan, path, text, error, sizeof error))
        code = kn_complain("tradeoff", KN_EXIT_USAGE, "--write: %s", error);
    else if (!replace(path, text))
        code = kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s, not written", path, strerror(errno));
    else tell(plan);
    free(text);
    free(block);
    free(old ? old : (char *)bytes);
    return code;
}
