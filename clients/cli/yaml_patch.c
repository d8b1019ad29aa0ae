#include "clients/cli/yaml_patch.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <yaml.h>

// Place of a block in the text: the line of its key and the last line of its value, counted from 0. -1: not found.
typedef struct place {
    long first, last;
    bool braces; // true: the outermost mapping of the text is written in braces
} place;

// Find the key `key` in the events of the YAML parser. Depth 1 is inside the outermost mapping, where keys and values
// alternate.
static bool walk(yaml_parser_t *parser, const char *key, place *p)
{
    int depth = 0;
    bool is_key = true, inside = false;
    for (bool done = false; !done;) {
        yaml_event_t e;
        if (!yaml_parser_parse(parser, &e)) return false;
        bool begins = e.type == YAML_MAPPING_START_EVENT || e.type == YAML_SEQUENCE_START_EVENT;
        bool ends = e.type == YAML_MAPPING_END_EVENT || e.type == YAML_SEQUENCE_END_EVENT;
        // The event at the end of an indented block has no text of its own, so its position must not be used as the end
        // of the block.
        bool marked = e.start_mark.index != e.end_mark.index;
        if (depth == 0 && e.type == YAML_MAPPING_START_EVENT)
            p->braces = e.data.mapping_start.style == YAML_FLOW_MAPPING_STYLE;
        if (ends) depth--;
        // At depth 1 of the YAML text, an event that does not begin a mapping or a sequence completes either a key or a
        // value.
        if (depth == 1 && !begins) {
            if (is_key && e.type == YAML_SCALAR_EVENT && !strcmp((const char *)e.data.scalar.value, key)) {
                inside = true;
                p->first = p->last = (long)e.start_mark.line;
            } else if (!is_key && inside) {
                if (marked) p->last = (long)e.end_mark.line - (e.end_mark.column == 0);
                inside = false;
            }
            is_key = !is_key;
        } else if (inside && marked) {
            // The parser reports the end of a literal block at column 0 of the next line. This next line does not
            // belong to the block.
            p->last = (long)e.end_mark.line - (e.end_mark.column == 0);
        }
        if (begins) depth++;
        done = e.type == YAML_STREAM_END_EVENT;
        yaml_event_delete(&e);
    }
    return true;
}

// Return the byte offset of a line, or the size of the text if it has fewer lines.
static size_t line_at(const char *text, long line)
{
    const char *at = text;
    for (; line > 0 && at; line--)
        if ((at = strchr(at, '\n'))) at++;
    return at ? (size_t)(at - text) : strlen(text);
}

bool kn_yaml_patch_find(const char *text, const char *key, size_t *begin, size_t *end, char *error, size_t error_size)
{
    place p = {.first = -1};
    yaml_parser_t parser;
    if (!yaml_parser_initialize(&parser)) {
        snprintf(error, error_size, "not enough memory");
        return false;
    }
    yaml_parser_set_input_string(&parser, (const unsigned char *)text, strlen(text));
    bool ok = walk(&parser, key, &p);
    if (!ok) snprintf(error, error_size, "%s in line %zu", parser.problem, parser.problem_mark.line + 1);
    yaml_parser_delete(&parser);
    if (ok && p.braces) snprintf(error, error_size, "the whole scene is in braces, expected one key per line");
    // If the key is missing, return an empty block at the end of the text.
    *begin = *end = strlen(text);
    if (ok && p.first >= 0) {
        *begin = line_at(text, p.first);
        *end = line_at(text, p.last + 1);
    }
    return ok && !p.braces;
}

char *kn_yaml_patch(const char *text, const char *key, const char *block, char *error, size_t error_size)
{
    size_t begin, end, size = strlen(text);
    if (!kn_yaml_patch_find(text, key, &begin, &end, error, error_size)) return NULL;
    const char *line = strchr(text, '\n');
    // `crlf`: lines of the text end with carriage return and line feed. `open`: the block is appended to a text whose
    // last line has no line end.
    bool crlf = line && line > text && line[-1] == '\r', open = begin == size && size > 0 && text[size - 1] != '\n';
    // Allocate room for the text and twice the block, because at most one carriage return is added per character of the
    // block.
    char *out = malloc(size + 2 * strlen(block) + 3), *to = out;
    if (!out) {
        snprintf(error, error_size, "not enough memory");
        return NULL;
    }
    to = (char *)memcpy(to, text, begin) + begin;
    if (open && *block) to += sprintf(to, crlf ? "\r\n" : "\n");
    // Copy the block with the line ends of the text.
    for (const char *c = block; *c; c++) {
        if (*c == '\n' && crlf) *to++ = '\r';
        *to++ = *c;
    }
    memcpy(to, text + end, size - end + 1);
    return out;
}
