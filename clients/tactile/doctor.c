// knead doctor: checks that this machine is ready for real time, LCM and devices. It lists each problem with its
// remedy.
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/tactile/devices.h"
#include "core/model.h"
#include "core/algebra/algebra.h"
#include "server/backend/link.h"
#include "server/bus.h"
#include "server/clock.h"
#include "server/daemon.h"
#include "server/option_table.h"
#include <errno.h>
#include <glob.h>
#include <grp.h>
#include <inttypes.h>
#include <limits.h>
#include <pwd.h>
#include <sched.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/utsname.h>
#include <sys/wait.h>
#include <unistd.h>

// Each line of the help text is one line here, so that it can be read as it is printed.
// clang-format off
static const char help[] =
    "usage: knead doctor [OPTION]...\n\n"
    "Check that this machine can serve a hand at 1 kHz, and print a fix for everything that is missing: real-time\n"
    "priority, locked memory, the loopback route of LCM's group, socket buffers, the processor's clock and\n"
    "instructions, the user's groups, and the permissions of devices. Then run a thread that sleeps until each\n"
    "millisecond, as the servo thread of kneadd does, and measure how late it wakes up, and what a second thread\n"
    "would bring.\n\n"
    "  --seconds TIME  measure for this time, 1 s to 1 h (default: 2 s)\n"
    "  --card ADDRESS  also check the PCI card of kneadd --backend pcie:ADDRESS, such as 0000:01:00.0\n"
    "  --json          print JSON\n"
    "  --root DIR      search DIR/dev and DIR/sys instead of /dev and /sys\n\n"
    "Examples:\n"
    "    knead doctor\n"
    "    knead doctor --seconds '5 s' --json\n\n"
    "Exit codes: 0 all checks have passed, 1 a check has failed, 2 bad input.\n";
// clang-format on

#define CHECKS_MAX (16 + 2 * KN_DEVICES_MAX)
#define LOCKED_BYTES ((size_t)64 << 20) // memory that kneadd locks for a large object
#define BUFFER_BYTES (1 << 20)          // socket buffer that server/bus.c requests
#define JOIN_KNEAD "sudo groupadd -fr knead; sudo usermod -aG knead $USER; log in again"

typedef struct check {
    char name[16];
    bool good;
    // found: result of the check in words; fix: remedy, or "" if none exists or none is needed.
    char found[256], fix[512];
} check;

typedef struct findings {
    int count;
    check check[CHECKS_MAX];
} findings;

// Append a check with the given name. Write the formatted text to the field `found` of the check.
__attribute__((format(printf, 4, 5))) static check *add(findings *f, const char *name, bool good, const char *format,
                                                        ...)
{
    check *c = &f->check[f->count++];
    va_list arguments;
    *c = (check){.good = good};
    snprintf(c->name, sizeof c->name, "%s", name);
    va_start(arguments, format);
    vsnprintf(c->found, sizeof c->found, format, arguments);
    va_end(arguments);
    return c;
}

// Add a remedy to the check c if c has failed. A check that has passed gets no remedy.
__attribute__((format(printf, 2, 3))) static void fix(check *c, const char *format, ...)
{
    va_list arguments;
    if (c->good) return;
    va_start(arguments, format);
    vsnprintf(c->fix, sizeof c->fix, format, arguments);
    va_end(arguments);
}

// Run a function in a child process, so that its effects end with the child. Return 0, or the errno of the function if
// it has failed.
static int attempt(int (*what)(void))
{
    fflush(stdout);
    pid_t child = fork();
    int status = 0;
    if (child == 0) _exit(what() == 0 ? 0 : errno & 0xff);
    if (child < 0 || waitpid(child, &status, 0) != child || !WIFEXITED(status)) return EIO;
    return WEXITSTATUS(status);
}

static int take_priority(void)
{
    return sched_setscheduler(0, SCHED_FIFO, &(struct sched_param){.sched_priority = KN_RT_SERVO});
}

