#include "clients/cli/result.h"
#include "clients/cli/commands.h"
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <unistd.h>

static json_t *root;
// Descriptor of the original stdout while printed text goes to /dev/null; -1: --json was not given.
static int terminal = -1;

void kn_result_open(void)
{
    if (root) return;
    root = json_object();
    fflush(stdout);
    terminal = dup(STDOUT_FILENO);
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (nowhere < 0) return;
    dup2(nowhere, STDOUT_FILENO);
    close(nowhere);
}

json_t *kn_result(void) { return root; }

json_t *kn_result_add(const char *list)
{
    json_t *all = json_object_get(root, list), *one = root ? json_object() : NULL;
    // The first object that is added to a list creates the list.
    if (root && !all && json_object_set_new(root, list, all = json_array()) != 0) all = NULL;
    return json_array_append_new(all, one) == 0 ? one : NULL;
}

void kn_result_number(json_t *to, const char *name, double value)
{
    if (to) json_object_set_new(to, name, isfinite(value) ? json_real(value) : json_null());
}

void kn_result_integer(json_t *to, const char *name, int64_t value)
{
    if (to) json_object_set_new(to, name, json_integer(value));
}

void kn_result_bool(json_t *to, const char *name, bool value)
{
    if (to) json_object_set_new(to, name, json_boolean(value));
}

// Set a member to a text. If the text is not UTF-8, as a file name may be, keep at most 255 characters and replace
// every byte above 127 by '?'.
void kn_result_text(json_t *to, const char *name, const char *value)
{
    if (!to || json_object_set_new(to, name, json_string(value)) == 0) return;
    char plain[256];
    size_t n = 0;
    for (; value[n] && n + 1 < sizeof plain; n++) plain[n] = (unsigned char)value[n] < 0x80 ? value[n] : '?';
    plain[n] = '\0';
    json_object_set_new(to, name, json_string(plain));
}

void kn_result_table(const char *list, const kn_table *t)
{
    for (int r = 0, series = -1; root && r < t->rows; r++) {
        // t->start[i] is the first row of series i, so advance to the series that contains this row.
        while (series + 1 < t->series && t->start[series + 1] <= r) series++;
        json_t *row = kn_result_add(list);
        if (series >= 0) kn_result_text(row, "series", t->label[series]);
        for (int c = 0; c < t->width; c++) kn_result_number(row, t->columns[c], t->cell[r * t->width + c]);
    }
}

void kn_result_close(int code)
{
    if (!root) return;
    fflush(stdout);
    if (terminal >= 0) dup2(terminal, STDOUT_FILENO), close(terminal);
    if (code == KN_EXIT_OK || code == KN_EXIT_FAILED) {
        json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
        putchar('\n');
    }
    json_decref(root);
    root = NULL;
}
