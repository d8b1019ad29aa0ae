#include "clients/report/report_page.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include <errno.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

extern const char report_css[]; // text of report_page.css, which is linked into the program
__asm__(".section .rodata\nreport_css: .incbin \"" KN_CLIENTS_DIR "/report/report_page.css\"\n.byte 0\n.previous\n");

bool kn_document_is_open(const kn_document *d) { return d->body; }

// ---- text as HTML

// Return the length of the UTF-8 character at p, or 0 if its bytes are invalid.
static int utf8_length(const unsigned char *p)
{
    const int n = *p < 0x80                 ? 1
                  : *p >= 0xc2 && *p < 0xe0 ? 2
                  : *p >= 0xe0 && *p < 0xf0 ? 3
                  : *p >= 0xf0 && *p < 0xf5 ? 4
                                            : 0;
    for (int i = 1; i < n; i++)
        if ((p[i] & 0xc0) != 0x80) return 0;
    return n;
}

// Write text as HTML: escape special characters, and replace invalid bytes and control characters.
static void put(FILE *out, const char *text, size_t length)
{
    const unsigned char *p = (const unsigned char *)text, *end = p + length;
    for (int n; p < end; p += n) {
        n = utf8_length(p);
        if (*p == '&') fputs("&amp;", out);
        else if (*p == '<') fputs("&lt;", out);
        else if (*p == '"') fputs("&quot;", out);
        else if (n == 0 || p + n > end || (*p < ' ' && *p != '\n')) fputs("\xef\xbf\xbd", out);
        else fwrite(p, 1, (size_t)n, out);
        if (n == 0) n = 1;
    }
}

static void put_all(FILE *out, const char *text) { put(out, text, strlen(text)); }

static void end_table(kn_document *d)
{
    if (d->in_table) fputs("</tbody></table></div>\n", d->body);
    d->in_table = false;
}

// ---- parts of the page

// If an interrupt signal has arrived, remove the unfinished folder and end the program.
static void give_way(kn_document *d)
{
    if (!kn_interrupted) return;
    kn_output_folder_drop(&d->batch);
    kn_interrupt_die();
}

void kn_document_section(kn_document *d, const char *heading)
{
    if (!kn_document_is_open(d)) return;
    give_way(d);
    end_table(d);
    if (d->sections) fputs("</section>\n", d->body);
    fprintf(d->body, "<section aria-labelledby=\"s%d\">\n<h2 id=\"s%d\">", d->sections, d->sections);
    put_all(d->body, heading);
    fputs("</h2>\n", d->body);
    if (d->sections < 24) snprintf(d->heading[d->sections], sizeof d->heading[0], "%s", heading);
    d->sections++;
}

static void put_formatted(FILE *out, const char *format, va_list args)
{
    char *text = NULL;
    if (vasprintf(&text, format, args) < 0) return;
    put_all(out, text);
    free(text);
}

void kn_document_text(kn_document *d, const char *format, ...)
{
    if (!kn_document_is_open(d)) return;
    va_list args;
    end_table(d);
    fputs("<p>", d->body);
    va_start(args, format);
    put_formatted(d->body, format, args);
    va_end(args);
    fputs("</p>\n", d->body);
}

void kn_document_verdict(kn_document *d, kn_document_mood mood, const char *format, ...)
{
    static const char *const names[] = {"holds", "beware", "fails"}, *const words[] = {"Holds.", "Beware.",
                                                                                       "Does not hold."};
    if (!kn_document_is_open(d)) return;
    va_list args;
    end_table(d);
    fprintf(d->body, "<p class=\"verdict %s\"><strong>%s</strong> ", names[mood], words[mood]);
    va_start(args, format);
    put_formatted(d->body, format, args);
    va_end(args);
    fputs("</p>\n", d->body);
}

// Write one cell of a table. Cells of the head row and the first cell of each row are header cells.
static void put_cell(FILE *out, const char *text, size_t length, char column, bool head, bool first)
{
    const char *tag = head || first ? "th" : "td";
    fprintf(out, "<%s", tag);
    if (head || first) fprintf(out, " scope=\"%s\"", head ? "col" : "row");
    if (column != 'l') fprintf(out, " class=\"%c\"", column);
    fputc('>', out);
    put(out, text, length);
    fprintf(out, "</%s>", tag);
}

