// knead devices: lists the haptic devices of this machine. If a device is not ready, the list has the reason and the
// remedy.
#include "clients/tactile/devices.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/tactile/haply.h"
#include "clients/tactile/spacenav.h"
#include "clients/tactile/vendor.h"
#include "server/option_table.h"
#include <errno.h>
#include <glob.h>
#include <grp.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char help[] =
    "usage: knead devices [--json]\n\n"
    "List the devices of this machine that can serve as a hand: spacenavd, Haply's Inverse Service, serial lines and\n"
    "haptic devices on USB. Each entry has the command for the device and the `device:` that a scene needs. If the\n"
    "device is not ready, the entry has the reason and the fix. No device is opened.\n\n"
    "  --json       print JSON\n"
    "  --root DIR   search DIR/dev and DIR/sys instead of /dev and /sys\n\n"
    "Examples:\n"
    "    knead devices\n\n"
    "Exit codes: 0 the list was printed, 2 bad input.\n";

// Known USB devices. Columns: vendor, first and last product, name, most suitable profile, driver of `knead hand` (NULL:
// none). knead drives pucks (3D mice) through spacenavd. Logitech sold 3Dconnexion's first ones.
static const struct known {
    unsigned vendor, first, last;
    const char *name, *profile, *driver;
} usb_known[] = {{0x256f, 0, 0xffff, "3Dconnexion puck", "bench", "spacenav"},
                 {0x046d, 0xc603, 0xc62b, "3Dconnexion puck", "bench", "spacenav"},
                 {0x0403, 0xcb48, 0xcb48, "Novint Falcon", "falcon", NULL},
                 {0x1451, 0, 0xffff, "Force Dimension", "omega", "forcedimension"},
                 {0x2988, 0, 0xffff, "3D Systems Touch", "touch", "touch"}};

// Format a text. Replace bytes that are not printable, because a terminal could take them as commands.
__attribute__((format(printf, 2, 3))) static void set(char text[KN_DEVICES_TEXT], const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(text, KN_DEVICES_TEXT, format, args);
    va_end(args);
    for (char *c = text; *c; c++)
        if (*c < ' ' || *c > '~') *c = '?'; // a device may report any name
}

bool kn_devices_read_line(const char *path, char *line, size_t size)
{
    FILE *file = fopen(path, "r");
    bool read = file && fgets(line, (int)size, file);
    if (file) fclose(file);
    if (read) line[strcspn(line, "\n")] = 0;
    return read;
}

// Read the first line of the file directory/name. The result is "" if the file cannot be read or is empty.
static void read_line(const char *directory, const char *name, char *line, size_t size)
{
    char path[PATH_MAX + 32];
    snprintf(path, sizeof path, "%s/%s", directory, name);
    if (!kn_devices_read_line(path, line, size)) *line = 0;
}

// Read a hexadecimal number of 16 bits from a file. Return 0 if the file has no number.
static unsigned hex(const char *directory, const char *name)
{
    char line[16];
    read_line(directory, name, line, sizeof line);
    return (unsigned)strtoul(line, NULL, 16) & 0xffff;
}

static void name_usb(kn_found *f, const char *directory)
{
    char maker[64], product[96];
    read_line(directory, "manufacturer", maker, sizeof maker);
    read_line(directory, "product", product, sizeof product);
    set(f->name, "%s%s%s", maker, *maker && *product ? " " : "", product);
    snprintf(f->usb, sizeof f->usb, "%04x:%04x", hex(directory, "idVendor"), hex(directory, "idProduct"));
}

// ---- candidates

static void find_spacenavd(kn_found *f, bool puck)
{
    strcpy(f->kind, "spacenavd");
    set(f->where, "%s", kn_spacenav_socket());
    set(f->use, "knead hand spacenav");
    f->profile = "bench"; // a puck has no motors, so the force limit of the profile does not matter
    if (!puck) set(f->name, "no known puck on USB");
    f->ready = kn_spacenav_reach();
    if (f->ready) return;
    if (errno == EACCES) {
        set(f->missing, "no permission for the socket");
        set(f->fix, "chmod a+rw %s", f->where);
    } else {
        set(f->missing, "spacenavd is not running%s", puck ? ", but a puck is plugged in" : "");
        set(f->fix, "apt install spacenavd; systemctl start spacenavd");
    }
}

