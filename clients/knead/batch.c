// knead batch: plays a list of knead commands and writes one table of their results. Each command is a job (cli/jobs.h)
// with --json. Its result is a file. The first line is a hash of the rest, so that a damaged file is noticed. The name is a
// hash of the program, the words and the files, so that no result of other inputs is taken.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/curve_table.h"
#include "clients/cli/jobs.h"
#include "clients/cli/result.h"
#include "clients/sweep/replay_trace.h"
#include "core/hash.h"
#include "core/scene/mesh_file.h"
#include "core/scene/scene.h"
#include "server/scene_name.h"
#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <wordexp.h>

#define LINE_MAX_BYTES 100000 // Linux limits one word of a command to 131071 bytes
#define ITEMS_MAX 16          // a longer list of a JSON object, such as a curve, is left out of the table

static const char help[] =
    "usage: knead batch LIST --out TABLE.csv [OPTION]...\n\n"
    "Play a list of knead commands and write one table of their results: one row per line, in the order of the list.\n"
    "LIST is a file, or - for the standard input. A line has the words of one command without `knead`, quoted as in a\n"
    "shell. Empty lines and lines that begin with # are left out. Each command is run with --json, and all lines are\n"
    "checked before the first one is run. Scenes x materials x paths are loops of the shell.\n\n"
    "The columns are the line, its exit code, its message if it failed, and the numbers and words of its JSON object:\n"
    "the member `stress_pa` of the first object in the list `loads` is in the column `loads.0.stress_pa`. A list of\n"
    "more than 16 entries, such as a curve, is left out. A cell is empty where a line has no such member.\n"
    "Each finished run is kept in the folder TABLE.csv.runs until the table is written. So the same command continues\n"
    "after an interruption. A line is played again if knead, the line, or a file or scene in it has changed.\n\n"
    "options:\n"
    "  --out TABLE.csv    the table\n" KN_JOBS_HELP
    "  --send FILE        with --hosts: also send this file, such as the mesh of a scene. The files that the lines\n"
    "                     name are sent in any case. All of them have to be in this folder or below. Files that\n"
    "                     a command writes stay on the host, and only its row returns\n\n"
    "Examples:\n"
    "    for m in dough clay; do for g in 20 50; do echo creep $m --load ${g}gf; done; done >list\n"
    "    knead batch list --out creep.csv --jobs 2\n"
    "    sed 's/creep/tpa/; s/ --load.*//' list | knead batch - --out tpa.csv\n\n"
    "Exit codes: 0 all lines ended with 0, 1 at least one did not, 2 bad input, 3 a run has no result, or a file or\n"
    "the engine failed.\n";

typedef struct batch {
    const char *out;
    kn_jobs_engine engine;
    const char *sends[64]; // files of --send
    int send_count;
    const char *list; // name of the list in messages
    json_t *rows;     // list of one object per line: `line`: its text, `number`, `result`: name of its result
    uint64_t origin;  // hash of this program and the files of --send
    kn_jobs jobs;
} batch;

// ---- a run

// Run a command with --json, and another option if it is not NULL, in a new process. Return an object with the exit
// code, the last line of stderr as the message, and the members of the JSON object that the command prints. The code is
// 128 + n after a signal n, and -1 if there is no process.
static json_t *run(int argc, char *const *argv, const char *option)
{
    char message[500] = "", next[500];
    FILE *out = tmpfile(), *err = tmpfile();
    char **all = calloc((size_t)argc + 4, sizeof *all);
    int status = 0;
    json_t *row = json_object();
    fflush(NULL);
    pid_t child = out && err && all ? fork() : -1;
    if (child == 0) {
        kn_jobs_begin();
        kn_interrupt_unwatch();
        all[0] = (char *)"knead";
        memcpy(all + 1, argv, (size_t)argc * sizeof *all);
        all[1 + argc] = (char *)"--json";
        all[2 + argc] = (char *)option;
        dup2(fileno(out), STDOUT_FILENO);
        dup2(fileno(err), STDERR_FILENO);
        int code = kn_command_run(argc + (option ? 3 : 2), all);
        kn_result_close(code);
        _exit(fflush(stdout) == 0 ? code : KN_EXIT_DEVICE);
    }
    while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) continue;
    const bool died = WIFSIGNALED(status);
    kn_result_integer(row, "exit", child < 0 ? -1 : died ? 128 + WTERMSIG(status) : WEXITSTATUS(status));
    if (child > 0) {
        rewind(out);
        rewind(err);
        while (fgets(next, sizeof next, err)) snprintf(message, sizeof message, "%.*s", (int)strcspn(next, "\n"), next);
        kn_result_text(row, "message", died ? strsignal(WTERMSIG(status)) : status ? message : "");
        // With another code than 0 and 1 nothing is printed.
        json_t *result = json_loadf(out, 0, NULL);
        json_object_update_missing(row, result);
        json_decref(result);
    }
    if (out) fclose(out);
    if (err) fclose(err);
    free(all);
    return row;
}

