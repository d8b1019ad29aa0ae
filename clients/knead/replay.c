// knead replay: plays a log through the servo loop of kneadd under a virtual clock. server/log_replay.h steps the log.
// This file writes the results and messages.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/result.h"
#include "clients/hand/session_record.h"
#include "core/hash.h"
#include "core/scene/keys.h"
#include "server/backend/fpga.h"
#include "server/clock.h"
#include "server/log.h"
#include "server/option_table.h"
#include "server/log_replay.h"
#include "server/wire.h"
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: knead replay [SCENE] LOG [OPTION]...\n\n"
    "Play an LCM event log (of lcm-logger or knead probe --record) through the daemon's servo under a virtual clock.\n"
    "The same log gives the same forces, bit for bit. Without SCENE, a file or a name, the scene comes from the "
    "log.\n\n"
    "  --csv FILE        write one row per tick and live probe\n"
    "  --out FILE        write the daemon's messages as a log: scene, poses, forces, events\n"
    "  --hash            print one hash of all forces and the final state\n"
    "  --json            print the results, and the parts of the log that could not be used, as JSON\n"
    "  --verify          compare all forces with those in the log, bit for bit.\n"
    "                    Exit with 1 if a force differs or the log is incomplete\n"
    "  --snapshot PATH   a snapshot of the run in the log, or kneadd's --state-dir with such snapshots.\n"
    "                    Needed if the server restored a snapshot, or if the log begins on a kneaded\n"
    "                    object that it does not hold\n"
    "  --speed max|real  as fast as possible, or 1000 ticks per second (default: max)\n\n"
    "options that make the replay compute differently from the log (--verify refuses them):\n"
    "  --backend WHERE   cpu: the scene's solver; fixed: same as --solver fixed; a circuit: uart:, pty:, pcie:, shm:\n"
    "                    Each tick of a circuit is compared with the fixed solver.\n"
    "                    Exit with 1 if a tick or the final state differs\n"
    "  --solver S        implicit, rk4, fixed (integers, as the circuit in hdl), blend, secant or tangent\n"
    "  --precision P     f32 or f64\n"
    "  --dt TIME         time step, 1 ms divided by a whole number, e.g. '62.5 us'\n"
    "  --set KEY=VALUE   set a key of the scene; knead check --keys lists them\n"
    "  --quality NAME    fast, balanced or accurate: quality point of the scene; own: the scene's solver section\n\n"
    "Examples:\n"
    "    knead ctl reset && knead probe --record press.lcmlog\n"
    "    knead replay press.lcmlog --verify\n"
    "    knead replay press.lcmlog --set material=clay --csv clay.csv\n\n"
    "Exit codes: 0 ok, 1 --verify failed or is impossible, 2 bad input, 3 a file cannot be written.\n";

#define SETS_MAX 64
#define SET_SIZE 80 // size of a setting (`key=value`) in characters, enough for "solver.dt=" and a time

// Parsed command line. made[]: settings (`key=value`) made from other options. wide: true if the chosen solver exists
// in f64 only.
typedef struct replay_options {
    kn_replay_def def;
    const char *sets[SETS_MAX];
    char made[SETS_MAX][SET_SIZE];
    const char *csv_path, *out_path;
    bool hash, verify, real_time, wide;
} replay_options;

// State of one replay and of its outputs.
typedef struct replay_run {
    const replay_options *opt;
    kn_replay *replay;
    kn_beside csv; // csv.file: stream of --csv; NULL without --csv
    lcm_eventlog_t *out;
    bool out_failed;
    // initial_hash: hash of the object before the first tick; hash: hash of all forces so far.
    uint64_t initial_hash, hash;
    int64_t verified;           // number of forces compared with those in the log
    bool probes[KN_PROBES_MAX]; // true for each probe whose forces were compared
    bool differs;
    char difference[200]; // message about the first difference between log and replay
    double peak_n;
    int64_t clock_ns; // time when the next tick is due; used by --speed real
} replay_run;