// Write one row of a table. Tabs separate its cells. The first cell of a row in the body is the row's name.
static void put_cells(kn_document *d, const char *text, bool head)
{
    const size_t columns = strlen(d->columns);
    fputs("<tr>", d->body);
    for (size_t i = 0; i < columns; i++) {
        const size_t length = strcspn(text, "\t");
        put_cell(d->body, text, length, d->columns[i], head, i == 0);
        text += length + (text[length] == '\t');
    }
    fputs("</tr>\n", d->body);
}

void kn_document_table(kn_document *d, const char *caption, const char *columns, const char *head)
{
    if (!kn_document_is_open(d)) return;
    end_table(d);
    snprintf(d->columns, sizeof d->columns, "%s", columns);
    fputs("<div class=\"scroll\" role=\"region\" tabindex=\"0\" aria-label=\"", d->body);
    put_all(d->body, caption);
    fputs("\"><table><caption>", d->body);
    put_all(d->body, caption);
    fputs("</caption>\n<thead>", d->body);
    put_cells(d, head, true);
    fputs("</thead><tbody>\n", d->body);
    d->in_table = true;
}

void kn_document_row(kn_document *d, const char *format, ...)
{
    char *text = NULL;
    va_list args;
    if (!kn_document_is_open(d) || !d->in_table) return;
    va_start(args, format);
    if (vasprintf(&text, format, args) >= 0) put_cells(d, text, false);
    va_end(args);
    free(text);
}

const char *kn_document_file(const kn_document *d, const char *name, char path[PATH_MAX])
{
    *path = '\0';
    if (kn_document_is_open(d)) snprintf(path, PATH_MAX, "%s/%s", d->batch.folder, name);
    return path;
}

// Read width and height from a PNG's first chunk. The page states width and height, so that the layout does not move
// when the picture has loaded.
static bool size_of(const kn_document *d, const char *name, unsigned size[2])
{
    char path[PATH_MAX];
    unsigned char head[24];
    FILE *in = fopen(kn_document_file(d, name, path), "rb");
    if (!in) return false;
    const bool ok = fread(head, 1, sizeof head, in) == sizeof head && !memcmp(head, "\x89PNG\r\n\x1a\n", 8);
    fclose(in);
    for (int i = 0; ok && i < 2; i++) {
        const unsigned char *b = head + 16 + 4 * i;
        size[i] = (unsigned)b[0] << 24 | (unsigned)b[1] << 16 | (unsigned)b[2] << 8 | b[3];
    }
    return ok;
}

void kn_document_picture(kn_document *d, const char *name, const char *alt, const char *caption)
{
    unsigned size[2];
    if (!kn_document_is_open(d)) return;
    end_table(d);
    if (!size_of(d, name, size)) {
        kn_document_text(d, "%s was not drawn.", name);
        return;
    }
    fprintf(d->body, "<figure><img src=\"%s\" width=\"%u\" height=\"%u\" alt=\"", name, size[0], size[1]);
    put_all(d->body, alt);
    fputs("\"><figcaption>", d->body);
    put_all(d->body, caption);
    fputs("</figcaption></figure>\n", d->body);
}

void kn_document_link(kn_document *d, const char *name, const char *words)
{
    if (!kn_document_is_open(d)) return;
    end_table(d);
    fprintf(d->body, "<p><a href=\"%s\">%s</a>: ", name, name);
    put_all(d->body, words);
    fputs("</p>\n", d->body);
}

// ---- the folder of the report

static void append(kn_document *d, const char *text)
{
    const size_t n = strlen(d->command);
    snprintf(d->command + n, sizeof d->command - n, "%s", text);
}

