#include "server/trace.h"
#include <errno.h>
#include <inttypes.h>
#include <string.h>

#define ROWS 4096 // capacity of the ring in rows: one second of four probes, the longest expected wait for a busy disk

typedef struct row {
    char probe[KN_NAME_MAX];
    int64_t tick, session, seq, arrived_ns, woke_ns, stepped_ns, guarded_ns, due_ns, asked_ns, late_ns;
} row;

bool kn_trace_open(kn_trace *trace, const char *path, bool append, char *error, size_t error_size)
{
    *trace = (kn_trace){0};
    // write the column names only into a new file, because a second scene of the same process appends rows
    if (!path) return true;
    trace->file = fopen(path, append ? "ae" : "we");
    if (trace->file && kn_ring_init(&trace->rows, ROWS, sizeof(row))) {
        if (!append)
            fputs("tick,probe,session,seq,arrived_ns,woke_ns,stepped_ns,guarded_ns,due_ns,asked_ns,late_ns\n",
                  trace->file);
        return true;
    }
    snprintf(error, error_size, "--trace %s: %s", path, strerror(errno));
    kn_trace_close(trace);
    return false;
}

void kn_trace_record(kn_trace *trace, const kn_record *record, const kn_model_def *def)
{
    for (int p = 0; trace->file && p < record->out.probes; p++) {
        const kn_force *force = &record->out.force[p];
        if (!force->live) continue;
        // the fields have the same names as the columns of the file
        row r = {.tick = record->out.tick,
                 .session = force->session,
                 .seq = force->seq,
                 .arrived_ns = record->posted_ns[p],
                 .woke_ns = record->wake.now_ns,
                 .stepped_ns = record->out.stepped_ns,
                 .guarded_ns = record->guarded_ns,
                 .due_ns = record->wake.due_ns,
                 .asked_ns = record->wake.asked_ns,
                 .late_ns = record->wake.late_ns};
        memcpy(r.probe, def->probe[p].name, sizeof r.probe);
        trace->lost += !kn_ring_push(&trace->rows, &r);
    }
}

void kn_trace_drain(kn_trace *trace)
{
    // a failed write is reported at the end, and does not stop the server
    for (const row *r; trace->file && (r = kn_ring_front(&trace->rows)); kn_ring_pop(&trace->rows))
        trace->failed |= fprintf(trace->file,
                                 "%" PRId64 ",%s,%" PRId64 ",%" PRId64 ",%" PRId64 ",%" PRId64 ",%" PRId64 ",%" PRId64
                                 ",%" PRId64 ",%" PRId64 ",%" PRId64 "\n",
                                 r->tick, r->probe, r->session, r->seq, r->arrived_ns, r->woke_ns, r->stepped_ns,
                                 r->guarded_ns, r->due_ns, r->asked_ns, r->late_ns) < 0;
}

bool kn_trace_close(kn_trace *trace)
{
    kn_trace_drain(trace);
    if (trace->file) trace->failed |= fclose(trace->file) != 0;
    kn_ring_free(&trace->rows);
    trace->file = NULL;
    return !trace->failed;
}
