#include "server/store.h"
#include "server/console.h"
#include "core/hash.h"
#include "core/snapshot.h"
#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#define TEMPORARY ".tmp" // name of the temporary file; one name is enough, because the directory is locked
#define ESTOP "estop"    // name of the file that stores an emergency stop
#define SUFFIX ".knead"
#define GENERATION_MAX INT64_C(9000000000000000) // largest generation; a double holds it exactly

// --- the system -----------------------------------------------------------------------------------------------------

static int system_open(int dir, const char *name, int flags, mode_t mode) { return openat(dir, name, flags, mode); }
static int system_rename(int dir, const char *from, const char *to) { return renameat(dir, from, dir, to); }
static int system_unlink(int dir, const char *name) { return unlinkat(dir, name, 0); }
const kn_files kn_files_system = {system_open, read, write, fdatasync, close, system_rename, fsync, system_unlink};

// --- names ----------------------------------------------------------------------------------------------------------

// Return the name without its ending, "dough" for "dough.yaml". Only letters, digits, - and _ are kept, because they
// have no special meaning in a shell.
static void plain_name(const char *scene, char *name, size_t size)
{
    size_t n = 0;
    for (; scene[n] && strcmp(scene + n, ".yaml") != 0 && n + 1 < size; n++)
        name[n] = isalnum((unsigned char)scene[n]) || strchr("-_", scene[n]) ? scene[n] : '_';
    name[n] = '\0';
}

// Put the series of a scene in `series`: the scene's name, and a hash of lattice, material and version.
static void series_of(const kn_scene *scene, const kn_model *model, char *series, size_t size)
{
    char name[sizeof scene->name];
    plain_name(scene->name, name, sizeof name);
    uint64_t hash = kn_hash_bytes(kn_model_hash(model), KN_VERSION, strlen(KN_VERSION));
    snprintf(series, size, "%s.%08" PRIx32, name, (uint32_t)(hash ^ hash >> 32));
}

// Put the scene's name with a hash of 0 in `series`, to find the scene's files with any hash.
static void any_series_of(const kn_scene *scene, char *series, size_t size)
{
    char name[sizeof scene->name];
    plain_name(scene->name, name, sizeof name);
    snprintf(series, size, "%s.%08x", name, 0u);
}

static void file_name(const char *series, int64_t generation, char name[256])
{
    snprintf(name, 256, "%.200s.%08" PRId64 SUFFIX, series, generation);
}

// Return the generation in a file's name. Return 0 if the file belongs to another series. If `any_series` is true, the
// file may belong to any series of the scene.
static int64_t generation_of(const kn_store *s, const char *name, bool any_series)
{
    // if any series is accepted, the last eight characters of the series (the hash) may differ
    size_t same = strlen(s->series) - (any_series ? 8 : 0), at = strlen(s->series);
    char *end;
    if (strncmp(name, s->series, same) != 0 || strlen(name) < at + 2 || name[at] != '.' ||
        !isdigit((unsigned char)name[at + 1]))
        return 0;
    errno = 0;
    long long generation = strtoll(name + at + 1, &end, 10);
    return errno == 0 && generation > 0 && generation <= GENERATION_MAX && strcmp(end, SUFFIX) == 0 ? generation : 0;
}

typedef struct found {
    int64_t generation;
    char name[256];
} found;

static int by_generation(const void *a, const void *b)
{
    int64_t x = ((const found *)a)->generation, y = ((const found *)b)->generation;
    return (x > y) - (x < y);
}