static int exit_of(const json_t *row) { return (int)json_integer_value(json_object_get(row, "exit")); }

static const char *message_of(const json_t *row) { return json_string_value(json_object_get(row, "message")); }

// Play one line in the process of a job, and write its result.
static int play(const char *path, int argc, char **argv)
{
    kn_beside file;
    kn_jobs_begin();
    json_t *row = run(argc, argv, NULL);
    // These signals come from outside: somebody, or an engine, ended this run. So it has no result.
    static const char outside[] = {SIGINT, SIGTERM, SIGHUP, SIGKILL};
    const int code = exit_of(row);
    if (code < 0 || (code > 128 && memchr(outside, code - 128, sizeof outside)))
        return kn_complain("batch", KN_EXIT_DEVICE, "%s: %s", argv[0], code < 0 ? "cannot be run" : message_of(row));
    char *text = json_dumps(row, JSON_COMPACT | JSON_REAL_PRECISION(12));
    if (!text) return kn_complain("batch", KN_EXIT_INTERNAL, "out of memory");
    if (!kn_output_open(&file, "batch", path)) return KN_EXIT_DEVICE;
    fprintf(file.file, "%016" PRIx64 "\n%s", kn_hash_bytes(KN_HASH_SEED, text, strlen(text)), text);
    return kn_output_close(&file, "batch");
}

// Load a result. Return NULL if it is missing or damaged.
static json_t *load(const batch *b, const char *result)
{
    char path[PATH_MAX], error[PATH_MAX];
    size_t size = 0;
    uint64_t hash;
    char *text = (char *)kn_words_load(kn_jobs_path(&b->jobs, result, path), &size, error, sizeof error);
    bool whole = text && size > 17 && sscanf(text, "%16" SCNx64 "\n", &hash) == 1 &&
                 hash == kn_hash_bytes(KN_HASH_SEED, text + 17, size - 17);
    json_t *row = whole ? json_loadb(text + 17, size - 17, 0, NULL) : NULL;
    free(text);
    return row;
}

// ---- the list

static const char elsewhere[] = "--hosts: expected only files in this folder or below";

// Print a message on a line of the list.
static int refuse(const batch *b, int number, const char *what)
{
    return kn_complain("batch", KN_EXIT_USAGE, "%s:%d:1: %s", b->list, number, what);
}

// If a word of a line, or what follows its first '=', is a file, add its size and time of change to `hash`, and send the
// file to the hosts. If it is a scene, or the name of one, add the scene with its meshes. Return false if a file cannot be
// sent.
static bool take_file(batch *b, const char *word, uint64_t *hash)
{
    const char *value = strchr(word, '='), *path = value ? value + 1 : word, *named;
    char home[PATH_MAX], whole[2 * PATH_MAX], error[PATH_MAX];
    struct stat file;
    kn_scene *scene = kn_scene_take(&named, path) ? NULL : kn_scene_load(named, NULL, 0, error, sizeof error);
    if (scene) *hash = kn_hash_bytes(*hash, &scene->text_hash, sizeof scene->text_hash);
    kn_scene_destroy(scene);
    if (stat(path, &file) != 0 || !S_ISREG(file.st_mode)) return true;
    const int64_t state[] = {file.st_size, file.st_mtim.tv_sec, file.st_mtim.tv_nsec};
    *hash = kn_hash_bytes(*hash, state, sizeof state);
    snprintf(whole, sizeof whole, "%s/./%s", getcwd(home, sizeof home) ? home : "", path);
    kn_jobs_send(&b->jobs, whole);
    return !b->engine.hosts || (*path != '/' && !strstr(path, ".."));
}