// Store the command line, quoted so that a shell accepts it.
static void remember(kn_document *d, int argc, char *const *argv)
{
    for (int i = 0; i < argc; i++) {
        const bool plain =
            // argv[0] has several words ("knead identify ..."), so the blanks between them must not be quoted
            i == 0 || !argv[i][strcspn(argv[i], " \t()[]*?'\"$&;|<>#^")];
        if (i) append(d, " ");
        if (!plain) append(d, "'");
        for (const char *p = argv[i]; *p; p++) append(d, *p == '\'' && !plain ? "'\\''" : (const char[]){*p, '\0'});
        if (!plain) append(d, "'");
    }
}

int kn_document_open(kn_document *d, const char *subcommand, const char *folder, const char *title, int argc,
                     char *const *argv)
{
    char error[PATH_MAX];
    bool taken;
    memset(d, 0, sizeof *d);
    if (!folder) return KN_EXIT_OK;
    d->subcommand = subcommand;
    snprintf(d->title, sizeof d->title, "%s", title);
    remember(d, argc, argv);
    kn_interrupt_watch(); // from now on an interrupt must remove the folder
    if (!kn_output_folder_open(&d->batch, folder, &taken, error, sizeof error))
        return kn_complain(subcommand, taken ? KN_EXIT_USAGE : KN_EXIT_DEVICE, "%s", error);
    if ((d->body = open_memstream(&d->text, &d->size))) return KN_EXIT_OK;
    kn_output_folder_drop(&d->batch);
    return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
}

// Write the table of contents, if there are at least three sections.
static void put_contents(const kn_document *d, FILE *out)
{
    if (d->sections < 3) return;
    fputs("<nav aria-label=\"Contents\"><ul>\n", out);
    for (int i = 0; i < d->sections && i < 24; i++) {
        fprintf(out, "<li><a href=\"#s%d\">", i);
        put_all(out, d->heading[i]);
        fputs("</a></li>\n", out);
    }
    fputs("</ul></nav>\n", out);
}

// Write the page: head, command line, contents and the collected body.
static bool put_page(const kn_document *d, FILE *out)
{
    fputs("<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" "
          "content=\"width=device-width, initial-scale=1\">\n<meta name=\"color-scheme\" content=\"light "
          "dark\">\n<title>",
          out);
    put_all(out, d->title);
    fprintf(out, "</title>\n<style>\n%s</style>\n</head>\n<body>\n<main>\n<h1>", report_css);
    put_all(out, d->title);
    fputs("</h1>\n<p class=\"made\">", out);
    if (*d->command) {
        fputs("<code>", out);
        put_all(out, d->command);
        fputs("</code>, ", out);
    }
    fprintf(out, "knead %s</p>\n", KN_VERSION);
    put_contents(d, out);
    fwrite(d->text, 1, d->size, out);
    fputs("</main>\n</body>\n</html>\n", out);
    return !ferror(out);
}

// Write index.html and move the folder to its place.
static int write_page(kn_document *d)
{
    char path[PATH_MAX], error[PATH_MAX];
    FILE *out = fopen(kn_document_file(d, "index.html", path), "w");
    bool ok = out && put_page(d, out);
    if (out) ok &= fclose(out) == 0;
    if (!ok) return kn_complain(d->subcommand, KN_EXIT_DEVICE, "%s: %s", d->batch.path, strerror(errno));
    if (kn_output_folder_keep(&d->batch, error, sizeof error)) return KN_EXIT_OK;
    return kn_complain(d->subcommand, KN_EXIT_DEVICE, "%s", error);
}

int kn_document_close(kn_document *d, int code)
{
    if (!d->body) return code;
    give_way(d);
    end_table(d);
    if (d->sections) fputs("</section>\n", d->body);
    if (fflush(d->body) != 0 && code == KN_EXIT_OK) code = kn_complain(d->subcommand, KN_EXIT_DEVICE, "out of memory");
    if (code == KN_EXIT_OK || code == KN_EXIT_FAILED) {
        const int written = write_page(d);
        if (written != KN_EXIT_OK) code = written;
    }
    fclose(d->body);
    free(d->text);
    kn_output_folder_drop(&d->batch);
    memset(d, 0, sizeof *d);
    return code;
}