static void find_haply(kn_found *f)
{
    char host[KN_HAPLY_HOST];
    int port;
    strcpy(f->kind, "haply");
    kn_haply_url(KN_HAPLY_URL, host, &port);
    set(f->where, KN_HAPLY_URL);
    set(f->use, "knead hand haply");
    f->profile = "unknown"; // no measured profile of an Inverse3 exists
    f->ready = kn_haply_reach(host, port, f->missing, sizeof f->missing);
    if (!f->ready) set(f->fix, "start Haply Hub, or: systemctl start haply-inverse-service");
}

static const struct known *know(unsigned vendor, unsigned product)
{
    for (size_t i = 0; i < sizeof usb_known / sizeof *usb_known; i++)
        if (usb_known[i].vendor == vendor && usb_known[i].first <= product && product <= usb_known[i].last)
            return &usb_known[i];
    return NULL;
}

// Check the library of the device's maker. Return false if it is missing, with the reason and the remedy in the entry.
static bool find_library(kn_found *f, const struct known *known)
{
    bool touch = !strcmp(known->driver, "touch");
    set(f->use, "knead hand %s%s", known->driver, touch ? " --no-watchdog" : "");
    if (kn_vendor_load(touch ? KN_VENDOR_TOUCH : KN_VENDOR_FORCEDIMENSION, f->missing, sizeof f->missing)) return true;
    set(f->fix, "install the maker's library as clients/tactile/README.md says");
    return false;
}

// Describe one serial line. The entry has its USB vendor and product. If the user may not open the line, the entry also
// has the missing permission and the remedy.
static void find_tty(kn_found *f, const char *root, const char *path)
{
    char device[PATH_MAX];
    struct stat s = {0};
    strcpy(f->kind, "tty");
    set(f->where, "%s", path + strlen(root));
    snprintf(device, sizeof device, "%s/sys/class/tty/%s/device/..", root, strrchr(path, '/') + 1);
    // In /sys, a ttyUSB lies one directory deeper than a ttyACM, so the USB device of a ttyUSB is one level further up.
    if (hex(device, "idVendor") == 0) strcat(device, "/..");
    if (hex(device, "idVendor") != 0) name_usb(f, device);
    set(f->use, "knead hand paddle --tty %s", f->where);
    // A Touch appears as a serial line, but libHD opens it.
    const struct known *known = know(hex(device, "idVendor"), hex(device, "idProduct"));
    bool touch = known && known->driver && !strcmp(known->driver, "touch");
    f->profile = touch ? known->profile : "unknown";
    if (touch && !find_library(f, known)) return;
    f->ready = stat(path, &s) == 0 && access(path, R_OK | W_OK) == 0;
    if (f->ready) return;
    // If the group of the device file may read and write the file, the user can join this group, which is a lasting
    // remedy.
    const struct group *g = getgrgid(s.st_gid);
    set(f->missing, "no permission");
    if (g && (s.st_mode & 0060) == 0060) set(f->fix, "sudo usermod -aG %s $USER, and log in again", g->gr_name);
    else set(f->fix, "sudo chmod a+rw %s", f->where);
}

// Describe a USB device that the library of its maker serves.
static void find_haptic(kn_found *f, const char *root, const char *path, const struct known *known)
{
    char bus[8], number[8], node[PATH_MAX + 32];
    if (!find_library(f, known)) return;
    read_line(path, "busnum", bus, sizeof bus);
    read_line(path, "devnum", number, sizeof number);
    snprintf(node, sizeof node, "%s/dev/bus/usb/%03d/%03d", root, atoi(bus), atoi(number));
    f->ready = access(node, R_OK | W_OK) == 0;
    if (f->ready) return;
    const int why = errno;
    set(f->missing, "%s: %s", node + strlen(root), strerror(why));
    if (why != EACCES) set(f->fix, "plug the device in again");
    else
        set(f->fix,
            "echo 'SUBSYSTEM==\"usb\", ATTR{idVendor}==\"%04x\", MODE=\"0666\"' | sudo tee "
            "/etc/udev/rules.d/99-haptic.rules; then plug the device in again",
            known->vendor);
}

// Describe a USB device if it is in the table of known devices, and return true. A Touch is found as a serial line. Set
// *puck if the device is a puck (3D mouse).
static bool find_usb(kn_found *f, const char *root, const char *path, bool *puck)
{
    const struct known *known = know(hex(path, "idVendor"), hex(path, "idProduct"));
    if (!known || !strcmp(known->profile, "touch")) return false;
    strcpy(f->kind, "usb");
    set(f->where, "%s", path + strlen(root));
    name_usb(f, path);
    if (!*f->name) set(f->name, "%s", known->name);
    f->profile = known->profile;
    if (!known->driver) {
        set(f->missing, "no driver for %s", known->name);
        set(f->fix, "extend clients/examples/touch.c with the maker's library; set `device: %s` in the scene",
            known->profile);
    } else if (strcmp(known->driver, "spacenav") == 0) {
        *puck = f->ready = true;
        set(f->use, "knead hand spacenav");
    } else {
        find_haptic(f, root, path, known);
    }
    return true;
}

