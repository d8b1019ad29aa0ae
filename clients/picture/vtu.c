#include "clients/picture/paraview.h"
#include <errno.h>
#include <libxml/xmlwriter.h>
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TEXT(s) ((const xmlChar *)(s))

// ---- an XML file whose write errors are all detected

// An open XML file.
typedef struct kn_pvd {
    FILE *file;
    xmlTextWriter *xml;
    bool failed; // true: a call of libxml2 has failed
    char path[4096];
} sheet;

static int put(void *file, const char *bytes, int size) { return (int)fwrite(bytes, 1, (size_t)size, file); }

// Check the result of a call of libxml2, and remember a failure. A negative result means that the call failed.
static void say(sheet *s, int result) { s->failed |= result < 0; }

// Set `error` to the reason why the file could not be written.
static bool explain(const sheet *s, char *error, size_t size)
{
    snprintf(error, size, "%.4000s: %s", s->path, errno ? strerror(errno) : "could not be written completely");
    return false;
}

// Open a .vtu or .pvd file and write its root element. header: attribute header_type; NULL: none.
static bool sheet_open(sheet *s, const char *path, const char *type, const char *header, char *error, size_t size)
{
    *s = (sheet){0};
    errno = 0;
    snprintf(s->path, sizeof s->path, "%s", path);
    s->file = fopen(path, "wb");
    if (!s->file) return explain(s, error, size);
    xmlOutputBuffer *out = xmlOutputBufferCreateIO(put, NULL, s->file, NULL);
    s->xml = out ? xmlNewTextWriter(out) : NULL;
    if (!s->xml) {
        if (out) xmlOutputBufferClose(out);
        fclose(s->file);
        return explain(s, error, size);
    }
    xmlTextWriterSetIndent(s->xml, 1);
    say(s, xmlTextWriterStartDocument(s->xml, NULL, "UTF-8", NULL));
    say(s, xmlTextWriterStartElement(s->xml, TEXT("VTKFile")));
    say(s, xmlTextWriterWriteAttribute(s->xml, TEXT("type"), TEXT(type)));
    say(s, xmlTextWriterWriteAttribute(s->xml, TEXT("version"), TEXT("1.0")));
    say(s, xmlTextWriterWriteAttribute(s->xml, TEXT("byte_order"), TEXT("LittleEndian")));
    if (header) say(s, xmlTextWriterWriteAttribute(s->xml, TEXT("header_type"), TEXT(header)));
    return true;
}

// Close all elements and the file. Return false if anything failed since the file was opened.
static bool sheet_close(sheet *s, char *error, size_t size)
{
    say(s, xmlTextWriterEndDocument(s->xml));
    say(s, xmlTextWriterFlush(s->xml));
    xmlFreeTextWriter(s->xml);
    const bool written = !ferror(s->file) && !s->failed;
    if (fclose(s->file) == 0 && written) return true;
    return explain(s, error, size);
}

// ---- datasets

static void attribute(sheet *s, const char *name, int64_t value)
{
    say(s, xmlTextWriterWriteFormatAttribute(s->xml, TEXT(name), "%lld", (long long)value));
}

static void begin(sheet *s, const char *element) { say(s, xmlTextWriterStartElement(s->xml, TEXT(element))); }
static void end(sheet *s) { say(s, xmlTextWriterEndElement(s->xml)); }

