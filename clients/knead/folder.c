#include "clients/knead/folder.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

static const char prefix[] = "knead-sweep-", temporary[] = "temporary\n";

const char *kn_folder_path(const kn_folder *f, const char *name, const char *ending, char path[PATH_MAX])
{
    if (snprintf(path, PATH_MAX, "%s/%s%s", f->path, name, ending) >= PATH_MAX) *path = '\0';
    return path;
}

// Remove the folder of the sweep and the files in it.
static void remove_folder(const kn_folder *f)
{
    char path[PATH_MAX];
    DIR *d = opendir(f->path);
    for (struct dirent *e; d && (e = readdir(d));) {
        if (e->d_name[0] == '.' || unlink(kn_folder_path(f, e->d_name, "", path)) == 0) continue;
        // If the entry is an empty folder, remove it. GNU parallel leaves such folders if this machine is one of
        // several hosts.
        rmdir(path);
    }
    if (d) closedir(d);
    rmdir(f->path);
}

// ---- leftovers of killed sweeps

// Return true if the folder was left behind by a killed sweep of this user.
static bool is_left(const kn_folder *f)
{
    char path[PATH_MAX], text[200];
    struct stat here;
    if (lstat(f->path, &here) != 0 || !S_ISDIR(here.st_mode) || here.st_uid != geteuid()) return false;
    // Do not follow symbolic links, because every user can write to the parent folder (/tmp).
    int file = open(kn_folder_path(f, "sweep", "", path), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    if (file < 0) return false;
    // If a sweep that is still running holds the lock, the folder is not a leftover.
    ssize_t size = flock(file, LOCK_EX | LOCK_NB) == 0 ? read(file, text, sizeof text) : -1;
    size_t end = sizeof temporary - 1;
    bool left = size > (ssize_t)end && !memcmp(text + size - end, temporary, end);
    close(file);
    return left;
}

// Remove the folders that killed sweeps have left behind in the folder for temporary files.
static void remove_leftovers(const char *parent)
{
    DIR *d = opendir(parent);
    for (struct dirent *e; d && (e = readdir(d));) {
        kn_folder f = {.lock = -1};
        if (strncmp(e->d_name, prefix, sizeof prefix - 1) != 0) continue;
        if (snprintf(f.path, sizeof f.path, "%s/%s", parent, e->d_name) < PATH_MAX && is_left(&f)) remove_folder(&f);
    }
    if (d) closedir(d);
}

// ---- this sweep's folder

// Create a temporary folder, or create or find the folder that --resume names.
static int make(kn_folder *f, const char *resume)
{
    const char *parent = getenv("TMPDIR");
    if (!parent || !*parent) parent = "/tmp";
    f->temporary = !resume;
    if (resume) {
        if ((mkdir(resume, 0777) == 0 || errno == EEXIST) && realpath(resume, f->path)) return KN_EXIT_OK;
        int why = errno;
        f->path[0] = '\0';
        return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s, expected a folder to keep the runs in", resume,
                           strerror(why));
    }
    remove_leftovers(parent);
    snprintf(f->path, sizeof f->path, "%s/%sXXXXXX", parent, prefix);
    if (mkdtemp(f->path)) return KN_EXIT_OK;
    int code = kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s, expected a folder for temporary files", f->path,
                           strerror(errno));
    f->path[0] = '\0';
    return code;
}

static bool is_empty(const char *folder)
{
    DIR *d = opendir(folder);
    bool empty = d;
    for (struct dirent *e; d && (e = readdir(d));) empty &= !strcmp(e->d_name, ".") || !strcmp(e->d_name, "..");
    if (d) closedir(d);
    return empty;
}

// Return the name of the part (program, scene or log) that differs from the earlier sweep in this folder, or "kind" if
// the file is not that of a sweep. Return NULL if the earlier sweep can be resumed.
static const char *compare(const uint64_t now[3], const char *text)
{
    static const char *const what[] = {"program", "scene", "log"};
    unsigned long long then[3];
    if (sscanf(text, "knead sweep 1\nprogram %llx\nscene %llx\nlog %llx\n", &then[0], &then[1], &then[2]) != 3)
        return "kind";
    for (int i = 0; i < 3; i++)
        if (then[i] != now[i]) return what[i];
    return NULL;
}

// Open the file `sweep` in the folder and lock it. Without the lock, two sweeps in the same folder would each replay
// every run.
int kn_folder_open(kn_folder *f, const char *resume, const uint64_t now[3])
{
    char path[PATH_MAX], text[200] = "";
    f->lock = -1;
    int code = make(f, resume);
    if (code != KN_EXIT_OK) return code;
    bool fresh = is_empty(f->path);
    // Refuse a folder with files that no sweep has made, because such files must not be changed.
    if (!fresh && access(kn_folder_path(f, "sweep", "", path), F_OK) != 0)
        return kn_complain("tradeoff", KN_EXIT_USAGE,
                           "%s: is not a folder of knead tradeoff --resume, expected such a folder or an empty one",
                           f->path);
    f->lock = open(kn_folder_path(f, "sweep", "", path), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (f->lock < 0 || flock(f->lock, LOCK_EX | LOCK_NB) != 0)
        return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", path,
                           errno == EWOULDBLOCK ? "another sweep is running in this folder" : strerror(errno));
    ssize_t size = pread(f->lock, text, sizeof text - 1, 0);
    const char *other = size > 0 ? compare(now, text) : NULL;
    if (other)
        return kn_complain(
            "tradeoff", KN_EXIT_USAGE,
            "%s: its runs are of another %s, expected the same program, scene and log, or an empty folder", f->path,
            other);
    int length = snprintf(text, sizeof text, "knead sweep 1\nprogram %llx\nscene %llx\nlog %llx\n%s",
                          (unsigned long long)now[0], (unsigned long long)now[1], (unsigned long long)now[2],
                          // If --resume names a leftover of a killed sweep, the folder is no longer temporary.
                          f->temporary ? temporary : "");
    if (pwrite(f->lock, text, (size_t)length, 0) == length && ftruncate(f->lock, length) == 0) return KN_EXIT_OK;
    return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", path, strerror(errno));
}

void kn_folder_close(kn_folder *f)
{
    if (f->temporary && f->path[0]) remove_folder(f);
    if (f->lock >= 0) close(f->lock);
    f->lock = -1;
    f->path[0] = '\0';
}