int kn_devices_find(const char *root, kn_found *found)
{
    char pattern[PATH_MAX];
    glob_t list;
    bool puck = false;
    // The first two entries of the list are spacenavd and the Inverse Service. They are filled in last, because the
    // search for USB devices tells whether a puck is present.
    int n = 2;
    memset(found, 0, KN_DEVICES_MAX * sizeof *found);
    snprintf(pattern, sizeof pattern, "%s/dev/tty{ACM,USB}*", root);
    if (glob(pattern, GLOB_BRACE, NULL, &list) == 0) {
        for (size_t i = 0; i < list.gl_pathc && n < KN_DEVICES_MAX; i++) find_tty(&found[n++], root, list.gl_pathv[i]);
        globfree(&list);
    }
    snprintf(pattern, sizeof pattern, "%s/sys/bus/usb/devices/*", root);
    if (glob(pattern, 0, NULL, &list) == 0) {
        for (size_t i = 0; i < list.gl_pathc && n < KN_DEVICES_MAX; i++)
            n += find_usb(&found[n], root, list.gl_pathv[i], &puck);
        globfree(&list);
    }
    find_spacenavd(&found[0], puck);
    find_haply(&found[1]);
    return n;
}

// ---- output

static void print_lines(const kn_found *found, int count)
{
    int ttys = 0;
    for (const kn_found *f = found; f < found + count; f++) {
        ttys += !strcmp(f->kind, "tty");
        printf("%-9s %s%s%s%s%s\n", f->kind, f->where, *f->usb ? "  " : "", f->usb, *f->name ? "  " : "", f->name);
        if (f->ready) printf("          ready: %s, with a scene that has `device: %s`\n", f->use, f->profile);
        else printf("          %s\n          fix: %s\n", f->missing, f->fix);
    }
    if (ttys == 0) printf("tty       no /dev/ttyACM* or /dev/ttyUSB*: no serial device is plugged in\n");
    printf("\nNo driver has been tested on hardware. Without a device, use knead probe or knead web.\n");
}

int kn_devices_print(const char *command, const char *key, json_t *list)
{
    json_t *root = json_pack("{s:o}", key, list);
    char *text = root ? json_dumps(root, JSON_INDENT(2)) : NULL;
    json_decref(root);
    if (!text) return kn_complain(command, KN_EXIT_INTERNAL, "out of memory");
    puts(text);
    free(text);
    return KN_EXIT_OK;
}

static int print_json(const kn_found *found, int count)
{
    json_t *list = json_array();
    for (const kn_found *f = found; f < found + count; f++)
        json_array_append_new(list, json_pack("{s:s,s:s,s:s,s:s,s:b,s:s,s:s,s:s,s:s}", "kind", f->kind, "where",
                                              f->where, "usb", f->usb, "name", f->name, "ready", f->ready, "use",
                                              f->use, "profile", f->profile, "missing", f->missing, "fix", f->fix));
    return kn_devices_print("devices", "devices", list);
}

typedef struct options {
    const char *root;
    bool json;
} options;

int kn_devices_main(int argc, char **argv)
{
    static const kn_option rows[] = {
        KN_OPTION("json", FLAG, .offset = offsetof(options, json)),
        KN_OPTION("root", TEXT, .offset = offsetof(options, root)),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    options o = {.root = ""};
    int code = kn_options_read(&table, &o, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (optind < argc) return kn_complain("devices", KN_EXIT_USAGE, "`%s`: expected options only", argv[optind]);
    if (strlen(o.root) > PATH_MAX / 2) return kn_complain("devices", KN_EXIT_USAGE, "--root: expected a shorter path");
    kn_found *found = calloc(KN_DEVICES_MAX, sizeof *found);
    if (!found) return kn_complain("devices", KN_EXIT_INTERNAL, "out of memory");
    int count = kn_devices_find(o.root, found);
    code = KN_EXIT_OK;
    if (o.json) code = print_json(found, count);
    else print_lines(found, count);
    free(found);
    return code;
}