// ---- options

// Add a setting `key=value` to the scene; `unit` is appended to the value. If `key` is NULL, `value` is a complete
// setting that the user gave. Return NULL, or KN_OPTION_TOLD after printing a message.
static const char *add_set(replay_options *opt, const char *key, const char *value, const char *unit)
{
    int i = opt->def.set_count;
    const bool full = i == SETS_MAX;
    if (!full && (!key || snprintf(opt->made[i], SET_SIZE, "%s=%s%s", key, value, unit) < SET_SIZE)) {
        opt->sets[opt->def.set_count++] = key ? opt->made[i] : value;
        return NULL;
    }
    kn_complain("replay", KN_EXIT_USAGE, "--%s %s: expected %s", full ? "set" : key, value,
                full ? "at most 64 of them" : "something shorter");
    return KN_OPTION_TOLD;
}

// Set the kind of solver, or the linearisation of the implicit solver.
static const char *take_solver(void *options, const char *name)
{
    replay_options *opt = options;
    const int choice = kn_choice_of("rk4|fixed|implicit|blend|secant|tangent", name);
    opt->wide = choice == 0 || choice == 1;
    if (choice < 0) return "implicit, rk4, fixed, blend, secant or tangent";
    return add_set(opt, choice < 3 ? "solver.kind" : "solver.linearization", name, "");
}

// Choose the place of computation: this processor, the circuit (FPGA), or the twin (a bit-exact model of the circuit).
// The circuit and its twin compute in integers, so both imply the fixed solver.
static const char *take_backend(void *options, const char *name)
{
    replay_options *opt = options;
    char why[KN_LINK_WHY];
    if (!strcmp(name, "cpu")) return NULL;
    bool device = strchr(name, ':');
    if (device && !kn_link_is_uri(name, why)) {
        kn_complain("replay", KN_EXIT_USAGE, "--backend %s", why);
        return KN_OPTION_TOLD;
    }
    if (device) opt->def.device = name;
    else if (strcmp(name, "fixed")) return "cpu, fixed, uart:, pty:, pcie: or shm:";
    return take_solver(opt, "fixed");
}

static const char *take_precision(void *options, const char *name)
{
    return kn_choice_of("f32|f64", name) < 0 ? "f32 or f64" : add_set(options, "solver.precision", name, "");
}

// A bare number is a time in seconds.
static const char *take_dt(void *options, const char *text)
{
    char *end;
    strtod(text, &end);
    return add_set(options, "solver.dt", text, end != text && *end == '\0' ? " s" : "");
}

static const char *take_set(void *options, const char *text) { return add_set(options, NULL, text, ""); }

static const char *take_quality(void *options, const char *name)
{
    const char *set = kn_quality_set(name);
    return set ? take_set(options, set) : kn_quality_names;
}

// If the solver is rk4 or fixed, which exist in f64 only, and the user gave no precision, add the setting f64. So a
// scene that exceeds a limit of this solver is refused because of this limit, and not because of its precision.
static const char *complete_solver(replay_options *opt)
{
    static const char key[] = "solver.precision=";
    for (int i = 0; i < opt->def.set_count; i++)
        if (!strncmp(opt->sets[i], key, sizeof key - 1)) return NULL;
    return opt->wide ? add_set(opt, "solver.precision", "f64", "") : NULL;
}

// Return true if the file starts with the magic number of an LCM event log.
static bool is_log(const char *path)
{
    unsigned char start[4] = {0};
    FILE *f = fopen(path, "rb");
    bool read = f && fread(start, 1, sizeof start, f) == sizeof start;
    if (f) fclose(f);
    return read && !memcmp(start, "\xED\xA1\xDA\x01", sizeof start);
}