// Check the words of a line, name its result and add its job if there is no result yet.
static int take_words(batch *b, const char *text, int number, int count, char *const *words)
{
    char name[17];
    uint64_t hash = b->origin;
    if (count == 0 || !isalpha((unsigned char)*words[0])) return refuse(b, number, "expected a knead command");
    // The command with --json and --help must end with 0: then it has --json, and its other options are right.
    json_t *answer = run(count, words, "--help");
    int code = exit_of(answer) == 0 ? KN_EXIT_OK
                                    : refuse(b, number, exit_of(answer) > 0 ? message_of(answer) : "cannot be checked");
    json_decref(answer);
    for (int i = 0; i < count && code == KN_EXIT_OK; i++) {
        hash = kn_hash_bytes(hash, words[i], strlen(words[i]) + 1);
        if (!take_file(b, words[i], &hash)) code = refuse(b, number, elsewhere);
    }
    if (code != KN_EXIT_OK) return code;
    snprintf(name, sizeof name, "%016" PRIx64, hash);
    json_t *row = json_object(), *known = load(b, name);
    kn_result_text(row, "line", text);
    kn_result_integer(row, "number", number);
    kn_result_text(row, "result", name);
    json_array_append_new(b->rows, row);
    // A device or a transport may work the next time.
    if (!known || exit_of(known) == KN_EXIT_DEVICE) kn_jobs_add(&b->jobs, name, count, words);
    json_decref(known);
    return KN_EXIT_OK;
}

// Read the list and add its jobs.
static int read_list(batch *b, const char *path)
{
    char *text = NULL;
    size_t size = 0;
    ssize_t length;
    int code = KN_EXIT_OK;
    FILE *f = strcmp(path, "-") ? fopen(path, "re") : stdin;
    if (!f)
        return kn_complain("batch", KN_EXIT_USAGE, "%s: %s, expected a list of knead commands", path, strerror(errno));
    errno = 0;
    for (int number = 1; code == KN_EXIT_OK && !kn_interrupted && (length = getline(&text, &size, f)) > 0; number++) {
        wordexp_t words;
        bool plain = length <= LINE_MAX_BYTES && strlen(text) == (size_t)length;
        text[strcspn(text, "\r\n")] = '\0';
        if (plain && strchr("#", text[strspn(text, " \t")])) continue; // also the end of the text
        if (!plain) code = refuse(b, number, "expected at most 100000 bytes, none of them 0");
        else if (wordexp(text, &words, WRDE_NOCMD | WRDE_UNDEF) != 0)
            code = refuse(
                b, number,
                "expected words as in a shell: quotes in pairs, | & ; < > ( ) { } ` only in quotes, no unset $NAME");
        else {
            code = take_words(b, text, number, (int)words.we_wordc, words.we_wordv);
            wordfree(&words);
        }
    }
    if (kn_interrupted) code = KN_EXIT_DEVICE;
    if (code == KN_EXIT_OK && ferror(f)) code = kn_complain("batch", KN_EXIT_USAGE, "%s: %s", path, strerror(errno));
    if (f != stdin) fclose(f);
    free(text);
    if (code != KN_EXIT_OK || json_array_size(b->rows) > 0) return code;
    return kn_complain("batch", KN_EXIT_USAGE, "%s: has no command, expected one per line", b->list);
}

// ---- the table

// Copy the numbers and words of a JSON value into the flat object `row`, under their path. `columns` gets all paths.
static void flatten(json_t *row, json_t *columns, const char *path, json_t *value)
{
    char name[500];
    const char *key, *dot = *path ? "." : "";
    json_t *part;
    if (json_is_object(value)) {
        json_object_foreach(value, key, part)
        {
            snprintf(name, sizeof name, "%s%s%s", path, dot, key);
            flatten(row, columns, name, part);
        }
    } else if (!json_is_array(value)) {
        json_object_set(row, path, value);
        json_object_set_new(columns, path, json_null());
    }
    for (size_t i = 0; i < json_array_size(value) && json_array_size(value) <= ITEMS_MAX; i++) {
        snprintf(name, sizeof name, "%s%s%zu", path, dot, i);
        flatten(row, columns, name, json_array_get(value, i));
    }
}

static void put_cell(FILE *f, const json_t *value)
{
    if (json_is_string(value)) kn_table_text(json_string_value(value), f);
    else if (value && !json_is_null(value)) json_dumpf(value, f, JSON_ENCODE_ANY | JSON_REAL_PRECISION(12));
}

static int write_table(const batch *b, json_t *columns, json_t *flat)
{
    kn_beside out;
    const char *name;
    json_t *row, *unused;
    size_t i;
    FILE *f = kn_output_open(&out, "batch", b->out);
    if (!f) return KN_EXIT_DEVICE;
    fputs("line", f);
    json_object_foreach(columns, name, unused) fprintf(f, ",%s", name);
    json_array_foreach(flat, i, row)
    {
        fputc('\n', f);
        put_cell(f, json_object_get(json_array_get(b->rows, i), "line"));
        json_object_foreach(columns, name, unused) fputc(',', f), put_cell(f, json_object_get(row, name));
    }
    fputc('\n', f);
    return kn_output_close(&out, "batch");
}