// Write an array: the number of bytes and then the numbers, together in base64. VTK calls this format uncompressed
// inline binary. The byte order is that of this machine, which is little-endian wherever Knead is built (core/fixed.h,
// server/snapshot_file.h). tuples: number of tuples (groups of `components` numbers). A negative value marks an array
// for the whole file, which has -tuples tuples.
static void write_array(sheet *s, const char *name, const char *type, int components, int64_t tuples, const void *value,
                        size_t size)
{
    const uint64_t bytes = (uint64_t)(tuples > 0 ? tuples : -tuples) * (uint64_t)components * size;
    const size_t plain = sizeof bytes + bytes, coded = sodium_base64_ENCODED_LEN(plain, sodium_base64_VARIANT_ORIGINAL);
    uint8_t *block = malloc(plain);
    char *text = malloc(coded);
    begin(s, "DataArray");
    say(s, xmlTextWriterWriteAttribute(s->xml, TEXT("type"), TEXT(type)));
    say(s, xmlTextWriterWriteAttribute(s->xml, TEXT("Name"), TEXT(name)));
    attribute(s, "NumberOfComponents", components);
    // An array for the whole file must state its number of tuples, because no other attribute states this number.
    if (tuples < 0) attribute(s, "NumberOfTuples", -tuples);
    say(s, xmlTextWriterWriteAttribute(s->xml, TEXT("format"), TEXT("binary")));
    if (block && text) {
        memcpy(block, &bytes, sizeof bytes);
        if (bytes > 0) memcpy(block + sizeof bytes, value, bytes);
        say(s, xmlTextWriterWriteRaw(
                   s->xml, TEXT(sodium_bin2base64(text, coded, block, plain, sodium_base64_VARIANT_ORIGINAL))));
    } else s->failed = true;
    end(s);
    free(block);
    free(text);
}

// Write the arrays of the points or of the cells.
static void write_arrays(sheet *s, const char *element, const kn_vtu_array *array, int arrays, int64_t tuples)
{
    begin(s, element);
    for (int i = 0; i < arrays; i++)
        write_array(s, array[i].name, "Float32", array[i].components, tuples, array[i].value, sizeof(float));
    end(s);
}

// Write the cells: the list of the corner points of all cells, the position in this list where each cell ends, and the
// type of each cell.
static void write_cells(sheet *s, const kn_vtu *v)
{
    begin(s, "Cells");
    const int corners = v->cell_count ? v->end[v->cell_count - 1] : 0;
    write_array(s, "connectivity", "Int32", 1, corners, v->corner, sizeof(int32_t));
    write_array(s, "offsets", "Int32", 1, v->cell_count, v->end, sizeof(int32_t));
    write_array(s, "types", "UInt8", 1, v->cell_count, v->type, 1);
    end(s);
}

bool kn_vtu_write(const kn_vtu *v, const char *path, char *error, size_t size)
{
    sheet s;
    if (!sheet_open(&s, path, "UnstructuredGrid", "UInt64", error, size)) return false;
    begin(&s, "UnstructuredGrid");
    begin(&s, "FieldData");
    write_array(&s, "TimeValue", "Float64", 1, -1, &v->time_s, sizeof v->time_s);
    for (int i = 0; i < v->field_arrays; i++)
        write_array(&s, v->field[i].name, "Float32", v->field[i].components, -1, v->field[i].value, sizeof(float));
    end(&s);
    begin(&s, "Piece");
    attribute(&s, "NumberOfPoints", v->point_count);
    attribute(&s, "NumberOfCells", v->cell_count);
    write_arrays(&s, "PointData", v->point, v->point_arrays, v->point_count);
    write_arrays(&s, "CellData", v->cell, v->cell_arrays, v->cell_count);
    begin(&s, "Points");
    write_array(&s, "position_m", "Float32", 3, v->point_count, v->xyz, sizeof(float));
    end(&s);
    write_cells(&s, v);
    return sheet_close(&s, error, size);
}

// ---- collections

kn_pvd *kn_pvd_open(const char *path, char *error, size_t size)
{
    sheet *s = malloc(sizeof *s);
    if (!s) snprintf(error, size, "out of memory");
    if (s && sheet_open(s, path, "Collection", NULL, error, size)) {
        begin(s, "Collection");
        return s;
    }
    free(s);
    return NULL;
}

void kn_pvd_add(kn_pvd *s, double time_s, int part, const char *name, const char *file)
{
    begin(s, "DataSet");
    say(s, xmlTextWriterWriteFormatAttribute(s->xml, TEXT("timestep"), "%.6f", time_s));
    say(s, xmlTextWriterWriteAttribute(s->xml, TEXT("group"), TEXT("")));
    attribute(s, "part", part);
    say(s, xmlTextWriterWriteAttribute(s->xml, TEXT("name"), TEXT(name)));
    say(s, xmlTextWriterWriteAttribute(s->xml, TEXT("file"), TEXT(file)));
    end(s);
}

bool kn_pvd_close(kn_pvd *s, char *error, size_t size)
{
    const bool whole = sheet_close(s, error, size);
    free(s);
    return whole;
}