static int parse(replay_options *opt, int argc, char **argv)
{
#define AT(member) .offset = offsetof(replay_options, member)
    static const kn_option rows[] = {
        KN_OPTION("csv", TEXT, AT(csv_path)),
        KN_OPTION("out", TEXT, AT(out_path)),
        KN_OPTION("hash", FLAG, AT(hash)),
        KN_OPTION("verify", FLAG, AT(verify)),
        KN_OPTION("speed", EITHER, AT(real_time), .unit = "max|real"),
        KN_OPTION("snapshot", TEXT, AT(def.snapshot_path)),
        KN_OPTION("solver", SPECIAL, .take = take_solver),
        KN_OPTION("backend", SPECIAL, .take = take_backend),
        KN_OPTION("precision", SPECIAL, .take = take_precision),
        KN_OPTION("dt", SPECIAL, .take = take_dt),
        KN_OPTION("set", SPECIAL, .take = take_set),
        KN_OPTION("quality", SPECIAL, .take = take_quality),
        KN_OPTION("json", CALL, .call = kn_result_open),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    const int code = kn_options_read(&table, opt, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    int files = argc - optind;
    if (files != 1 && files != 2)
        return kn_complain("replay", KN_EXIT_USAGE, "expected [SCENE] LOG; see knead replay --help");
    if (files == 2 && is_log(argv[optind]))
        return kn_complain(
            "replay", KN_EXIT_USAGE,
            "%s: is a log, expected a scene before the log %s; --verify compares with the forces in that log",
            argv[optind], argv[argc - 1]);
    if (files == 2 && kn_command_scene("replay", &opt->def.scene_path, argv[optind]) != KN_EXIT_OK)
        return KN_EXIT_USAGE;
    opt->def.log_path = argv[argc - 1];
    opt->def.sets = opt->sets;
    return complete_solver(opt) ? KN_EXIT_USAGE : code;
}

// ---- output log

// Append one encoded message to the output log.
static void log_bytes(replay_run *run, int64_t utime, const char *prefix, const char *probe, void *bytes, int size)
{
    char channel[64];
    snprintf(channel, sizeof channel, "%s%.*s", prefix, KN_NAME_MAX, probe);
    if (size < 0 || !kn_log_write(run->out, utime, channel, bytes, (size_t)size)) run->out_failed = true;
}

// Write the scene with the state hash of the object before the first tick.
static void log_scene(replay_run *run, int64_t utime)
{
    knead_scene_t message;
    kn_wire_scene(&message, run->replay->scene, run->initial_hash, utime);
    int size = knead_scene_t_encoded_size(&message);
    void *bytes = malloc((size_t)size);
    if (bytes) log_bytes(run, utime, "KNEAD_SCENE", "", bytes, knead_scene_t_encode(bytes, 0, size, &message));
    else run->out_failed = true;
    free(bytes);
}

// Write one tick in the order of the bus: poses, then events, then forces.
static void log_tick(replay_run *run)
{
    const kn_replay *r = run->replay;
    const kn_replay_tick *t = &r->tick;
    const kn_probe_def *probe = r->model->def.probe;
    uint8_t bytes[512];
    for (int p = 0; p < t->out.probes; p++) {
        if (!t->in.pose[p] || !t->in.fresh[p]) continue;
        knead_probe_pose_t message;
        kn_wire_pose(&message, t->in.pose[p]);
        log_bytes(run, t->utime, "KNEAD_POSE_", probe[p].name, bytes,
                  knead_probe_pose_t_encode(bytes, 0, sizeof bytes, &message));
    }
    for (int i = 0; i < t->out.event_count; i++) {
        knead_event_t message;
        kn_wire_event(&message, &t->out.event[i], t->utime);
        log_bytes(run, t->utime, "KNEAD_EVENT", "", bytes, knead_event_t_encode(bytes, 0, sizeof bytes, &message));
    }
    for (int p = 0; p < t->out.probes; p++) {
        if (!t->out.force[p].live) continue;
        knead_contact_force_t message;
        kn_wire_force(&message, &t->out, p, t->utime, t->execution_ns);
        log_bytes(run, t->utime, "KNEAD_FORCE_", probe[p].name, bytes,
                  knead_contact_force_t_encode(bytes, 0, sizeof bytes, &message));
    }
}

// Flag for the place of computation. Comparisons ignore this flag, because a circuit and its twin give the same bits.
static const int32_t where_computed = KNEAD_CONTACT_FORCE_T_FLAG_SHADOWED;

// Hash the encoded bytes of a force message, which are the same on every machine. The two fields that depend on a clock
// are set to 0 first.
static void hash_force(replay_run *run, int p)
{
    knead_contact_force_t message;
    uint8_t bytes[512];
    kn_wire_force(&message, &run->replay->tick.out, p, 0, 0);
    message.flags &= ~where_computed;
    int size = knead_contact_force_t_encode(bytes, 0, sizeof bytes, &message);
    run->hash = kn_hash_bytes(run->hash, bytes, (size_t)size);
}

// ---- verification

// Record the first difference between log and replay. Later forces are not compared.
static void differ(replay_run *run, int p, const char *what, double logged, double replayed)
{
    run->differs = true;
    snprintf(run->difference, sizeof run->difference,
             "tick %lld, probe %s: %s is %.17g in the log and %.17g in the replay",
             (long long)run->replay->tick.out.tick, run->replay->model->def.probe[p].name, what, logged, replayed);
}

static bool same_bits(double a, double b) { return memcmp(&a, &b, sizeof a) == 0; }

// Compare the force of probe p with the log's, bit for bit.
static void verify_force(replay_run *run, int p)
{
    static const char *const contact[] = {"contact_force_n[0]", "contact_force_n[1]", "contact_force_n[2]"};
    static const char *const given[] = {"force_n[0]", "force_n[1]", "force_n[2]"};
    const kn_force *f = &run->replay->tick.out.force[p];
    const knead_contact_force_t *log = run->replay->tick.logged[p];
    // a held force is that of an earlier tick, because a circuit was late
    if (!log || run->differs || log->flags & KNEAD_CONTACT_FORCE_T_FLAG_HELD) return;
    run->verified++;
    run->probes[p] = true;
    // The flags may differ only in the place of computation.
    if ((f->flags ^ log->flags) & ~where_computed) differ(run, p, "flags", log->flags, f->flags);
    if (!same_bits(f->gain, log->gain)) differ(run, p, "gain", log->gain, f->gain);
    for (int i = 0; i < 3; i++) {
        if (!same_bits(f->force_n[i], log->force_n[i])) differ(run, p, given[i], log->force_n[i], f->force_n[i]);
        if (!same_bits(f->contact_force_n[i], log->contact_force_n[i]))
            differ(run, p, contact[i], log->contact_force_n[i], f->contact_force_n[i]);
    }
    // A replay that begins after the server may give another sign to a zero of these.
    const struct {
        const char *name;
        const double *logged, *replayed;
        int count;
    } rest[] = {{"contact_torque_n_m", log->contact_torque_n_m, f->contact_torque_n_m, 3},
                {"torque_n_m", log->torque_n_m, f->torque_n_m, 3},
                {"proxy_position_m", log->proxy_position_m, f->proxy_position_m, 3},
                {"proxy_orientation_wxyz", log->proxy_orientation_wxyz, f->proxy_orientation_wxyz, 4},
                {"energy_j", &log->energy_j, &f->energy_j, 1},
                {"residual", &log->residual, &f->residual, 1}};
    for (size_t k = 0; k < sizeof rest / sizeof *rest; k++)
        for (int i = 0; i < rest[k].count; i++)
            if (rest[k].logged[i] != rest[k].replayed[i] && !run->differs)
                differ(run, p, rest[k].name, rest[k].logged[i], rest[k].replayed[i]);
    if (log->contacts != f->contacts) differ(run, p, "contacts", log->contacts, f->contacts);
    if (log->fault != f->fault) differ(run, p, "fault", log->fault, f->fault);
}

static int complain_damage(const replay_run *run, const char *log)
{
    return kn_complain("replay", KN_EXIT_FAILED,
                       "%s: cannot be verified completely: %s; the %lld forces before this point are equal", log,
                       run->replay->damage, (long long)run->verified);
}

// Report the result of --verify, the most serious reason first. Return the exit code.
static int verdict(const replay_run *run)
{
    const kn_replay_tally *tally = &run->replay->tally;
    const char *log = run->opt->def.log_path;
    // Count the probes for the report.
    int probes = 0;
    for (int p = 0; p < KN_PROBES_MAX; p++) probes += run->probes[p];
    // If poses or forces are missing in the log, the forces after the gap cannot be compared.
    if (tally->gaps > 0)
        return kn_complain(
            "replay", KN_EXIT_FAILED,
            "%s: cannot be verified: force or pose of %lld ticks is missing in the log, the first is tick %lld", log,
            (long long)tally->gaps, (long long)tally->first_gap);
    // The replay could not continue as the server did, for the reason in `damage`. Report this reason, because the
    // forces after it cannot be compared.
    if (run->replay->damage[0] && !run->replay->same) return complain_damage(run, log);
    if (run->differs)
        return kn_complain("replay", KN_EXIT_FAILED, "%s: differs after %lld equal forces: %s", log,
                           (long long)run->verified - 1, run->difference);
    if (tally->mismatches > 0)
        return kn_complain(
            "replay", KN_EXIT_FAILED,
            "%s: the state hash of %lld of %lld events differs from the replay's, the first at tick %lld", log,
            (long long)tally->mismatches, (long long)tally->checkpoints, (long long)tally->first_mismatch);
    if (run->replay->damage[0]) return complain_damage(run, log);
    if (tally->malformed > 0)
        return kn_complain(
            "replay", KN_EXIT_FAILED,
            "%s: cannot be verified completely: %lld malformed records were left out; %lld forces are equal", log,
            (long long)tally->malformed, (long long)run->verified);
    kn_result_integer(kn_result(), "verified_forces", run->verified);
    if (tally->before > 0) printf("%lld forces before the snapshot were not compared\n", (long long)tally->before);
    printf("verified %lld forces, %d probe%s\n", (long long)run->verified, probes, probes == 1 ? "" : "s");
    return KN_EXIT_OK;
}

// Refuse --verify before the replay starts if the log contains no forces to compare with, or if the options change the
// scene or the computation of the log.
static int refuse_verify(const replay_run *run)
{
    const char *log = run->opt->def.log_path;
    if (!run->replay->forces_logged)
        return kn_complain("replay", KN_EXIT_FAILED, "%s: cannot be verified: %s%sthe log holds no forces", log,
                           run->replay->damage, run->replay->damage[0] ? "; " : "");
    if (!run->replay->same)
        return kn_complain(
            "replay", KN_EXIT_USAGE,
            "%s: --verify cannot compare another scene or another computation, expected no SCENE, --set, "
            "--quality, --solver, --precision or --dt with values other than those in the log",
            log);
    return KN_EXIT_OK;
}

// ---- the run

// Sleep until the next millisecond of real time begins (--speed real).
static void keep_pace(replay_run *run)
{
    run->clock_ns += 1000000;
    kn_clock_sleep(run->clock_ns);
}

// Process the forces of one tick: update peak and hash, write the CSV row, compare with the log, write the output log.
static void take_tick(replay_run *run)
{
    const kn_tick_out *out = &run->replay->tick.out;
    for (int p = 0; p < out->probes; p++) {
        const double *f = out->force[p].contact_force_n;
        if (!out->force[p].live) continue;
        run->peak_n = fmax(run->peak_n, sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]));
        hash_force(run, p);
        if (run->csv.file) kn_rows_tick(run->csv.file, run->replay, p);
        if (run->opt->verify) verify_force(run, p);
    }
    if (run->out) log_tick(run);
}

