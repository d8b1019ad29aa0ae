// The force table and the CSV of a session, from messages made by the test.
#include "clients/hand/session_record.h"
#include "tests/check.h"

static kn_hand hand;
static kn_session_record record;
static kn_tool_path *path;

// Make a press with 100 poses before the path, the whole path, and one force for each pose, as a server sends them.
static void play(void)
{
    free(record.force);
    free(record.pose);
    kn_tool_path_destroy(path);
    memset(&record, 0, sizeof record);
    path = kn_tool_path_press(&(kn_tool_path_def){.touch_z_m = 0.03, .hold_s = 0.5});
    kn_hand_init(&hand, &(kn_hand_def){.path = path, .session = 40});
    int64_t sent = 100 + (int64_t)(1e3 * path->duration_s);
    hand.attempt[0] = (kn_attempt){.session = 40, .play_seq = 101, .sent = sent};
    record.force = calloc((size_t)sent, sizeof *record.force);
    record.pose = calloc((size_t)sent, sizeof *record.pose);
    for (int64_t seq = 1; seq <= sent; seq++) {
        double t = 1e-3 * (double)(seq - 101);
        kn_tool_path_point p;
        kn_tool_path_at(path, t, &p);
        knead_probe_pose_t *pose = &record.pose[record.pose_count++];
        *pose = (knead_probe_pose_t){.session = 40, .seq = seq, .sent_ns = 1000000 * seq};
        memcpy(pose->position_m, p.position_m, sizeof pose->position_m);
        kn_heard_force *f = &record.force[record.force_count++];
        f->force = (knead_contact_force_t){.session = 40, .seq = seq, .tick = 5000 + seq, .gain = 1};
        f->force.sent_ns = 1000000 * seq;
        f->arrived_ns = 1000000 * seq + 500000 + (seq == 7 ? 9000000 : 0);
        double depth_m = 0.03 - p.position_m[2];
        if (depth_m > 0) f->force.contacts = 3, f->force.contact_force_n[2] = 1e3 * depth_m;
        f->force.force_n[2] = fmin(f->force.contact_force_n[2], 3.3);
    }
}

static kn_session_report report(void)
{
    kn_session_report r;
    kn_session_report_make(&r, &hand, &record);
    return r;
}

TEST("the report of a press has contact time, peak, force at the end of the hold and force given to the hand")
{
    play();
    const kn_session_report r = report();
    CHECK_NEAR(r.peak_n, 10, 1e-9);
    CHECK_NEAR(r.hold_end_n, 10, 1e-9);
    CHECK_NEAR(r.given_peak_n, 3.3, 1e-9);
    // 1.05 s down, 0.5 s there, 1.025 s up: the withdrawal does not stop at the surface
    CHECK_NEAR(r.contact_s, 2.575, 0.005);
    CHECK(r.peak_s > r.contact_from_s && r.peak_s < r.contact_from_s + r.contact_s);
    CHECK(r.gain_min == 1);
}

TEST("each force that echoes a pose is matched, and lost, foreign and stale forces are counted separately")
{
    play();
    const kn_session_report r = report();
    const int64_t all = hand.attempt[0].sent;
    CHECK(r.sent == all && r.forces == all && r.matched == all && r.strange == 0 && r.stale == 0 && r.lost == 0);
    CHECK_NEAR(r.round_trip_p50_ms, 0.5, 1e-9);
    CHECK_NEAR(r.round_trip_p99_ms, 0.5, 1e-9); // only one of thousands was late

    kn_heard_force *f = record.force;
    memmove(f + 50, f + 51, (size_t)(--record.force_count - 50) * sizeof *f); // one is lost
    f[60].force.session = 39;
    f[70].force.seq--;
    f[70].force.flags = KN_FLAG_STALE;
    f[80].force.missed_cycles = 2; // two cycles skipped: their tick numbers are missing, but no record is
    for (int i = 80; i < record.force_count; i++) f[i].force.tick += 2;
    const kn_session_report spoilt = report();
    CHECK(spoilt.forces == all - 1 && spoilt.matched == all - 2 && spoilt.strange == 1 && spoilt.stale == 1);
    CHECK(spoilt.missed == 2 && spoilt.lost == 1);
}

TEST("forces after the last pose are not counted")
{
    play();
    record.force = realloc(record.force, sizeof *record.force * (size_t)(record.force_count + 20));
    for (int i = 0; i < 20; i++) { // the server fades because no pose comes any more
        kn_heard_force *f = &record.force[record.force_count], *last = f - 1;
        *f = *last;
        f->force.tick++;
        f->force.flags = KN_FLAG_STALE;
        f->force.gain = 1 - 0.05 * i;
        record.force_count++;
    }
    const kn_session_report r = report();
    CHECK(r.gain_min == 1 && r.stale == 0 && r.lost == 0);
}

TEST("a session without contact has peak 0, and a session without forces has no round trip")
{
    play();
    for (int i = 0; i < record.force_count; i++) record.force[i].force.contacts = 0;
    const kn_session_report air = report();
    CHECK(air.contact_s == 0 && air.peak_n == 0);
    record.force_count = 0;
    const kn_session_report none = report();
    CHECK(isnan(none.round_trip_p50_ms) && none.forces == 0);
}

TEST("the CSV has one row per force with the pose it echoes, in any order of the poses")
{
    char line[512];
    play();
    knead_probe_pose_t swap = record.pose[3];
    record.pose[3] = record.pose[4], record.pose[4] = swap;
    FILE *csv = tmpfile();
    kn_session_report_csv(csv, &hand, &record, "plate");
    rewind(csv);
    CHECK(fgets(line, sizeof line, csv) != NULL);
    CHECK_STR(line, "tick,time_s,probe,x_m,y_m,z_m,contact_fx_n,contact_fy_n,contact_fz_n,fx_n,fy_n,fz_n,"
                    "tx_n_m,ty_n_m,tz_n_m,contacts,residual,execution_ns,proxy_x_m,proxy_y_m,proxy_z_m\n");
    int rows = 0;
    double lowest = 1, force_there = 0, z, fz;
    for (; fgets(line, sizeof line, csv); rows++) {
        CHECK(sscanf(line, "%*d,%*f,plate,%*f,%*f,%lf,%*f,%*f,%lf", &z, &fz) == 2);
        if (z < lowest) lowest = z, force_there = fz;
    }
    CHECK(rows == record.force_count);
    CHECK_NEAR(lowest, 0.02, 1e-8);
    CHECK_NEAR(force_there, 10, 1e-6);
    fclose(csv);
}

TESTS_MAIN