// Load all results and write the table. Return KN_EXIT_FAILED if a line has failed, and print the first one.
static int report(const batch *b)
{
    int code = KN_EXIT_OK, failed = 0;
    char first[700];
    json_t *columns = json_object(), *flat = json_array(), *line;
    size_t i;
    json_array_foreach(b->rows, i, line)
    {
        const char *name = json_string_value(json_object_get(line, "result"));
        json_t *row = load(b, name), *cells = json_object();
        if (!row) code = kn_complain("batch", KN_EXIT_DEVICE, "%s/%s: is damaged", b->jobs.folder, name);
        if (!row) break;
        if (exit_of(row) != 0 && failed++ == 0)
            snprintf(first, sizeof first, "%s:%d:1: exit %d %s", b->list,
                     (int)json_integer_value(json_object_get(line, "number")), exit_of(row), message_of(row));
        flatten(cells, columns, "", row);
        json_array_append_new(flat, cells);
        json_decref(row);
    }
    if (code == KN_EXIT_OK) code = write_table(b, columns, flat);
    if (code == KN_EXIT_OK)
        printf("wrote %s: %zu rows, %zu columns\n", b->out, json_array_size(flat), json_object_size(columns) + 1);
    json_decref(columns);
    json_decref(flat);
    if (code != KN_EXIT_OK || !failed) return code;
    return kn_complain("batch", KN_EXIT_FAILED, "%d of %zu runs failed; the first is %s", failed,
                       json_array_size(b->rows), first);
}

// Read the list, play the runs in the folder beside the table, and write the table.
static int play_all(batch *b, const char *list)
{
    char home[PATH_MAX], folder[PATH_MAX];
    b->list = strcmp(list, "-") ? list : "standard input";
    b->jobs = (kn_jobs){.command = "batch", .engine = b->engine, .hint = "repeat the command to play them"};
    if (kn_output_same(b->out, list))
        return kn_complain("batch", KN_EXIT_USAGE, "%s: is being read, expected another file to write", list);
    int code = kn_output_try("batch", b->out);
    if (code != KN_EXIT_OK) return code;
    if (!kn_replay_trace_hash("/proc/self/exe", &b->origin) || !getcwd(home, sizeof home))
        return kn_complain("batch", KN_EXIT_DEVICE, "/proc/self/exe: %s", strerror(errno));
    snprintf(folder, sizeof folder, "%s.runs", b->out);
    b->rows = json_array();
    code = kn_jobs_open(&b->jobs, folder, home);
    for (int i = 0; i < b->send_count && code == KN_EXIT_OK; i++)
        if (access(b->sends[i], R_OK) != 0 || !take_file(b, b->sends[i], &b->origin))
            code =
                kn_complain("batch", KN_EXIT_USAGE, "--send %s: expected a file in this folder or below", b->sends[i]);
    if (code == KN_EXIT_OK) code = read_list(b, list);
    const size_t lines = json_array_size(b->rows);
    if (code == KN_EXIT_OK)
        printf("runs       %zu, of which %zu were kept from before\n", lines, lines - (size_t)b->jobs.count);
    fflush(stdout);
    // The folder of a list that is refused is removed, unless it has results of an earlier call.
    b->jobs.temporary = code != KN_EXIT_OK && b->jobs.fresh;
    if (code == KN_EXIT_OK) {
        code = kn_jobs_play(&b->jobs);
        if (code == KN_EXIT_OK) code = report(b);
        b->jobs.temporary = code == KN_EXIT_OK || code == KN_EXIT_FAILED;
    }
    json_decref(b->rows);
    kn_jobs_close(&b->jobs);
    return code;
}

int kn_batch_main(int argc, char **argv)
{
    static const kn_option rows[] = {
        KN_OPTION("out", TEXT, .offset = offsetof(batch, out), .expected = "a file"),
        KN_JOBS_OPTIONS(batch),
        KN_OPTION("send", LIST, .offset = offsetof(batch, sends), .count = offsetof(batch, send_count), .most = 64,
                  .expected = "at most 64 of them"),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    // An engine runs this program for a single line.
    if (argc > 3 && !strcmp(argv[1], "--job")) return play(argv[2], argc - 3, argv + 3);
    batch b = {0};
    int code = kn_options_read(&table, &b, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (argc - optind == 1 && b.out) return play_all(&b, argv[optind]);
    return kn_complain("batch", KN_EXIT_USAGE, "expected LIST --out TABLE.csv; see knead batch --help");
}