// Report everything in the log that could not be used.
static void tell(const replay_run *run)
{
    const kn_replay *r = run->replay;
    const kn_replay_tally *t = &r->tally;
    const char *log = run->opt->def.log_path;
    if (t->refused)
        kn_complain("replay", KN_EXIT_OK, "%s: %lld poses were refused, as kneadd would refuse them", log,
                    (long long)t->refused);
    if (t->outside)
        kn_complain("replay", KN_EXIT_OK,
                    "%s: %s pressed up to %.2g mm outside its reach, for %lld ms in all, where the "
                    "cells are coarse",
                    log, r->model->def.probe[t->outside_probe].name, 1e3 * t->outside_m, (long long)t->outside);
    if (run->opt->verify) return; // with --verify, the result of the comparison reports everything else
    if (r->damage[0])
        kn_complain("replay", KN_EXIT_OK, "%s: %s: only the log before this point was used", log, r->damage);
    if (t->malformed)
        kn_complain("replay", KN_EXIT_OK, "%s: %lld malformed records were left out", log, (long long)t->malformed);
    if (t->gaps)
        kn_complain("replay", KN_EXIT_OK,
                    "%s: force or pose of %lld ticks is missing in the log, the first is tick %lld: these "
                    "ticks were replayed with the next pose",
                    log, (long long)t->gaps, (long long)t->first_gap);
    if (t->mismatches)
        kn_complain("replay", KN_EXIT_OK,
                    "%s: the state hash of %lld of %lld events differs from the replay's, the first at tick %lld", log,
                    (long long)t->mismatches, (long long)t->checkpoints, (long long)t->first_mismatch);
}

