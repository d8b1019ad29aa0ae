// Downloads of a page. They are made from the served state, and no name from a page is used as a file name.
#include "clients/web/web.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Find the block of a scene's text that begins with `head` and ends before the next top-level key. Return its length,
// including the last newline, or 0 if there is none.
static size_t block_of(const char *text, const char *head, const char **begin)
{
    *begin = strncmp(text, head, strlen(head)) == 0 ? text : NULL;
    if (!*begin) {
        char after_newline[64];
        snprintf(after_newline, sizeof after_newline, "\n%s", head);
        *begin = strstr(text, after_newline);
        if (!*begin) return 0;
        ++*begin;
    }
    const char *end = strchr(*begin, '\n');
    // Indented lines and comment lines that follow belong to the block.
    while (end && (end[1] == ' ' || end[1] == '#')) end = strchr(end + 1, '\n');
    return end ? (size_t)(end + 1 - *begin) : strlen(*begin);
}

// Make a name safe for a YAML comment. The name came over the bus. Any line break in the name, ASCII or not, would end
// the comment.
static void plain(const char *name, char *to, size_t size)
{
    snprintf(to, size, "%s", name);
    for (; *to; to++)
        if (*to < ' ' || *to > '~') *to = '?';
}

// Make a file of the served material and density, for `material: FILE.yaml`.
static bool material(const kn_web *w, kn_web_file *file)
{
    const char *text = w->live.scene ? w->live.scene->text : NULL, *part, *weight;
    size_t size = text ? block_of(text, "material:", &part) : 0, more = text ? block_of(text, "density:", &weight) : 0;
    if (size == 0 || more == 0) return false;
    char head[256], name[128];
    plain(w->live.scene->name, name, sizeof name);
    int n = snprintf(head, sizeof head,
                     "# As served in %s. In a scene: `material: FILE.yaml`, with this file beside it.\n", name);
    file->type = "application/yaml; charset=utf-8";
    file->size = (size_t)n + size + more;
    file->bytes = malloc(file->size);
    if (!file->bytes) return false;
    memcpy(file->bytes, head, (size_t)n);
    memcpy(file->bytes + n, part, size);
    memcpy(file->bytes + n + size, weight, more);
    return true;
}

static bool scene(const kn_web *w, kn_web_file *file)
{
    file->type = "application/yaml; charset=utf-8";
    file->bytes = w->live.scene ? strdup(w->live.scene->text) : NULL;
    file->size = file->bytes ? strlen(file->bytes) : 0;
    return file->bytes;
}

// Find the path of a recording's file. The CSV file exists only after the recording was verified.
static bool recording(kn_web *w, int number, const char *kind, kn_web_file *file)
{
    const kn_take *one = kn_takes_find(&w->takes, number);
    const bool csv = strcmp(kind, "csv") == 0;
    if (!one || (csv ? !one->csv : strcmp(kind, "lcmlog") != 0)) return false;
    if (csv) file->type = "text/csv; charset=utf-8";
    kn_takes_path(&w->takes, number, kind, file->path);
    return true;
}

bool kn_web_fetch(void *self, const char *name, kn_web_file *file)
{
    kn_web *w = self;
    if (strcmp(name, "material.yaml") == 0) return material(w, file);
    if (strcmp(name, "picture.png") == 0 && w->png_there) {
        file->type = "image/png";
        kn_web_png_path(w, file->path);
        return true;
    }
    // Take only the number of a recording and the kind of a file from the name that the page sent.
    int number;
    char kind[8], end;
    if (sscanf(name, "recording/%6d.%7[a-z]%c", &number, kind, &end) == 2) return recording(w, number, kind, file);
    if (strcmp(name, "scene.yaml") == 0) return scene(w, file);
    return false;
}