// List the snapshots of the scene, of any series, by ascending generation. The caller owns the list.
static found *list(const kn_store *s, int dir, size_t *count)
{
    found *all = NULL;
    size_t room = *count = 0;
    int fd = openat(dir, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    DIR *stream = fd < 0 ? NULL : fdopendir(fd);
    if (!stream && fd >= 0) close(fd);
    // if memory is short, the list contains only the files found so far
    for (struct dirent *e; stream && (e = readdir(stream));) {
        int64_t generation = generation_of(s, e->d_name, true);
        if (generation == 0) continue;
        if (*count == room) {
            found *more = realloc(all, (room = room ? 2 * room : 32) * sizeof *all);
            if (!more) break;
            all = more;
        }
        all[*count].generation = generation;
        snprintf(all[(*count)++].name, sizeof all->name, "%s", e->d_name);
    }
    if (stream) closedir(stream);
    if (all) qsort(all, *count, sizeof *all, by_generation);
    return all;
}

// --- open -----------------------------------------------------------------------------------------------------------

// Put one line in `error`, and return the exit code `code`.
static int refuse(int code, char *error, size_t size, const char *path, const char *why, const char *expected)
{
    snprintf(error, size, "--state-dir %s: %s, expected %s", path, why, expected);
    return code;
}

// Open, check and lock the directory. If others could write to the directory, they could replace the object.
static int open_directory(kn_store *s, char *error, size_t size)
{
    struct stat what;
    s->dir = open(s->path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (s->dir < 0) return refuse(2, error, size, s->path, strerror(errno), "a directory");
    if (fstat(s->dir, &what) != 0)
        return refuse(3, error, size, s->path, strerror(errno), "a directory whose owner and mode can be read");
    if (what.st_uid != geteuid())
        return refuse(2, error, size, s->path, "owned by another user", "a directory of this user");
    if (faccessat(s->dir, ".", W_OK | X_OK, AT_EACCESS) != 0)
        return refuse(2, error, size, s->path, strerror(errno), "a directory that can be written to");
    if (what.st_mode & S_IWOTH) return refuse(2, error, size, s->path, "writable by everybody", "chmod o-w");
    if (flock(s->dir, LOCK_EX | LOCK_NB) == 0) return 0;
    return refuse(3, error, size, s->path,
                  errno == EWOULDBLOCK ? "another kneadd keeps its state there" : strerror(errno),
                  "a directory that no other kneadd uses");
}

static bool pinned(const kn_store *s, int64_t generation)
{
    bool any = false;
    for (int i = 0; i < KN_STORE_PINS; i++) any |= atomic_load(&s->pin[i]) == generation;
    return any;
}

void kn_store_pin(kn_store *store, int64_t generation)
{
    atomic_store(&store->pin[atomic_fetch_add(&store->pins, 1) % KN_STORE_PINS], generation);
}

// Add the file of a generation to the list of kept files. If the list is full, remove the oldest file that is not
// pinned.
static void keep(kn_store *s, int64_t generation)
{
    char name[256];
    kn_kept_file *kept = s->kept;
    if (s->kept_count == KN_STORE_KEPT) {
        // index of the oldest file that is not pinned; such a file exists, because KN_STORE_PINS is below KN_STORE_KEPT
        int oldest = 0;
        while (pinned(s, kept[oldest].generation)) oldest++;
        file_name(kept[oldest].series, kept[oldest].generation, name);
        s->files->unlink(s->dir, name); // remove the file; if this fails, the next start removes the file
        memmove(kept + oldest, kept + oldest + 1, sizeof *kept * (size_t)(KN_STORE_KEPT - 1 - oldest));
        s->kept_count--;
    }
    kept[s->kept_count].generation = generation;
    memcpy(kept[s->kept_count++].series, s->series, sizeof s->series);
}

// Return whether a file is read-only. The store must not remove a read-only file.
static bool stays(const kn_store *s, const char *name)
{
    struct stat what;
    return fstatat(s->dir, name, &what, AT_SYMLINK_NOFOLLOW) == 0 && !(what.st_mode & S_IWUSR);
}

// Find the files of the series and the highest generation of the scene. Keep at most KN_STORE_KEPT removable files, and
// remove the older ones.
static void take_series(kn_store *s)
{
    size_t count;
    series_of(s->scene, s->model, s->series, sizeof s->series);
    s->text_hash = s->scene->text_hash;
    found *all = list(s, s->dir, &count);
    for (size_t i = 0; i < count; i++) {
        if (generation_of(s, all[i].name, false) && !stays(s, all[i].name)) keep(s, all[i].generation);
        if (all[i].generation > s->generation) s->generation = all[i].generation;
    }
    free(all);
}

int kn_store_open(kn_store *store, const char *path, const kn_scene *scene, const kn_model *model, char *error,
                  size_t error_size)
{
    kn_store *s = store;
    *s = (kn_store){.files = &kn_files_system, .scene = scene, .model = model, .path = path, .dir = -1};
    int code = open_directory(s, error, error_size);
    if (code != 0) return code;
    s->room = kn_saved_size_max(model);
    s->bytes = malloc(s->room);
    if (!s->bytes) return refuse(3, error, error_size, path, "not enough memory for a snapshot", "a smaller object");
    s->files->unlink(s->dir, TEMPORARY); // remove the remains of an interrupted save
    take_series(s);
    return 0;
}

void kn_store_close(kn_store *store)
{
    if (store->dir >= 0) close(store->dir); // closing the directory releases its lock
    free(store->bytes);
    *store = (kn_store){.dir = -1};
}

// --- save -----------------------------------------------------------------------------------------------------------

static bool write_all(const kn_files *f, int fd, const uint8_t *bytes, size_t size)
{
    for (size_t at = 0; at < size;) {
        ssize_t n = f->write(fd, bytes + at, size - at);
        if (n < 0 && errno == EINTR) continue;
        if (n == 0) errno = ENOSPC;
        if (n <= 0) return false;
        at += (size_t)n;
    }
    return true;
}

// Write the temporary file and sync it. Return NULL on success; otherwise return the name of the call that failed, with
// errno set.
static const char *put_file(const kn_store *s, size_t size, bool stays)
{
    const kn_files *f = s->files;
    int fd = f->open(s->dir, TEMPORARY, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC,
                     stays ? 0400 : 0600);
    if (fd < 0) return "open";
    const char *failed = !write_all(f, fd, s->bytes, size) ? "write" : f->sync(fd) != 0 ? "fdatasync" : NULL;
    int why = errno;
    if (f->close(fd) != 0 && !failed) return "close";
    errno = why;
    return failed;
}

// Count the read-only snapshot files of the scene.
static int count_staying(const kn_store *s)
{
    size_t count;
    found *all = list(s, s->dir, &count);
    int staying = 0;
    for (size_t i = 0; i < count; i++) staying += stays(s, all[i].name);
    free(all);
    return staying;
}

bool kn_store_save(kn_store *store, kn_saved *saved, bool stays, char *why, size_t why_size)
{
    kn_store *s = store;
    char name[256];
    if (stays && count_staying(s) >= KN_STORE_STAY)
        return kn_refuse(why, why_size, "%d read-only snapshots exist, which is the limit: remove some of them",
                         KN_STORE_STAY);
    // a setting may have changed the scene, so determine the series again
    s->scene = saved->servo.scene;
    s->model = saved->servo.model;
    if (s->scene->text_hash != s->text_hash) series_of(s->scene, s->model, s->series, sizeof s->series);
    s->text_hash = s->scene->text_hash;
    saved->generation = stays ? (s->generation / KN_STORE_OWN + 1) * KN_STORE_OWN : s->generation + 1;
    if (saved->generation > GENERATION_MAX) return kn_refuse(why, why_size, "no generation number is left");
    file_name(s->series, saved->generation, name);
    // Write the temporary file, rename it, then sync the directory. So the directory holds at least one whole snapshot
    // at every moment.
    size_t size = kn_saved_encode(s->scene, s->model, saved, s->bytes, s->room);
    const char *failed = size == 0 ? "encode" : put_file(s, size, stays);
    bool there = !failed && s->files->rename(s->dir, TEMPORARY, name) == 0;
    if (!failed && !there) failed = "rename";
    if (there && s->files->sync_dir(s->dir) != 0) failed = "fsync of the directory";
    if (failed) snprintf(why, why_size, "%s: %s", failed, size == 0 ? "no room" : strerror(errno));
    if (!there) s->files->unlink(s->dir, TEMPORARY);
    // the save failed, but the file may exist, so do not reuse its number
    else if (failed) s->generation = saved->generation;
    if (failed) return false;
    s->generation = saved->generation;
    if (!stays) keep(s, saved->generation);
    return true;
}

// --- emergency stop -------------------------------------------------------------------------------------------------

bool kn_store_estopped(const kn_store *store)
{
    struct stat what;
    return fstatat(store->dir, ESTOP, &what, AT_SYMLINK_NOFOLLOW) == 0 || errno != ENOENT;
}

// Create the file `estop` and sync it. Return NULL on success; otherwise return the name of the call that failed, with
// errno set.
static const char *put_estop(const kn_store *s)
{
    int fd = s->files->open(s->dir, ESTOP, O_WRONLY | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0600);
    if (fd < 0) return "open";
    const char *failed = s->files->sync(fd) != 0 ? "fdatasync" : NULL;
    int why = errno;
    if (s->files->close(fd) != 0 && !failed) return "close";
    errno = why;
    return failed;
}

bool kn_store_estop(const kn_store *store, bool stands, char *why, size_t why_size)
{
    const kn_store *s = store;
    const char *failed = stands ? put_estop(s) : NULL;
    if (!stands && s->files->unlink(s->dir, ESTOP) != 0 && errno != ENOENT) failed = "unlink";
    if (!failed && s->files->sync_dir(s->dir) != 0) failed = "fsync of the directory";
    if (failed) snprintf(why, why_size, "%s/" ESTOP ": %s: %s", s->path, failed, strerror(errno));
    return !failed;
}

// --- load -----------------------------------------------------------------------------------------------------------

static bool read_all(const kn_files *f, int fd, uint8_t *bytes, size_t size)
{
    for (size_t at = 0; at < size;) {
        ssize_t n = f->read(fd, bytes + at, size - at);
        if (n < 0 && errno == EINTR) continue;
        if (n == 0) errno = EIO; // the file has become shorter while it was read, so report an error
        if (n <= 0) return false;
        at += (size_t)n;
    }
    return true;
}

// Read a regular file. The caller owns the bytes. Links and devices are refused. On failure return NULL and put the
// reason in `why`.
static uint8_t *get_file(const kn_files *f, int dir, const char *name, size_t *size, char *why, size_t why_size)
{
    struct stat what;
    uint8_t *bytes = NULL;
    const char *reason = NULL;
    int fd = f->open(dir, name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0);
    if (fd < 0 || fstat(fd, &what) != 0) reason = strerror(errno);
    else if (!S_ISREG(what.st_mode)) reason = "not a plain file";
    else if (what.st_size < 0 || (uint64_t)what.st_size > KN_SAVED_MAX) reason = "larger than any snapshot";
    else if (!(bytes = malloc((size_t)what.st_size + 1))) reason = "not enough memory";
    else if (!read_all(f, fd, bytes, *size = (size_t)what.st_size)) reason = strerror(errno);
    if (fd >= 0) f->close(fd);
    if (!reason) return bytes;
    snprintf(why, why_size, "%s", reason);
    free(bytes);
    return NULL;
}

// Read and decode one file.
static bool read_saved(const kn_store *s, int dir, const char *name, kn_saved *saved, char *why, size_t why_size)
{
    size_t size = 0;
    uint8_t *bytes = get_file(s->files, dir, name, &size, why, why_size);
    bool fits = bytes && kn_saved_decode(s->scene, s->model, bytes, size, saved, why, why_size);
    free(bytes);
    return fits;
}

void kn_store_settings(const char *path, const kn_scene *scene, kn_settings *settings)
{
    char why[160];
    kn_store s = {.files = &kn_files_system, .scene = scene, .path = path};
    size_t count, size;
    *settings = (kn_settings){0};
    int dir = open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (dir < 0) return;
    // try the files of every series, newest first
    any_series_of(scene, s.series, sizeof s.series);
    found *all = list(&s, dir, &count);
    bool said = false;
    kn_saved head;
    for (size_t i = count; i-- > 0 && !said;) {
        uint8_t *bytes = get_file(s.files, dir, all[i].name, &size, why, sizeof why);
        said = bytes && kn_saved_peek(scene->name, bytes, size, &head);
        if (said) *settings = head.settings;
        free(bytes);
    }
    free(all);
    close(dir);
}

bool kn_store_load(const kn_store *store, int64_t generation, kn_saved *saved, char *name, FILE *told, char *why,
                   size_t why_size)
{
    const kn_servo *servo = &saved->servo;
    kn_store s = {.files = store->files, .scene = servo->scene, .model = servo->model, .path = store->path};
    size_t count;
    // use a local copy of the store, because another thread may be saving
    any_series_of(s.scene, s.series, sizeof s.series);
    found *all = list(&s, store->dir, &count);
    bool fits = false;
    *name = '\0';
    snprintf(why, why_size, "none");
    for (size_t i = count; i-- > 0 && !fits;) {
        if (generation > 0 && all[i].generation != generation) continue;
        fits = read_saved(&s, store->dir, all[i].name, saved, why, why_size);
        snprintf(name, 256, "%s", all[i].name);
        if (!fits && told) fprintf(told, "kneadd: not restored: %s/%s: %s\n", store->path, name, why);
    }
    free(all);
    return fits;
}

// Pass a snapshot to the caller's function `look`.
static bool show(const kn_saved *saved, kn_store_look look, void *look_arg, char *why, size_t why_size)
{
    bool said = look(look_arg, saved);
    if (!said) snprintf(why, why_size, "another state");
    return said;
}

bool kn_store_browse(const char *path, const kn_scene *scene, const kn_model *model, kn_saved *saved,
                     kn_store_look look, void *look_arg, char *why, size_t why_size)
{
    kn_store s = {.files = &kn_files_system, .scene = scene, .model = model, .path = path};
    snprintf(why, why_size, "holds no snapshot of %s", scene->name);
    series_of(scene, model, s.series, sizeof s.series);
    // a path that is not a directory is one snapshot file
    int dir = open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (dir < 0)
        return read_saved(&s, AT_FDCWD, path, saved, why, why_size) && show(saved, look, look_arg, why, why_size);
    size_t count;
    found *all = list(&s, dir, &count);
    bool said = false;
    for (size_t i = 0; i < count && !said; i++)
        said = read_saved(&s, dir, all[i].name, saved, why, why_size) && show(saved, look, look_arg, why, why_size);
    free(all);
    close(dir);
    return said;
}