// Open the output files. An output may not be the log that is being read.
static int open_outputs(replay_run *run)
{
    const replay_options *opt = run->opt;
    if (kn_output_same(opt->csv_path, opt->def.log_path) || kn_output_same(opt->out_path, opt->def.log_path))
        return kn_complain("replay", KN_EXIT_USAGE, "%s: is being read, expected another file to write",
                           opt->def.log_path);
    if (opt->csv_path && !kn_output_open(&run->csv, "replay", opt->csv_path)) return KN_EXIT_DEVICE;
    if (run->csv.file) kn_rows_head(run->csv.file);
    if (!opt->out_path || (run->out = lcm_eventlog_create(opt->out_path, "w"))) return KN_EXIT_OK;
    int code = kn_complain("replay", KN_EXIT_DEVICE, "%s: %s, expected a file that can be written", opt->out_path,
                           strerror(errno));
    if (run->csv.file) kn_beside_drop(&run->csv);
    return code;
}

// Close the output files and check that they are complete.
static int close_outputs(replay_run *run)
{
    int code = run->csv.file ? kn_output_close(&run->csv, "replay") : KN_EXIT_OK;
    if (!run->out) return code;
    if (fflush(run->out->f) != 0 || run->out_failed)
        code = kn_complain("replay", KN_EXIT_DEVICE, "%s: could not be written completely", run->opt->out_path);
    lcm_eventlog_destroy(run->out);
    return code;
}