static int lock_memory(void)
{
    void *memory = mmap(NULL, LOCKED_BYTES, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    // Call mlock through syscall, because the sanitizers replace mlock by a function that does nothing.
    return memory == MAP_FAILED ? -1 : (int)syscall(SYS_mlock, memory, LOCKED_BYTES);
}

// --- checks of the machine ---

static void look_at_limits(findings *f)
{
    int error = attempt(take_priority);
    check *c = add(f, "priority", !error, error ? "no SCHED_FIFO %d: %s" : "SCHED_FIFO %d is granted", KN_RT_SERVO,
                   strerror(error));
    fix(c, "in /etc/security/limits.d/knead.conf: @knead - rtprio %d; " JOIN_KNEAD, KN_RT_SERVO);
    error = attempt(lock_memory);
    c = add(f, "memory", !error, error ? "%zu MiB cannot be locked: %s" : "%zu MiB can be locked", LOCKED_BYTES >> 20,
            strerror(error));
    fix(c, "in /etc/security/limits.d/knead.conf: @knead - memlock unlimited; " JOIN_KNEAD);
    // The kernel lets real-time threads run for a limited part of each second. A limit below 90 % could stop a busy
    // servo loop. A negative value means no limit.
    char word[32];
    if (!kn_devices_read_line("/proc/sys/kernel/sched_rt_runtime_us", word, sizeof word)) return;
    long us = strtol(word, NULL, 10);
    c = add(f, "throttling", us < 0 || us >= 900000,
            us < 0 ? "no limit: a real-time thread that does not sleep stops the machine"
                   : "real-time threads get at most %ld us of each second",
            us);
    fix(c, "sudo sysctl kernel.sched_rt_runtime_us=950000");
}

static void look_at_bus(findings *f)
{
    // In error messages of server/bus.c, this text stands between the problem and the remedy.
    static const char also[] = "; as root: ";
    char error[512], word[32];
    kn_bus bus;
    const char *url = getenv("LCM_DEFAULT_URL");
    if (!url || !*url) url = KN_LCM_URL;
    bool parsed = kn_bus_parse(&bus, url, NULL, error, sizeof error);
    bool good = parsed && kn_bus_check_route(&bus, error, sizeof error);
    char *cure = good ? NULL : strstr(error, also);
    if (cure) *cure = '\0';
    check *c = add(f, "route", good, "%s%s", good ? url : error, good ? " stays on this machine" : "");
    fix(c, "%s%s", cure ? "as root: " : "unset LCM_DEFAULT_URL", cure ? cure + strlen(also) : "");
    if (!kn_devices_read_line("/proc/sys/net/core/rmem_max", word, sizeof word)) return;
    long bytes = strtol(word, NULL, 10);
    // For root, the limit rmem_max does not matter, because root may exceed it.
    c = add(f, "buffers", geteuid() == 0 || bytes >= BUFFER_BYTES, "a socket may have a receive buffer of %ld KiB",
            bytes >> 10);
    fix(c, "sudo sysctl net.core.rmem_max=%d", BUFFER_BYTES);
}

static void look_at_processor(findings *f)
{
    char word[64] = "";
    struct utsname kernel;
    glob_t list;
    long processors = sysconf(_SC_NPROCESSORS_ONLN);
    check *c = add(f, "processors", processors >= 2, "%ld", processors);
    fix(c, "use a machine with two processors: on one processor, the servo loop and its clients wait for each other");
    // Without FMA instructions the results are right, but every tick takes longer than its millisecond.
    c = add(f, "instructions", kn_isa_supported(KN_ISA_AVX2), "%s",
            kn_isa_supported(KN_ISA_AVX512) ? "AVX-512"
            : kn_isa_supported(KN_ISA_AVX2) ? "AVX2 and FMA"
                                            : "no FMA: correct results, but no real time");
    fix(c, "use a processor with AVX2 and FMA (built since 2013)");
    if (glob("/sys/devices/system/cpu/cpu*/cpufreq/scaling_governor", 0, NULL, &list) == 0) {
        size_t slow = 0;
        for (size_t i = 0; i < list.gl_pathc; i++)
            slow += kn_devices_read_line(list.gl_pathv[i], word, sizeof word) && strcmp(word, "performance") != 0;
        c = add(f, "governor", slow == 0, slow ? "%zu of %zu processors slow down when idle" : "performance", slow,
                list.gl_pathc);
        fix(c, "sudo cpupower frequency-set -g performance");
        globfree(&list);
    }
    if (kn_devices_read_line("/sys/devices/system/clocksource/clocksource0/current_clocksource", word, sizeof word)) {
        c = add(f, "clock", strcmp(word, "hpet") != 0 && strcmp(word, "acpi_pm") != 0, "%s", word);
        fix(c, "add clocksource=tsc to the kernel's parameters: reading the clock %s takes a microsecond", word);
    }
    bool full = uname(&kernel) == 0 && strstr(kernel.version, "PREEMPT_RT");
    add(f, "kernel", true, "%s%s", kernel.release,
        full ? ", PREEMPT_RT" : ", without PREEMPT_RT: if ticks are late, apt install linux-image-rt-amd64");
}

enum { GROUPS = 256 };

// Return true if the user is in a group. by_now false: use the groups of this process, which date from the log-in.
// by_now true: use the system's list of groups, which may be newer.
static bool has_group(gid_t group, bool by_now)
{
    gid_t list[GROUPS];
    int count = GROUPS;
    const struct passwd *user = by_now ? getpwuid(getuid()) : NULL;
    if (!by_now) count = getgroups(GROUPS, list);
    else if (!user || getgrouplist(user->pw_name, user->pw_gid, list, &count) < 0) return false;
    for (int i = 0; i < count; i++)
        if (list[i] == group) return true;
    return !by_now && getegid() == group;
}

// Check that the user is a member of `group`. whose: the right of the group, for the message, such as "owns
// /dev/ttyACM0".
static void look_at_group(findings *f, const struct group *group, const char *whose)
{
    char name[64];
    // Copy the data of *group, because a later call of getgrnam or getgrgid may overwrite *group.
    snprintf(name, sizeof name, "%s", group->gr_name);
    gid_t id = group->gr_gid;
    bool needed = geteuid() != 0, has = has_group(id, false), soon = has_group(id, true);
    check *c = add(f, "group", !needed || has, "%s, %s: %s", name, whose,
                   has      ? "a member"
                   : needed ? "not a member"
                            : "root need not be a member");
    if (soon) fix(c, "log in again: this session is older than the membership");
    else fix(c, "sudo usermod -aG %s $USER; log in again", name);
}

// Check the groups of knead itself and of the serial lines, each group once.
static void look_at_groups(findings *f, const char *root, const kn_found *found, int count)
{
    const struct group *knead = getgrnam("knead");
    if (knead) look_at_group(f, knead, "may send commands with knead ctl");
    else
        add(f, "group", true,
            "no group knead: kneadd.service is not installed; a kneadd that you start yourself accepts your commands");
    gid_t told[KN_DEVICES_MAX];
    int tolds = 0;
    for (int i = 0; i < count; i++) {
        char path[PATH_MAX], whose[64 + KN_DEVICES_TEXT];
        struct stat node;
        bool known = false;
        snprintf(path, sizeof path, "%s%s", root, found[i].where);
        // Check a group only if it gives access to a serial line: the group may read and write the device file, and
        // other users may not.
        if (strcmp(found[i].kind, "tty") != 0 || stat(path, &node) != 0 || (node.st_mode & 0066) != 0060) continue;
        for (int t = 0; t < tolds; t++) known |= told[t] == node.st_gid;
        const struct group *owner = known ? NULL : getgrgid(node.st_gid);
        if (!owner) continue;
        told[tolds++] = node.st_gid;
        snprintf(whose, sizeof whose, "owns %s", found[i].where);
        look_at_group(f, owner, whose);
    }
}

static void look_at_devices(findings *f, const char *root)
{
    kn_found *found = calloc(KN_DEVICES_MAX, sizeof *found);
    int count = found ? kn_devices_find(root, found) : 0;
    look_at_groups(f, root, found, count);
    for (int i = 0; i < count; i++) {
        const kn_found *d = &found[i];
        // Do not check the services spacenavd and Inverse Service, because they are optional.
        bool service = strcmp(d->kind, "tty") != 0 && strcmp(d->kind, "usb") != 0;
        if (!service) fix(add(f, d->kind, d->ready, "%s: %s", d->where, d->ready ? d->use : d->missing), "%s", d->fix);
    }
    free(found);
}

// Check the way that kneadd takes to a card, and that the IOMMU keeps the card from the memory of this machine.
static void look_at_card(findings *f, const char *root, const char *card)
{
    char sysfs[PATH_MAX], path[PATH_MAX + 64], line[300], driver[KN_LINK_CARD], group[KN_LINK_CARD];
    unsigned vendor, device;
    snprintf(sysfs, sizeof sysfs, "%s/sys", root);
    snprintf(path, sizeof path, "%s/bus/pci/devices/%s/modalias", sysfs, card);
    if (!kn_devices_read_line(path, line, sizeof line) || sscanf(line, "pci:v%8xd%8x", &vendor, &device) != 2) {
        fix(add(f, "card", false, "%s: no such PCI function", card),
            "echo 1 | sudo tee /sys/bus/pci/rescan; lspci -D lists all functions");
        return;
    }
    // the way: vfio-pci if the card is bound to it, otherwise sysfs, which a kernel under lockdown refuses
    const bool isolated = kn_link_vfio(sysfs, card, driver, group);
    snprintf(path, sizeof path, "%s/kernel/security/lockdown", sysfs);
    const bool locked = !isolated && kn_devices_read_line(path, line, sizeof line) && !strstr(line, "[none]");
    if (isolated) snprintf(path, sizeof path, "%s/dev/vfio/%s", root, group);
    else snprintf(path, sizeof path, "%s/bus/pci/devices/%s/resource0", sysfs, card);
    const bool open = access(path, R_OK | W_OK) == 0;
    check *c = add(f, "card", open && !locked, "%s by %s, %s: %s", card, isolated ? "vfio-pci" : "sysfs", path,
                   locked ? "refused, since this kernel is locked down"
                   : open ? "can be opened"
                          : strerror(errno));
    if (locked) fix(c, "bind the card to vfio-pci, see the check `isolation`");
    else if (isolated)
        fix(c,
            "echo 'SUBSYSTEM==\"vfio\", GROUP=\"knead\", MODE=\"0660\"' | sudo tee /etc/udev/rules.d/70-knead.rules; "
            "sudo udevadm control --reload; sudo udevadm trigger -s vfio");
    else if (access(path, F_OK) != 0) fix(c, "%s has no BAR 0, so it is no circuit of Knead; lspci -D lists all", card);
    else fix(c, "sudo chown $USER %s; echo 1 | sudo tee %s/bus/pci/devices/%s/enable", path, sysfs, card);
    c = add(f, "isolation", isolated,
            *group ? "%s is in IOMMU group %s, driver %s"
                   : "%s has no IOMMU group: nothing keeps it from the memory of this machine",
            card, group, *driver ? driver : "none");
    *line = 0;
    if (*driver)
        snprintf(line, sizeof line,
                 "if this is the circuit, and not a card that %s drives: echo %s | sudo tee "
                 "/sys/bus/pci/drivers/%s/unbind; ",
                 driver, card, driver);
    if (!*group)
        fix(c, "switch on the IOMMU (VT-d or AMD-Vi) in the firmware's setup; add intel_iommu=on to the kernel's "
               "parameters on Intel");
    else
        fix(c,
            "sudo modprobe vfio-pci; %secho %04x %04x | sudo tee /sys/bus/pci/drivers/vfio-pci/new_id; this outlasts "
            "remove and rescan, which driver_override does not; for every boot: options vfio-pci ids=%04x:%04x in "
            "/etc/modprobe.d/knead.conf",
            line, vendor, device, vendor, device);
}

// --- measurement of wake-up lateness ---

typedef struct wakes {
    int ticks; // milliseconds to measure
    // count: number of wake-ups; missed: number of missed ticks; late_ns: lateness of each wake-up.
    int64_t count, missed, late_ns[];
} wakes;

// Sleep until each millisecond, as the servo loop does, and record the lateness of each wake-up.
static void *sleep_by_milliseconds(void *arg)
{
    wakes *w = arg;
    kn_clock clock;
    kn_clock_start(&clock, kn_now_ns() + KN_PERIOD_NS);
    for (kn_wake wake = {0}; wake.tick < w->ticks;) {
        wake = kn_clock_wait(&clock);
        w->missed += wake.missed;
        if (w->count < w->ticks) w->late_ns[w->count++] = wake.late_ns;
    }
    return NULL;
}

// Run the measuring loop in a real-time thread. The check fails if too many ticks were missed, or if the 99th
// percentile (p99) of the lateness is too high.
static void measure(findings *f, int ticks)
{
    kn_rt rt;
    pthread_t thread;
    wakes *w = calloc(1, sizeof *w + (size_t)ticks * sizeof w->late_ns[0]);
    if (!w) return;
    w->ticks = ticks;
    kn_rt_enter(&rt, KN_RT_AUTO);
    if (kn_rt_thread(&rt, &thread, "doctor", KN_RT_SERVO, KN_RT_CPU_SERVO, sleep_by_milliseconds, w) == 0) {
        pthread_join(thread, NULL);
        qsort(w->late_ns, (size_t)w->count, sizeof w->late_ns[0], kn_ascending_i64);
        double p50 = 1e-3 * (double)w->late_ns[w->count / 2], p99 = 1e-3 * (double)w->late_ns[w->count * 99 / 100];
        double most = 1e-6 * (double)w->late_ns[w->count - 1];
        // A tick with an ordinary object takes half a millisecond. So a wake-up may be late by the other half of the
        // millisecond.
        check *c = add(f, "wakes", w->missed * 1000 <= w->count && p99 <= 500,
                       "of %d, %" PRId64 " missed; late by %.0f us (p50), %.0f us (p99), %.2f ms (maximum)", ticks,
                       w->missed, p50, p99, most);
        fix(c, "%s",
            rt.fifo ? "run kneadd on a machine with PREEMPT_RT and no other real-time work; a virtual machine stops "
                      "while its host does other work"
                    : "get real-time priority first: see the check `priority`");
    }
    kn_rt_leave(&rt);
    free(w);
}

// Measure what a second thread of a step would bring.
static void measure_threads(findings *f)
{
    kn_model_def def = kn_model_def_default();
    def.nodes[0] = def.nodes[1] = 16, def.nodes[2] = 10;
    kn_backend b = {0};
    char why[64] = "not enough memory";
    kn_model *model = kn_model_build(&def, why, sizeof why);
    kn_helper *helper = model && kn_backend_cpu(&b, model) ? kn_helper_create(why, sizeof why) : NULL;
    if (helper) {
        const double one_us = 1e-3 * (double)kn_served_object_worst(&b, NULL, model, 0),
                     two_us = 1e-3 * (double)kn_served_object_worst(&b, helper, model, 0);
        add(f, "threads", true,
            "the worst tick of %d nodes takes %.0f us with one thread, %.0f us with solver.threads 2",
            model->node_count, one_us, two_us);
    } else add(f, "threads", true, "no second thread for a step: %s", why);
    kn_helper_destroy(helper);
    if (b.destroy) b.destroy(b.self);
    kn_model_destroy(model);
}

// --- output ---

static int print_json(const findings *f)
{
    json_t *list = json_array();
    for (int i = 0; i < f->count; i++) {
        const check *c = &f->check[i];
        json_array_append_new(list, json_pack("{s:s, s:b, s:s, s:s}", "check", c->name, "good", c->good, "found",
                                              c->found, "fix", c->fix));
    }
    return kn_devices_print("doctor", "checks", list);
}

static void print_lines(const findings *f)
{
    for (int i = 0; i < f->count; i++) {
        const check *c = &f->check[i];
        printf("%-5s %-13s %s\n", c->good ? "ok" : "LACKS", c->name, c->found);
        if (*c->fix) printf("%19s fix: %s\n", "", c->fix);
    }
}

typedef struct options {
    const char *root, *card;
    bool json;
    double seconds;
} options;

int kn_doctor_main(int argc, char **argv)
{
    static const kn_option rows[] = {
        KN_OPTION("json", FLAG, .offset = offsetof(options, json)),
        KN_OPTION("seconds", QUANTITY, .offset = offsetof(options, seconds), .unit = "s",
                  .expected = "a time from 1 to 3600 s", KN_RANGE(1, 3600)),
        KN_OPTION("card", TEXT, .offset = offsetof(options, card)),
        KN_OPTION("root", TEXT, .offset = offsetof(options, root)),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    static findings f;
    options o = {.root = "", .seconds = 2};
    int code = kn_options_read(&table, &o, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (optind < argc) return kn_complain("doctor", KN_EXIT_USAGE, "`%s`: expected options only", argv[optind]);
    if (strlen(o.root) > PATH_MAX / 2) return kn_complain("doctor", KN_EXIT_USAGE, "--root: expected a shorter path");
    if (o.card && !kn_link_is_function(o.card))
        return kn_complain("doctor", KN_EXIT_USAGE, "--card %s: expected a PCI function, such as 0000:01:00.0", o.card);
    code = KN_EXIT_OK;
    look_at_limits(&f);
    look_at_bus(&f);
    look_at_processor(&f);
    look_at_devices(&f, o.root);
    if (o.card) look_at_card(&f, o.root, o.card);
    measure(&f, (int)(1000 * o.seconds + 0.5));
    measure_threads(&f);
    if (o.json) code = print_json(&f);
    else print_lines(&f);
    for (int i = 0; i < f.count && code == KN_EXIT_OK; i++)
        if (!f.check[i].good) code = KN_EXIT_FAILED;
    return code;
}