// Report the ticks of the circuit. Return KN_EXIT_FAILED if the circuit and its twin ever differed.
static int judge_circuit(replay_run *run)
{
    kn_fpga_counts n;
    kn_device_stats link;
    char why[KN_LINK_WHY] = "";
    if (!kn_backend_fpga_counts(&run->replay->backend, &n)) return KN_EXIT_OK;
    bool agrees = kn_backend_fpga_agrees(&run->replay->backend, why, &link);
    printf("circuit: %lld of %lld ticks ran on it; %lld results differed from the twin's; it was lost %lld times; "
           "%s%s\n",
           (long long)n.on_circuit, (long long)(n.on_circuit + n.shadowed), (long long)n.different, (long long)n.losses,
           agrees ? "its final state equals the twin's" : "", why);
    return agrees && n.different == 0 ? KN_EXIT_OK : KN_EXIT_FAILED;
}

static void tell_result(const replay_run *run)
{
    const kn_replay_tally *t = &run->replay->tally;
    json_t *to = kn_result();
    kn_result_text(to, "scene", run->replay->scene->name);
    kn_result_integer(to, "ticks", t->ticks);
    kn_result_number(to, "end_s", run->replay->tick.time_s);
    kn_result_number(to, "peak_contact_force_n", run->peak_n);
    kn_result_integer(to, "forces", t->forces);
    kn_result_integer(to, "gaps", t->gaps);
    kn_result_integer(to, "malformed", t->malformed);
    kn_result_integer(to, "refused", t->refused);
    kn_result_integer(to, "checkpoints", t->checkpoints);
    kn_result_integer(to, "mismatches", t->mismatches);
    kn_result_number(to, "outside_m", t->outside_m);
    kn_result_text(to, "damage", run->replay->damage);
    if (run->replay->resumed_tick >= 0) kn_result_integer(to, "resumed_tick", run->replay->resumed_tick);
}

static void tell_hash(uint64_t hash)
{
    char text[24];
    snprintf(text, sizeof text, "0x%016llx", (unsigned long long)hash);
    kn_result_text(kn_result(), "hash", text); // written as text, because a JSON number holds only 53 bits exactly
    printf("hash %s\n", text);
}

// Run the whole replay and report. Return the exit code.
static int play(replay_run *run)
{
    kn_replay *r = run->replay;
    int code = run->opt->verify ? refuse_verify(run) : KN_EXIT_OK;
    if (code == KN_EXIT_OK) code = open_outputs(run);
    if (code != KN_EXIT_OK) return code;
    run->clock_ns = kn_now_ns();
    run->hash = KN_HASH_SEED;
    run->initial_hash = kn_state_hash(r->model, kn_replay_state(r));
    bool first = true;
    kn_progress bar = kn_progress_open("replay", (double)r->tally.ticks_total);
    while (kn_replay_step(r)) {
        // The scene message in the output log gets the log time of the first tick.
        if (first && run->out) log_scene(run, r->tick.utime);
        first = false;
        take_tick(run);
        kn_progress_step(&bar, (double)r->tally.ticks);
        if (run->opt->real_time) keep_pace(run);
    }
    kn_progress_close(&bar);
    tell(run);
    code = close_outputs(run);
    if (code != KN_EXIT_OK) return code;
    tell_result(run);
    if (r->resumed_tick >= 0) printf("continued from the snapshot of tick %lld\n", (long long)r->resumed_tick);
    printf("replayed %lld ticks, peak contact force %.3f N\n", (long long)r->tally.ticks, run->peak_n);
    uint64_t state = kn_state_hash(r->model, kn_replay_state(r));
    if (run->opt->hash) tell_hash(kn_hash_bytes(run->hash, &state, sizeof state));
    code = judge_circuit(run);
    return code == KN_EXIT_OK && run->opt->verify ? verdict(run) : code;
}

int kn_replay_main(int argc, char **argv)
{
    replay_options opt = {0};
    char error[512] = "";
    int code = parse(&opt, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    bool no_device = false;
    // If the circuit cannot be used, the device is at fault. Every other failure is bad input.
    opt.def.device_failed = &no_device;
    replay_run run = {.opt = &opt, .replay = kn_replay_create(&opt.def, error, sizeof error)};
    if (!run.replay) return kn_complain("replay", no_device ? KN_EXIT_DEVICE : KN_EXIT_USAGE, "%s", error);
    code = play(&run);
    kn_replay_destroy(run.replay);
    return code;
}
